"""Nodes that a narrow footprint places itself, in every piece that it touches.

Gauss-Legendre's rule over the part that it covers; Gauss-Hermite's, with fewer nodes, where a piece covers all of it.

Weights are shares of the footprint, up to the 1 % that it is cut off at and the error of the rule; the sums of a query
are divided by one another, so that neither need be exact.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from pipeline.analytic.soft_horizons import above, ramp
from pipeline.analytic.soft_nodes.nodes import (
    BLOCK_NODES,
    BOUND,
    CURVE,
    FAMILY,
    LEVELS,
    SHIFT,
    UPPER,
    X_HIGH,
    X_LOW,
    Y_HIGH,
    Y_LOW,
    SoftNodeTable,
)
from pipeline.analytic.soft_nodes.scratch import Scratch
from pipeline.analytic.soft_nodes.shade import (
    ALONG,
    BLOCK_ROWS,
    COS,
    HALF_ALONG,
    HALF_V,
    LIMIT,
    SIN,
    TURN,
    WEIGHT,
    GridHorizons,
)
from pipeline.compiled.arrays import Float32
from pipeline.compiled.decorators import fast_kernel, inlined_fast_kernel, kernel
from pipeline.compiled.float32 import arcsine, remaining
from pipeline.truth.geometry.heightfield import RADIUS, WARP

REACH: Final = 2.6
"""Deviations at which a footprint is cut off; 1 % of it lies beyond."""

MOST_ACROSS: Final = 6
"""Most Gauss-Legendre nodes of a piece along each axis."""

HERMITE: Final = 4
"""Gauss-Hermite nodes along an axis where a piece covers the whole footprint."""

GAUSS_PLACES = np.zeros((MOST_ACROSS + 1, 8), np.float32)
GAUSS_WEIGHTS = np.zeros((MOST_ACROSS + 1, 8), np.float32)
for _n in range(1, MOST_ACROSS + 1):
    GAUSS_PLACES[_n, :_n], GAUSS_WEIGHTS[_n, :_n] = np.polynomial.legendre.leggauss(_n)

_HERMITE_PLACES, _HERMITE_WEIGHTS = (np.zeros(8, np.float32) for _ in range(2))
_HERMITE_PLACES[:HERMITE], _HERMITE_WEIGHTS[:HERMITE] = np.polynomial.hermite_e.hermegauss(HERMITE)
_HERMITE_WEIGHTS /= _HERMITE_WEIGHTS.sum()
_HERMITE_BOX = np.float32(0.75)  # half a node's box, in deviations
_WHOLE = np.float32(2.0 * REACH - 0.01)  # extent of a whole footprint, in deviations
_INVERSE_ROOT = np.float32(1.0 / math.sqrt(2.0 * math.pi))
_0, _1, _HALF = np.float32(0.0), np.float32(1.0), np.float32(0.5)
_INVERSE_PI, _INVERSE_TURN = np.float32(1.0 / math.pi), np.float32(0.5 / math.pi)
_VERTICAL = np.float32(0.99999)  # largest sine of v
# The arc sine is steep at 1: a part that ends where its yarn does must end there, however a quotient is rounded.
_OUTWARDS = np.float32(1.000001)
_LEVELS = np.float32(LEVELS)


@kernel
def nodes_for(length: np.float32, most: int) -> int:
    """Return how many Gauss nodes resolve a Gaussian over `length` deviations, at most `most`."""
    if length < 0.8:
        return 2
    if length < 1.6:
        return 3
    if length < 2.5:
        return 4
    return min(5 if length < 3.5 else MOST_ACROSS, most)


@fast_kernel
def sine_cosine(v: np.float32) -> tuple[np.float32, np.float32]:
    """Return sine and cosine of |v| <= pi/2."""
    w = v * v
    series = np.float32(-1 / 5040) + w * np.float32(1 / 362880)
    sine = v * (_1 + w * (np.float32(-1 / 6) + w * (np.float32(1 / 120) + w * series)))
    sine = min(max(sine, -_VERTICAL), _VERTICAL)
    return sine, np.sqrt((_1 - sine) * (_1 + sine))


class Footprint(NamedTuple):
    """A footprint along the axes: its place from the corner of a cell, and its deviations."""

    x: np.float32
    y: np.float32
    dx: np.float32
    dy: np.float32


class CoveredPart(NamedTuple):
    """The part of a piece that a footprint covers, from the corner of the cell."""

    x_low: np.float32
    x_high: np.float32
    y_low: np.float32
    y_high: np.float32


@inlined_fast_kernel
def place_nodes(
    table: SoftNodeTable, scratch: Scratch, p: int, first: int, at: Footprint, part: CoveredPart, kind: int
) -> None:  # fmt: skip
    """Place nodes of a footprint in the part of a piece of yarn that it covers, after those of its kind.

    `p` and `first` are the piece and the first cell of its grid.
    """
    bounds, size, line, offsets = table.bounds[p], table.grid.shape[2], scratch.line, scratch.offsets
    family = table.pieces[p, FAMILY]
    warp, radius, count = family == WARP, table.yarn[family, RADIUS], np.float32(size)
    if warp:
        a_low, a_high, b_low, b_high = part.x_low - _HALF, part.x_high - _HALF, part.y_low, part.y_high
        centre_a, centre_b, deviation_a, deviation_b = at.x - _HALF, at.y, at.dx, at.dy
        low, length = bounds[Y_LOW], bounds[Y_HIGH] - bounds[Y_LOW]
        step_a, step_b = 1, size
    else:
        a_low, a_high, b_low, b_high = part.y_low - _HALF, part.y_high - _HALF, part.x_low, part.x_high
        centre_a, centre_b, deviation_a, deviation_b = at.y - _HALF, at.x, at.dy, at.dx
        low, length = bounds[X_LOW], bounds[X_HIGH] - bounds[X_LOW]
        step_a, step_b = size, 1
    inverse_a, inverse_b, last = _1 / deviation_a, _1 / deviation_b, count - np.float32(0.01)

    # Across: sine and cosine of v, share of the footprint, cell, half a box in v.
    if (a_high - a_low) * inverse_a >= _WHOLE:
        across = HERMITE
        for k in range(HERMITE):
            sv = min(max((centre_a + _HERMITE_PLACES[k] * deviation_a) / radius, -_VERTICAL), _VERTICAL)
            cv = np.sqrt((_1 - sv) * (_1 + sv))
            line[0, k], line[1, k], line[2, k] = sv, cv, _HERMITE_WEIGHTS[k]
            line[3, k] = min(max((arcsine(sv) * _INVERSE_PI + _HALF) * count + UPPER, _0), last)
            line[4, k] = _HERMITE_BOX * deviation_a / (radius * cv)
    else:
        across = nodes_for((a_high - a_low) * inverse_a, table.legendre)
        v_low, v_high = arcsine(a_low / radius * _OUTWARDS), arcsine(a_high / radius * _OUTWARDS)
        half_v, middle_v = _HALF * (v_high - v_low), _HALF * (v_high + v_low)
        area = half_v * radius * inverse_a * _INVERSE_ROOT
        for k in range(8):
            v = middle_v + half_v * GAUSS_PLACES[across, k]
            sv, cv = sine_cosine(v)
            da = (radius * sv - centre_a) * inverse_a
            line[0, k], line[1, k] = sv, cv
            line[2, k] = area * GAUSS_WEIGHTS[across, k] * cv * remaining(_HALF * da * da)
            line[3, k] = min(max((v * _INVERSE_PI + _HALF) * count + UPPER, _0), last)
            line[4, k] = half_v * GAUSS_WEIGHTS[across, k] * _HALF

    # Along: place from the middle of the float, share of the footprint, cell, half a box.
    if (b_high - b_low) * inverse_b >= _WHOLE:
        along = HERMITE
        for k in range(HERMITE):
            place = centre_b + _HERMITE_PLACES[k] * deviation_b
            line[5, k], line[6, k] = place - _HALF + bounds[SHIFT], _HERMITE_WEIGHTS[k]
            line[7, k] = min(max((place - low) / length * count + UPPER, _0), last)
            line[8, k] = _HERMITE_BOX * deviation_b
    else:
        along = nodes_for((b_high - b_low) * inverse_b, table.legendre)
        half_b, middle_b = _HALF * (b_high - b_low), _HALF * (b_high + b_low)
        area = half_b * inverse_b * _INVERSE_ROOT
        for k in range(8):
            place = middle_b + half_b * GAUSS_PLACES[along, k]
            db = (place - centre_b) * inverse_b
            line[5, k] = place - _HALF + bounds[SHIFT]
            line[6, k] = area * GAUSS_WEIGHTS[along, k] * remaining(_HALF * db * db)
            line[7, k] = min(max((place - low) / length * count + UPPER, _0), last)
            line[8, k] = half_b * GAUSS_WEIGHTS[along, k] * _HALF

    # Every pair, a line of nodes at a time.
    for i in range(8):
        offsets[i] = np.uint32(int(line[3, i]) * step_a)
    nodes, k = scratch.nodes[kind], scratch.stops[kind]
    for j in range(along):
        # Along a weft, y of its frame runs against x.
        write_eight(nodes[SIN], k, line[0])
        write_eight(nodes[COS], k, line[1])
        fill_eight(nodes[ALONG], k, line[5, j] if warp else -line[5, j])
        write_eight(nodes[HALF_V], k, line[4])
        fill_eight(nodes[HALF_ALONG], k, line[8, j])
        _write_eight_times(nodes[WEIGHT], k, line[2], line[6, j])
        fill_eight(nodes[TURN], k, bounds[CURVE])
        fill_eight(nodes[LIMIT], k, bounds[BOUND])
        _shift_eight(scratch.cells[kind], k, offsets, np.uint32(first + int(line[7, j]) * step_b))
        k += across
    scratch.stops[kind] = k


# Eight statements in place of a loop: they become one instruction, which a loop over arrays that may overlap does not.
@inlined_fast_kernel
def write_eight(row: Float32, k: int, values: Float32) -> None:
    """Write eight numbers from `k` on."""
    v0, v1, v2, v3 = values[0], values[1], values[2], values[3]
    v4, v5, v6, v7 = values[4], values[5], values[6], values[7]
    own = row[k : k + 8]
    own[0], own[1], own[2], own[3], own[4], own[5], own[6], own[7] = v0, v1, v2, v3, v4, v5, v6, v7


@inlined_fast_kernel
def _write_eight_times(row: Float32, k: int, values: Float32, f: np.float32) -> None:
    """Write eight numbers times a factor from `k` on."""
    v0, v1, v2, v3 = f * values[0], f * values[1], f * values[2], f * values[3]
    v4, v5, v6, v7 = f * values[4], f * values[5], f * values[6], f * values[7]
    own = row[k : k + 8]
    own[0], own[1], own[2], own[3], own[4], own[5], own[6], own[7] = v0, v1, v2, v3, v4, v5, v6, v7


@inlined_fast_kernel
def fill_eight(row: Float32, k: int, value: np.float32) -> None:
    """Write a number eight times from `k` on."""
    own = row[k : k + 8]
    own[0], own[1], own[2], own[3], own[4], own[5], own[6], own[7] = (
        value, value, value, value, value, value, value, value
    )  # fmt: skip


@inlined_fast_kernel
def _shift_eight(row: npt.NDArray[np.uint32], k: int, values: npt.NDArray[np.uint32], shift: np.uint32) -> None:
    """Write eight numbers plus another one from `k` on."""
    v0, v1, v2, v3 = values[0] + shift, values[1] + shift, values[2] + shift, values[3] + shift
    v4, v5, v6, v7 = values[4] + shift, values[5] + shift, values[6] + shift, values[7] + shift
    own = row[k : k + 8]
    own[0], own[1], own[2], own[3], own[4], own[5], own[6], own[7] = v0, v1, v2, v3, v4, v5, v6, v7


@kernel
def fill_block(nodes: Float32, cells: npt.NDArray[np.uint32], start: int) -> int:
    """Fill the last block with nodes that weigh nothing; return the number of nodes."""
    stop = (start + BLOCK_NODES - 1) // BLOCK_NODES * BLOCK_NODES
    for row in range(BLOCK_ROWS):
        own, value = nodes[row], _1 if row == COS else _0
        for k in range(start, stop):
            own[k] = value
    for k in range(start, stop):
        cells[k] = np.uint32(0)
    return stop


@fast_kernel
def gap_area(
    bounds: Float32, first: int, size: int, viewer: GridHorizons, sharpness: np.float32, oz: np.float32,
    at: Footprint, part: CoveredPart, most: int,
) -> np.float32:  # fmt: skip
    """Return the area that the viewer sees through the part of a gap that a footprint covers.

    `bounds`, `first` and `size` are the gap's bounds, the first cell of its grid and its cells along each axis;
    `sharpness` is 1 over the width of the ramp, `oz` the rise of the viewer's direction, `most` the most nodes an axis.
    """
    inverse_x, inverse_y, count = _1 / at.dx, _1 / at.dy, np.float32(size)
    columns, rows = (
        nodes_for((part.x_high - part.x_low) * inverse_x, most),
        nodes_for((part.y_high - part.y_low) * inverse_y, most),
    )
    half_x, half_y = _HALF * (part.x_high - part.x_low), _HALF * (part.y_high - part.y_low)
    middle_x, middle_y = _HALF * (part.x_high + part.x_low), _HALF * (part.y_high + part.y_low)
    per_x = count / (bounds[X_HIGH] - bounds[X_LOW])
    per_y = count / (bounds[Y_HIGH] - bounds[Y_LOW])
    total = _0
    for j in range(rows):
        place_y = middle_y + half_y * GAUSS_PLACES[rows, j]
        dy = (place_y - at.y) * inverse_y
        row = first + size * min(max(int((place_y - bounds[Y_LOW]) * per_y + UPPER), 0), size - 1)
        for i in range(columns):
            place_x = middle_x + half_x * GAUSS_PLACES[columns, i]
            dx = (place_x - at.x) * inverse_x
            cell = row + min(max(int((place_x - bounds[X_LOW]) * per_x + UPPER), 0), size - 1)
            low, high = np.float32(viewer.grid[cell + viewer.low]), np.float32(viewer.grid[cell + viewer.high])
            density = remaining(_HALF * (dx * dx + dy * dy))
            share = GAUSS_WEIGHTS[rows, j] * GAUSS_WEIGHTS[columns, i]
            total += share * density * ramp(above(oz * _LEVELS, low, high, viewer.turn, sharpness / _LEVELS))
    return total * half_x * half_y * inverse_x * inverse_y * _INVERSE_TURN * oz
