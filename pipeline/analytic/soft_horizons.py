"""Soft horizons: the visibility of a node is a ramp, as wide as the spread of the horizon over the node's box.

How much of a box both viewer and light reach depends on their azimuths: alike (the smaller share decides), at right
angles (the shares multiply) or opposite (the hidden parts exclude each other).
"""

from __future__ import annotations

from typing import Final

import numpy as np

from pipeline.compiled.arrays import Float32, Float64
from pipeline.compiled.decorators import fast_kernel, inlined_fast_kernel, inlined_kernel, kernel

_0, _1, _HALF = np.float32(0.0), np.float32(1.0), np.float32(0.5)
_RAMP, _RAMP_SLOPE = np.float32(0.02), np.float32(0.4)  # width of a point's ramp, and its growth with the deviation
_TINY: Final = np.float32(1e-20)


def over_boxes(
    values: Float64 | Float32, squares: Float64 | Float32, rows: Float64, columns: Float64
) -> tuple[Float64, Float64]:
    """Return mean and variance of horizons over boxes, (azimuths, boxes), boxes of a row following each other.

    Parameters
    ----------
    values, squares : float (azimuths, rows, columns)
        Horizons of the cells of a grid, and their squares (means of both, where many grids share the boxes).
    rows, columns : float64 (boxes, cells)
        Share of each box in each cell, along both axes.
    """
    mean, square = ((rows @ grid @ columns.T).reshape(len(grid), -1) for grid in (values, squares))
    return mean, np.maximum(square - mean**2, 0.0)


@kernel
def sharpness_of_points(deviation: np.float32) -> np.float32:
    """Return 1 over the width of the ramp at nodes placed in a footprint, which grows with its deviation."""
    return _1 / (_RAMP + _RAMP_SLOPE * deviation)


@fast_kernel
def azimuths_apart(
    ix: np.float32, iy: np.float32, ox: np.float32, oy: np.float32
) -> tuple[np.float32, np.float32, np.float32]:
    """Return how far two directions' azimuths are alike, at right angles and opposite; the three sum to 1."""
    lengths = (ix * ix + iy * iy) * (ox * ox + oy * oy)
    cosine = (ix * ox + iy * oy) / np.sqrt(max(lengths, _TINY))
    alike, opposite = max(cosine, _0), max(-cosine, _0)
    return alike, _1 - alike - opposite, opposite


@inlined_fast_kernel
def above(z: np.float32, low: np.float32, high: np.float32, turn: np.float32, sharpness: np.float32) -> np.float32:
    """Return by how many widths of the ramp a direction of rise z clears a horizon between two azimuths."""
    return (z - low - turn * (high - low)) * sharpness


@inlined_fast_kernel
def ramp(above: np.float32) -> np.float32:
    """Return the share of a box from which a direction is free."""
    return min(max(_HALF + above, _0), _1)


# Not a fast kernel: regrouped, first + second - 1 would lose a small share's digits, and shadows could make light.
@inlined_kernel
def seen_and_lit(
    first: np.float32, second: np.float32, alike: np.float32, right: np.float32, opposite: np.float32
) -> np.float32:
    """Return the share of a box from which two directions are both free, given those of each and `azimuths_apart`."""
    return alike * min(first, second) + right * first * second + opposite * max(first - (_1 - second), _0)
