"""Nodes that a thin ellipse places itself: on lines along its longer axis, whatever the angle of the yarns.

Each line is cut where it crosses the border of a piece, and Gauss's rule is used between two cuts. Across the lines the
trapezoidal rule converges faster than any power for a Gaussian. Each node stands for a box along both axes. Weights are
shares of the footprint, up to what is cut off.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from pipeline.analytic.soft_horizons import AZIMUTHS, above, ramp, sharpness_of_points
from pipeline.analytic.soft_nodes.nodes import (
    BLOCK,
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
from pipeline.analytic.soft_nodes.shade import ALONG, COS, HALF_ALONG, HALF_V, LIMIT, SIN, TURN, WEIGHT, GridHorizons
from pipeline.compiled.arrays import Float32, Index
from pipeline.compiled.decorators import inlined_kernel, kernel
from pipeline.compiled.float32 import arcsine, remaining
from pipeline.truth.geometry.heightfield import GAP, RADIUS, WARP, WEFT

MOST: Final = 1024
"""Most nodes of an ellipse."""

_BETWEEN: Final = 0.2  # yarn spacings: distance of the lines
_ALONG_YARNS: Final = 0.35  # sine of the angle to the yarns below which lines meet borders along themselves,
_CLOSER: Final = 0.14  # and have this distance
_COARSEST: Final = 1.2  # the same in deviations
_CUT: Final = 2.4  # where the footprint ends, in deviations
_SLIGHT: Final = 0.06  # yarn spacings: deviation for which three lines are enough
_APART: Final = 1.6  # their distance, in deviations
_CUTS: Final = 6  # most cuts of a line along a yarn spacing
_LENGTH: Final = 0.12  # yarn spacings between cuts for each node beyond the first
_MOST_BETWEEN: Final = 6  # most nodes between cuts
_NEAREST: Final = 1e-5  # least length between cuts
_PLACES, _WEIGHTS = np.zeros((_MOST_BETWEEN + 1, 8)), np.zeros((_MOST_BETWEEN + 1, 8))
for _n in range(1, _MOST_BETWEEN + 1):
    _PLACES[_n, :_n], _WEIGHTS[_n, :_n] = np.polynomial.legendre.leggauss(_n)
_0, _1, _HALF = np.float32(0.0), np.float32(1.0), np.float32(0.5)
_LEVELS = np.float32(LEVELS)
_INVERSE_PI = np.float32(1.0 / math.pi)
_VERTICAL = np.float32(0.99999)  # largest sine of v


class Ellipse(NamedTuple):
    """A footprint by its own axes.

    Attributes
    ----------
    cosine, sine : float
        Of the angle of the longer axis to x.
    major, minor : float
        Deviations.
    apart : float
        Distance of the lines.
    lines : int
        Lines on either side of the middle one.
    """

    cosine: float
    sine: float
    major: float
    minor: float
    apart: float
    lines: int


@kernel
def ellipse(deviation_x: float, deviation_y: float, correlation: float) -> Ellipse:
    """Return a footprint of deviations along x and y, and their correlation, by its own axes."""
    xx, yy, xy = deviation_x * deviation_x, deviation_y * deviation_y, correlation * deviation_x * deviation_y
    spread = math.sqrt((0.5 * (xx - yy)) ** 2 + xy * xy)
    long = 0.5 * (xx + yy) + spread
    major, minor = math.sqrt(long), math.sqrt(max(xx * yy - xy * xy, 0.0) / long)
    angle = 0.5 * math.atan2(2.0 * xy, xx - yy)
    lines, apart = 1, _APART * minor
    if minor > _SLIGHT:
        distance = _CLOSER if min(abs(math.cos(angle)), abs(math.sin(angle))) < _ALONG_YARNS else _BETWEEN
        lines = math.ceil(_CUT * minor / min(distance, _COARSEST * minor))
        apart = _CUT * minor / lines
    return Ellipse(math.cos(angle), math.sin(angle), major, minor, apart, lines)


@kernel
def most_nodes(shape: Ellipse) -> int:
    """Return a bound of the number of nodes of an ellipse."""
    # Each part between two cuts has one node and one more for each length.
    return (2 * shape.lines + 1) * (math.ceil(2.0 * _CUT * shape.major * (_CUTS + 1.0 / _LENGTH)) + 2)


@kernel
def sharpness_of(shape: Ellipse) -> np.float32:
    """Return 1 over the width of the ramp at the nodes of an ellipse."""
    return sharpness_of_points(np.float32(min(shape.major, _BETWEEN)))


@kernel
def next_cut(place: float, forward: bool, radius: float) -> float:
    """Return the next border of a piece along an axis, of cells and of yarns of a radius."""
    cell = math.floor(place + _NEAREST) if forward else math.ceil(place - _NEAREST) - 1
    inside = place - cell
    low, high = 0.5 - radius, 0.5 + radius
    if forward:
        if inside < low - _NEAREST:
            return cell + low
        return cell + high if inside < high - _NEAREST and radius < 0.5 else cell + 1.0
    if inside > high + _NEAREST:
        return cell + high
    return cell + low if inside > low + _NEAREST and radius < 0.5 else float(cell)


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


@kernel
def _write_node(
    nodes: Float32,
    k: int,
    piece: Float32,
    family: int,
    radius: np.float32,
    x: np.float32,
    y: np.float32,
    box_x: np.float32,
    box_y: np.float32,
    weight: np.float32,
) -> None:
    """Write a node at a place within a cell; `box_x`, `box_y` are half the extent that it stands for."""
    side, place, half_side, half_place = x, y - _HALF + piece[SHIFT], box_x, box_y
    if family == WEFT:
        # Along a weft, y of its frame runs against x.
        side, place, half_side, half_place = y, -(x - _HALF + piece[SHIFT]), box_y, box_x
    sine = min(max((side - _HALF) / radius, -_VERTICAL), _VERTICAL)
    cosine = np.sqrt((_1 - sine) * (_1 + sine))
    nodes[SIN, k], nodes[COS, k], nodes[ALONG, k] = sine, cosine, place
    nodes[HALF_V, k], nodes[HALF_ALONG, k] = min(half_side / (radius * cosine), _HALF), half_place
    nodes[WEIGHT, k], nodes[TURN, k], nodes[LIMIT, k] = weight, piece[CURVE], piece[BOUND]


@kernel
def place_ellipse(
    table: SoftNodeTable,
    shape: Ellipse,
    x: float,
    y: float,
    viewer: GridHorizons,
    oz: np.float32,
    nodes: Float32,
    cells: npt.NDArray[np.uint32],
    stops: Index,
) -> np.float32:
    """Place the nodes of an ellipse around (x, y) within the repeat; return the area seen through gaps.

    `oz` is the rise of the viewer's direction. Writes `nodes` (K, ROWS, most) and `cells` (K, most) by kinds of yarn,
    and in `stops` (K,) how many each kind has.
    """
    ends, picks, size = table.repeat[0], table.repeat[1], table.grid.shape[2]
    of_warp, of_weft, per_grid = table.kinds[0], table.kinds[1], AZIMUTHS * size * size
    whole, reach, gaps = shape.apart / (2.0 * math.pi * shape.major * shape.minor), _CUT * shape.major, _0
    level, sharp = oz * _LEVELS, sharpness_of(shape) / _LEVELS
    dx, dy = shape.cosine, shape.sine
    warp_radius, weft_radius = float(table.yarn[WARP, RADIUS]), float(table.yarn[WEFT, RADIUS])
    for j in range(-shape.lines, shape.lines + 1):
        b = j * shape.apart
        of_line = whole * math.exp(-0.5 * (b / shape.minor) ** 2)
        x0, y0, t = x - b * dy, y + b * dx, -reach
        while t < reach:
            # The next cut along either axis.
            after = reach
            if abs(dx) > _NEAREST:
                cut = next_cut(x0 + t * dx, dx > 0.0, warp_radius)
                after = min(after, max((cut - x0) / dx, t + _NEAREST))
            if abs(dy) > _NEAREST:
                cut = next_cut(y0 + t * dy, dy > 0.0, weft_radius)
                after = min(after, max((cut - y0) / dy, t + _NEAREST))
            half, middle = 0.5 * (after - t), 0.5 * (after + t)
            t = after
            column, row = math.floor(x0 + middle * dx), math.floor(y0 + middle * dy)
            cell = (row % picks) * ends + column % ends
            p = piece_at(
                table.piece_starts,
                table.bounds,
                cell,
                np.float32(x0 + middle * dx - column),
                np.float32(y0 + middle * dy - row),
            )
            if p < 0 or half < _NEAREST:
                continue
            family, first, box = table.pieces[p, FAMILY], table.pieces[p, BLOCK] * per_grid, table.bounds[p]
            radius = table.yarn[family, RADIUS] if family != GAP else _1
            kind = column % of_warp if family == WARP else of_warp + row % of_weft
            # Widths of yarns are round numbers, and so may be the quotient: it must not fall below.
            rule = min(1 + int((2.0 * half + _NEAREST) / _LENGTH), _MOST_BETWEEN)
            for i in range(rule):
                length, at = half * _WEIGHTS[rule, i], middle + half * _PLACES[rule, i]
                in_x, in_y = np.float32(x0 + at * dx - column), np.float32(y0 + at * dy - row)
                weight = np.float32(of_line * length) * remaining(np.float32(0.5 * (at / shape.major) ** 2))
                place = first + in_grid(box, family, radius, in_x, in_y, size)
                if family == GAP:
                    low, high = viewer.grid[place + viewer.low], viewer.grid[place + viewer.high]
                    gaps += weight * oz * ramp(above(level, np.float32(low), np.float32(high), viewer.turn, sharp))
                    continue
                k = stops[kind]
                box_x = np.float32(0.5 * (length * abs(dx) + shape.apart * abs(dy)))
                box_y = np.float32(0.5 * (length * abs(dy) + shape.apart * abs(dx)))
                _write_node(nodes[kind], k, box, family, radius, in_x, in_y, box_x, box_y, weight)
                cells[kind, k] = place
                stops[kind] = k + 1
    return gaps
