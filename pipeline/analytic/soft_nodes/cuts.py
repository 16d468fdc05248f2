"""Where lines cross the pieces of a cloth: the next border on a line, the piece at a place, its cell of a grid."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from pipeline.analytic.soft_nodes.nodes import UPPER, X_HIGH, X_LOW, Y_HIGH, Y_LOW
from pipeline.compiled.arrays import Float32, Index
from pipeline.compiled.decorators import inlined_kernel, kernel
from pipeline.compiled.float32 import arcsine
from pipeline.truth.geometry.heightfield import WARP, WEFT

NEAREST: Final = 1e-5
"""Least length between cuts, in yarn spacings."""

_0, _HALF = np.float32(0.0), np.float32(0.5)
_INVERSE_PI = np.float32(1.0 / math.pi)


@kernel
def next_cut(place: float, forward: bool, radius: float) -> float:
    """Return the next border of a piece along an axis, of cells and of yarns of a radius."""
    cell = math.floor(place + NEAREST) if forward else math.ceil(place - NEAREST) - 1
    inside = place - cell
    low, high = 0.5 - radius, 0.5 + radius
    if forward:
        if inside < low - NEAREST:
            return cell + low
        return cell + high if inside < high - NEAREST and radius < 0.5 else cell + 1.0
    if inside > high + NEAREST:
        return cell + high
    return cell + low if inside > low + NEAREST and radius < 0.5 else float(cell)


@inlined_kernel
def piece_at(piece_starts: Index, bounds: Float32, cell: int, x: np.float32, y: np.float32) -> int:
    """Return the piece of a cell at a place within it, -1 if there is none."""
    for p in range(piece_starts[cell], piece_starts[cell + 1]):
        box = bounds[p]
        if box[X_LOW] <= x <= box[X_HIGH] and box[Y_LOW] <= y <= box[Y_HIGH]:
            return p
    return -1


@kernel
def in_grid(box: Float32, family: int, radius: np.float32, x: np.float32, y: np.float32, size: int) -> int:
    """Return the cell of a piece's grid at a place, counted from its first; cells are even in v across a yarn."""
    count = np.float32(size)
    last = count - np.float32(0.01)
    share_x = (x - box[X_LOW]) / (box[X_HIGH] - box[X_LOW])
    share_y = (y - box[Y_LOW]) / (box[Y_HIGH] - box[Y_LOW])
    if family == WARP:
        share_x = arcsine((x - _HALF) / radius) * _INVERSE_PI + _HALF
    elif family == WEFT:
        share_y = arcsine((y - _HALF) / radius) * _INVERSE_PI + _HALF
    row, column = min(max(share_y * count + UPPER, _0), last), min(max(share_x * count + UPPER, _0), last)
    return size * int(row) + int(column)
