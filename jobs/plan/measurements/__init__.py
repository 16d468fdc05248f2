"""Kinds of measurement, one in each file: its identity, its tasks in a recipe, and its work.

`measurement.py` is their base class, `subjects.py` has their fabrics and models, `catalogue.py` lists them. References
by the truth: the folder `images`, `scene_shot.py`. Measurements: `truth.py`, `method.py`, `latents.py`, `scene.py`,
`frame_time.py`, `extremes.py`, `timing.py`, `added_metric.py`. `live_page.py` measures nothing; the page shows it. The
code that measures is in `reports.measure`; it is imported when a task runs.
"""
