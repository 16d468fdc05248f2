"""Versions of all numbers but the measurements', which `reports/catalogue.toml` has.

Whoever changes numbers for the same input raises the version that covers them. Versions are part of the identity of
every task whose result depends on them; the git revision is not. They stand apart from the code that they cover so
that a plan needs no compiler.
"""

from typing import Final

TRUTH: Final = 9
"""Ground truth, its random sequences, the queries that are drawn: every shard and every picture of the truth."""

TRAINING: Final = 4  # the training loop and the files that it writes

MODELS: Final[dict[str, int]] = {
    "curved": 2,
    "point_sampled": 6,
    "prefiltered": 2,
    "selvage": 18,
    "soft_nodes": 14,
    "woven": 2,
}
"""A model's network, features and answers, by the name of its folder. A model that is not listed has version 1."""

BOUND: Final = 8  # how the energy bound changes the answers of a network (`pipeline.models.bounded`)

FALLBACK: Final = 14
"""Answers in scenes to queries that a method was not trained on: by itself, or by `pipeline.models.fallback`."""

SCENES: Final = 4  # the shipped scenes, and the queries of any scene

SCENE_BENCH: Final = 5  # measurements in scenes and the files they write (`reports.measure.scene`)

VIEWER: Final = 10  # the page of a live fabric: its shaders, scripts and views (`reports.viewer`)

EXTREMES: Final = 1  # measurements at extremes (`reports.measure.extremes`)

MITSUBA: Final = 1  # frames of the integrator `twillight_path`
