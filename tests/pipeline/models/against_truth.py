"""Answers of methods beside the ground truth."""

import numpy as np

from pipeline.truth.estimator import estimate
from pipeline.truth.options import TruthOptions

GREY = np.array([0.3, 0.3, 0.5, 0.5])
"""Colours of the components of a grey cloth."""


def truth_of(fabric, queries, **options):
    """Return the true components (N, 4), to a relative error of .01 if nothing else is said."""
    return estimate(fabric, queries, TruthOptions(**({"relative_error": 0.01} | options)), 1).mean


def colour_error(found, truth):
    """Return the RMSE of a grey cloth's colour over its mean, from components (N, 4)."""
    return np.sqrt(np.mean(((found - truth) @ GREY) ** 2)) / np.mean(truth @ GREY)
