"""Kinds of measurement: what each depends on, its tasks in a recipe, and its work.

`measurement.py` is their base class; what a task needs, its title and the names of its files follow from its fields.
`subjects.py` has their fabrics and models. References by the truth: images in `truth.py`, `SceneShot` in `scenes.py`.
Measurements: of methods on fabrics, at their extremes, between fabrics and in time (`fabrics.py`), in scenes
(`scenes.py`), and of the truth itself (`truth.py`). The code that measures is in `reports.measure` and `reports.truth`;
it is imported when a task runs.
"""
