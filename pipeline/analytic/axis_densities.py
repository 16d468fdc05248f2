"""A wide Gaussian at fixed nodes, one axis at a time, summed over its images in all repeats.

A Gaussian along the axes is a product, so that its densities at the nodes of a cell are those of a rule along x times
those of a rule along y.
"""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

from pipeline.compiled.arrays import Float32, Mask
from pipeline.compiled.decorators import inlined_fast_kernel
from pipeline.compiled.float32 import remaining

NARROW: Final = 0.25
"""Deviation, in yarn spacings, below which fixed nodes are too far apart: a footprint places its own."""

_0, _1, _HALF = np.float32(0.0), np.float32(1.0), np.float32(0.5)


@inlined_fast_kernel
def axis_densities(
    places: Float32,
    weights: Float32,
    centre: np.float32,
    deviation: np.float32,
    reach: np.float32,
    density: Float32,
    touched: Mask,
    found: npt.NDArray[np.uint32],
) -> int:
    """Write the Gaussian at the nodes of all rules, times their weights, in the cells of one axis; list those touched.

    Parameters
    ----------
    places, weights : float32 (n,)
        Rules within a cell, one after another: a single loop for the vector units.
    centre, deviation, reach : float32
        The footprint, in cells; where it is cut off, in deviations.
    density : float32 (cells, n)
        Written, for touched cells only.
    touched, found : bool (cells,), uint32 (cells,)
        Written: which cells are touched, and their list.

    Returns
    -------
    int
        Number of touched cells.
    """
    cells = len(touched)
    reach = reach * deviation
    inverse = _1 / deviation
    first, last = int(np.floor(centre - reach)), int(np.floor(centre + reach))
    count = 0
    touched[:] = False
    cell = first % cells
    for column in range(first, last + 1):
        here = density[cell]
        if not touched[cell]:
            touched[cell] = True
            found[count] = cell
            count += 1
            here[:] = _0
        middle = centre - np.float32(column)
        for k in range(len(here)):
            d = (places[k] - middle) * inverse
            here[k] += weights[k] * remaining(_HALF * d * d)
        cell = cell + 1 if cell + 1 < cells else 0
    return count
