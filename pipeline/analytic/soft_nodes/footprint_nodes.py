"""Nodes that a narrow footprint places itself, in every piece that it touches: Gauss's rule over the part it covers.

Weights are shares of the footprint, up to the 1 % that it is cut off at and the error of the rule; the sums of a query
are divided by one another, so that neither need be exact.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
import numpy.typing as npt

from pipeline.analytic.soft_horizons import above, ramp
from pipeline.analytic.soft_nodes.nodes import BLOCK_NODES, BOUND, CURVE, LEVELS, SHIFT, X_HIGH, X_LOW, Y_HIGH, Y_LOW
from pipeline.analytic.soft_nodes.shade import ALONG, COS, HALF_ALONG, HALF_V, LIMIT, SIN, TURN, WEIGHT
from pipeline.compiled.arrays import Float32
from pipeline.compiled.decorators import fast_kernel, kernel
from pipeline.compiled.float32 import arcsine, remaining
from pipeline.truth.geometry.heightfield import WARP

LINE_ROWS: Final = 7
"""Rows of the scratch of `place_nodes`."""

MOST_ACROSS: Final = 6
"""Nodes of a piece along each axis, at most."""

_GAUSS_PLACES = np.zeros((MOST_ACROSS + 1, 8), np.float32)
_GAUSS_WEIGHTS = np.zeros((MOST_ACROSS + 1, 8), np.float32)
for _n in range(1, MOST_ACROSS + 1):
    _GAUSS_PLACES[_n, :_n], _GAUSS_WEIGHTS[_n, :_n] = np.polynomial.legendre.leggauss(_n)

_0, _1, _HALF = np.float32(0.0), np.float32(1.0), np.float32(0.5)
_INVERSE_PI, _INVERSE_TURN = np.float32(1.0 / math.pi), np.float32(0.5 / math.pi)
_VERTICAL = np.float32(0.99999)  # largest sine of v
_LEVELS = np.float32(LEVELS)


@kernel
def nodes_for(length: np.float32) -> int:
    """Return how many Gauss nodes resolve a Gaussian over `length` deviations."""
    if length < 0.8:
        return 2
    if length < 1.6:
        return 3
    if length < 2.5:
        return 4
    if length < 3.5:
        return 5
    return MOST_ACROSS


@fast_kernel
def _sine_cosine(v: np.float32) -> tuple[np.float32, np.float32]:
    """Return sine and cosine of |v| <= pi/2."""
    w = v * v
    series = np.float32(-1 / 5040) + w * np.float32(1 / 362880)
    sine = v * (_1 + w * (np.float32(-1 / 6) + w * (np.float32(1 / 120) + w * series)))
    sine = min(max(sine, -_VERTICAL), _VERTICAL)
    return sine, np.sqrt((_1 - sine) * (_1 + sine))


@fast_kernel
def place_nodes(
    bounds: Float32,
    first_cell: int,
    size: int,
    radius: np.float32,
    family: int,
    x: np.float32,
    y: np.float32,
    deviation_x: np.float32,
    deviation_y: np.float32,
    x_low: np.float32,
    x_high: np.float32,
    y_low: np.float32,
    y_high: np.float32,
    nodes: Float32,
    cells: npt.NDArray[np.uint32],
    start: int,
    line: Float32,
) -> int:
    """Place nodes of a footprint in a piece of yarn, and write them from `start` on.

    Parameters
    ----------
    bounds : float32 (7,)
        Of the piece.
    first_cell, size : int
        Its grid: where it begins, and cells along each axis.
    x, y, deviation_x, deviation_y : float32
        The footprint, from the corner of the cell.
    x_low, x_high, y_low, y_high : float32
        Part of the piece that it covers.
    nodes, cells : float32 (blocks, ROWS, BLOCK_NODES), uint32 (blocks * BLOCK_NODES,)
        Written.
    line : float32 (LINE_ROWS, 8)
        Scratch.

    Returns
    -------
    int
        Index after the last node.
    """
    warp = family == WARP
    count = np.float32(size)
    if warp:
        a_low, a_high, b_low, b_high = x_low - _HALF, x_high - _HALF, y_low, y_high
        centre_a, centre_b, inverse_a, inverse_b = x - _HALF, y, _1 / deviation_x, _1 / deviation_y
        low, length = bounds[Y_LOW], bounds[Y_HIGH] - bounds[Y_LOW]
        step_a, step_b = 1, size
    else:
        a_low, a_high, b_low, b_high = y_low - _HALF, y_high - _HALF, x_low, x_high
        centre_a, centre_b, inverse_a, inverse_b = y - _HALF, x, _1 / deviation_y, _1 / deviation_x
        low, length = bounds[X_LOW], bounds[X_HIGH] - bounds[X_LOW]
        step_a, step_b = size, 1
    across, along = nodes_for((a_high - a_low) * inverse_a), nodes_for((b_high - b_low) * inverse_b)
    v_low, v_high = arcsine(a_low / radius), arcsine(a_high / radius)
    half_v, middle_v = _HALF * (v_high - v_low), _HALF * (v_high + v_low)
    half_b, middle_b = _HALF * (b_high - b_low), _HALF * (b_high + b_low)
    area = half_v * half_b * radius * inverse_a * inverse_b * _INVERSE_TURN
    for k in range(8):
        v = middle_v + half_v * _GAUSS_PLACES[across, k]
        sv, cv = _sine_cosine(v)
        da = (radius * sv - centre_a) * inverse_a
        line[0, k], line[1, k] = sv, cv
        line[2, k] = area * _GAUSS_WEIGHTS[across, k] * cv * remaining(_HALF * da * da)
        line[3, k] = min(max((v * _INVERSE_PI + _HALF) * count, _0), count - np.float32(0.01))
        place = middle_b + half_b * _GAUSS_PLACES[along, k]
        db = (place - centre_b) * inverse_b
        line[4, k] = place - _HALF + bounds[SHIFT]
        line[5, k] = _GAUSS_WEIGHTS[along, k] * remaining(_HALF * db * db)
        line[6, k] = min(max((place - low) / length * count, _0), count - np.float32(0.01))
    k = start
    for j in range(along):
        # Along a weft, y of its frame runs against x.
        position = line[4, j] if warp else -line[4, j]
        half_along = half_b * _GAUSS_WEIGHTS[along, j] * _HALF
        cell = first_cell + int(line[6, j]) * step_b
        for i in range(across):
            block, slot = nodes[k // BLOCK_NODES], k % BLOCK_NODES
            block[SIN, slot], block[COS, slot], block[ALONG, slot] = line[0, i], line[1, i], position
            block[HALF_V, slot], block[HALF_ALONG, slot] = half_v * _GAUSS_WEIGHTS[across, i] * _HALF, half_along
            block[WEIGHT, slot] = line[5, j] * line[2, i]
            block[TURN, slot], block[LIMIT, slot] = bounds[CURVE], bounds[BOUND]
            cells[k] = cell + int(line[3, i]) * step_a
            k += 1
    return k


@kernel
def fill_block(nodes: Float32, cells: npt.NDArray[np.uint32], start: int) -> int:
    """Fill the last block with nodes that weigh nothing; return the blocks."""
    blocks = (start + BLOCK_NODES - 1) // BLOCK_NODES
    for k in range(start, blocks * BLOCK_NODES):
        block, slot = nodes[k // BLOCK_NODES], k % BLOCK_NODES
        block[:, slot] = _0
        block[COS, slot] = _1
        cells[k] = 0
    return blocks


@fast_kernel
def gap_area(
    bounds: Float32,
    grid: npt.NDArray[np.uint8],
    first_cell: int,
    size: int,
    low_o: int,
    high_o: int,
    turn_o: np.float32,
    sharpness: np.float32,
    oz: np.float32,
    x: np.float32,
    y: np.float32,
    deviation_x: np.float32,
    deviation_y: np.float32,
    x_low: np.float32,
    x_high: np.float32,
    y_low: np.float32,
    y_high: np.float32,
) -> np.float32:
    """Return the area that the viewer sees through a gap; arguments as in `place_nodes`."""
    inverse_x, inverse_y, count = _1 / deviation_x, _1 / deviation_y, np.float32(size)
    columns, rows = nodes_for((x_high - x_low) * inverse_x), nodes_for((y_high - y_low) * inverse_y)
    half_x, half_y = _HALF * (x_high - x_low), _HALF * (y_high - y_low)
    middle_x, middle_y = _HALF * (x_high + x_low), _HALF * (y_high + y_low)
    per_x = count / (bounds[X_HIGH] - bounds[X_LOW])
    per_y = count / (bounds[Y_HIGH] - bounds[Y_LOW])
    total = _0
    for j in range(rows):
        place_y = middle_y + half_y * _GAUSS_PLACES[rows, j]
        dy = (place_y - y) * inverse_y
        row = first_cell + size * min(max(int((place_y - bounds[Y_LOW]) * per_y), 0), size - 1)
        for i in range(columns):
            place_x = middle_x + half_x * _GAUSS_PLACES[columns, i]
            dx = (place_x - x) * inverse_x
            cell = row + min(max(int((place_x - bounds[X_LOW]) * per_x), 0), size - 1)
            low, high = np.float32(grid[cell + low_o]), np.float32(grid[cell + high_o])
            density = remaining(_HALF * (dx * dx + dy * dy))
            share = _GAUSS_WEIGHTS[rows, j] * _GAUSS_WEIGHTS[columns, i]
            total += share * density * ramp(above(oz * _LEVELS, low, high, turn_o, sharpness / _LEVELS))
    return total * half_x * half_y * inverse_x * inverse_y * _INVERSE_TURN * oz
