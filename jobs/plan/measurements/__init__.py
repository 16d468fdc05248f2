"""Kinds of measurement, one a file: what shapes its numbers, which tasks a recipe has of it, how one runs.

`measurement.py` is their base, `subjects.py` what they are planned from, `catalogue.py` lists them. First the truth:
`truth_picture.py`, `truth_frames.py`, `truth_edge.py`, `scene_shot.py`. Then what is measured: `truth.py`, `method.py`,
`latents.py`, `scene.py`, `frame_time.py`, `extremes.py`, `timing.py`. The code that measures lies in `reports.measure`;
it is imported when a task runs.
"""
