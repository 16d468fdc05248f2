"""Places of readings along the longer axis of a footprint, which stand for a Gaussian."""

from __future__ import annotations

import numpy as np
from scipy.special import ndtri

from pipeline.compiled.arrays import Float64


def taps(most: int) -> Float64:
    """Return in row n, up to `most`, the places of n readings of one weight: of mean 0 and variance 1.

    They are quantiles of the normal distribution, scaled; one reading is in the middle.
    """
    table = np.zeros((most + 1, most))
    for count in range(2, most + 1):
        places = ndtri((np.arange(count) + 0.5) / count)
        table[count, :count] = places / np.sqrt((places**2).mean())
    return table
