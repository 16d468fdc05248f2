"""Refinement of an answer: the nodes that may be most wrong are integrated with exact visibility.

The other nodes keep their share from the table. A refined node is cut along a few rows that cross its border; the
scatter of the rows states the error. Some hundred tests of visibility are then as accurate as thousands of points over
the whole footprint.

A row is cut where a point of the cloth goes out of the viewer's sight or out of the light. `PLACES` evenly spaced
places share a random offset, so that their mean is right on average for any border. Bisection finds the border between
two places that differ; what lies between two that agree is taken to agree, after one test in the middle of the row.
Within a part that is seen or lit as a whole the point model is smooth and needs one place or two.
"""

import math
from typing import Final, NamedTuple

import numpy as np

from pipeline.compiled.arrays import Float32, Float64, Index
from pipeline.compiled.decorators import inlined_kernel, kernel
from pipeline.truth.cloth import AREA_SUM, POINT_SUMS, ClothSide
from pipeline.truth.footprint.sequences import uniform
from pipeline.truth.geometry.heightfield import GAP, surface_at
from pipeline.truth.geometry.visibility import gap_clear, visible
from pipeline.truth.node_table import build
from pipeline.truth.node_table.doubts import Doubts, no_doubts
from pipeline.truth.node_table.kernels import NodeShares
from pipeline.truth.scattering.point import Choices, Directions, lit_from_behind, point_share

UNSEEN: Final = 0.002  # relative error of an answer that neither nodes nor borders show

PLACES: Final = 8  # places of a row: a border is found to an eighth of a node

_SPREAD: Final = 0.5  # variance of the mean of stratified rows over what independent rows of that scatter would have
_HIDDEN, _SEEN, _LIT = 0, 1, 2
_LONG = 2  # more places than this need two points of Gauss's rule
_GAUSS = 1.0 / math.sqrt(3.0)
_SMOOTH = Choices(False, False)
_0 = np.float32(0.0)


class RefineRoom(NamedTuple):
    """Room for the refinement of a query."""

    doubts: Doubts  # possible errors of the nodes
    states: Index  # state of each place of a row: hidden, seen, or seen and lit, (PLACES,)
    parts: Index  # first and last place of parts not yet decided, (2 PLACES, 2)
    value: Float64  # a row's sums, (POINT_SUMS,)
    change: Float64  # change of the sums, (POINT_SUMS,)
    variance: Float64  # squared error of the numerators, (4,)
    first: Float64
    second: Float64
    """Sums over a node's rows, and of the squares of their residuals, (POINT_SUMS,) and (4,)."""


def refine_room(nodes: int) -> RefineRoom:
    """Return room for a table of so many nodes."""
    value, change, first = np.zeros((3, POINT_SUMS))
    variance, second = np.zeros((2, 4))
    states, parts = np.zeros(PLACES, np.int64), np.zeros((2 * PLACES, 2), np.int64)
    return RefineRoom(no_doubts(nodes), states, parts, value, change, variance, first, second)


class Refinement(NamedTuple):
    """A query whose answer is refined; `key` names its random numbers."""

    cloth: ClothSide
    table: build.ExactNodes
    directions: Directions
    key: np.uint64
    shares: NodeShares
    room: RefineRoom


@kernel
def refine(query: Refinement, rows: int, least: float, below: float, mean: Float64, error: Float64) -> int:
    """Replace the shares of nodes that may be wrong by integrals over `rows` rows each; return the places tested.

    Nodes with a score of at least `least` are refined. `mean` and `error` of the four components are the table's and
    are written; `below` is the table's denominator.
    """
    table, shares, room = query.table, query.shares, query.room
    change, variance, left, score = room.change, room.variance, room.doubts.left, room.doubts.score
    change[:] = 0.0
    variance[:] = 0.0
    tested = 0
    for p in range(len(table.pieces)):
        piece = table.pieces[p]
        start, family = piece[build.FIRST_NODE], piece[build.PIECE_FAMILY]
        for k in range(start, start + piece[build.NODES_X] * piece[build.NODES_Y]):
            if score[k] == _0 or score[k] < least:
                continue
            tested += _integrate(query, p, k, rows, mean)
            change[AREA_SUM] -= shares.areas[k]
            if family != GAP:
                change[family] -= np.float64(shares.speculars[k])
                change[2 + family] -= np.float64(shares.diffuses[k]) / math.pi
    total = below if query.cloth.projected else below + change[AREA_SUM]
    for q in range(4):
        mean[q] = max((mean[q] * below + change[q]) / total, 0.0)
        error[q] = math.sqrt(variance[q] + 0.25 * left[0] + left[1 + q] ** 2) / total + UNSEEN * mean[q]
    return tested


@kernel
def _integrate(query: Refinement, p: int, k: int, rows: int, mean: Float64) -> int:
    """Add the integral over node k of piece p to the changes, and its squared error; return the places tested."""
    table, shares, directions, room = query.table, query.shares, query.directions, query.room
    piece, weight = table.pieces[p], shares.weight
    start, across, gap = piece[build.FIRST_NODE], piece[build.NODES_X], piece[build.PIECE_FAMILY] == GAP
    stop = start + across * piece[build.NODES_Y]
    i, j = (k - start) % across, (k - start) // across
    x_edges, y_edges = table.edges[piece[build.EDGES_X]], table.edges[piece[build.EDGES_Y]]
    tilt_x = _tilt(weight, k, 1, x_edges, i, across)
    tilt_y = _tilt(weight, k, across, y_edges, j, piece[build.NODES_Y])
    x, dx = table.copies[p, 0, 0] + np.float64(x_edges[i]), np.float64(x_edges[i + 1]) - np.float64(x_edges[i])
    y, dy = table.copies[p, 0, 1] + np.float64(y_edges[j]), np.float64(y_edges[j + 1]) - np.float64(y_edges[j])

    # Rows lead along the axis that crosses the border.
    right, down = room.doubts.right, room.doubts.down
    along_x = right[k] + (right[k - 1] if i > 0 else _0) >= down[k] + (down[k - across] if j > 0 else _0)
    decided = shares.undecided[k] == _0
    seen = decided and _clear(shares.margins, k, i, across, start, stop)
    lit = decided and not gap and directions.light.z > 0.0 and _clear(shares.lit_margins, k, i, across, start, stop)
    known = Known(seen, lit, not gap and piece[build.FINE_COUNT] > 1)
    first, second, value = room.first, room.second, room.value
    first[:] = 0.0
    second[:] = 0.0
    tested = 0
    for r in range(rows):
        t, offset = (r + uniform(query.key, k, 2 * r)) / rows, uniform(query.key, k, 2 * r + 1)
        if along_x:
            share = weight[k] * max(1.0 + tilt_y * (t - 0.5), 0.0)
            row = Row(x, y + t * dy, dx, 0.0, offset, share, tilt_x)
        else:
            share = weight[k] * max(1.0 + tilt_x * (t - 0.5), 0.0)
            row = Row(x + t * dx, y, 0.0, dy, offset, share, tilt_y)
        tested += add_row(query.cloth, directions, row, known, room)
        for q in range(4):
            second[q] += (value[q] - mean[q] * value[AREA_SUM]) ** 2
        for q in range(POINT_SUMS):
            first[q] += value[q]
    for q in range(4):
        spread = second[q] - (first[q] - mean[q] * first[AREA_SUM]) ** 2 / rows
        room.variance[q] += _SPREAD * max(spread, 0.0) / (rows * (rows - 1.0))
    for q in range(POINT_SUMS):
        room.change[q] += first[q] / rows
    return tested


@kernel
def _clear(margins: Float32, k: int, i: int, across: int, start: int, stop: int) -> bool:
    """Return whether node k, number i of its line, and its neighbours clear the horizon."""
    if margins[k] <= _0:
        return False
    if (i > 0 and margins[k - 1] <= _0) or (i < across - 1 and margins[k + 1] <= _0):
        return False
    if k - across >= start and margins[k - across] <= _0:
        return False
    return bool(k + across >= stop or margins[k + across] > _0)


@kernel
def _tilt(weight: Float32, k: int, step: int, edges: Float32, place: int, count: int) -> float:
    """Return the relative change of the footprint's density across node k, from its neighbours along one axis."""
    if place == 0 or place == count - 1:
        return 0.0
    below = weight[k - step] / (edges[place] - edges[place - 1])
    above = weight[k + step] / (edges[place + 2] - edges[place + 1])
    return float(0.5 * (above - below) * (edges[place + 1] - edges[place]) / weight[k])


class Known(NamedTuple):
    """Knowledge of a node that the table already has."""

    seen: bool
    lit: bool
    """True if the viewer, and the light, clear the horizon all around."""
    every: bool  # true if the point model must be evaluated at every place: a highlight is narrower than the node


class Row(NamedTuple):
    """A row of places through a node."""

    x: float
    y: float
    dx: float
    dy: float
    """Where it starts, in the repeat, and how far it leads."""
    offset: float  # place of the first place within its eighth, 0 <= offset < 1
    weight: float
    tilt: float
    """Share of the footprint, and its relative change from the start to the end."""


@kernel
def add_row(cloth: ClothSide, directions: Directions, row: Row, known: Known, room: RefineRoom) -> int:
    """Write the sums of a row, without the transparency, to `room.value`; return the number of places tested.

    Shadows are on, the cloth is flat, and cosines go to the ply normal.
    """
    tested = _find_states(cloth, directions, row, known, room)
    states, value = room.states, room.value
    value[:] = 0.0
    first = 0
    while first < PLACES:
        stop = first + 1
        while not known.every and stop < PLACES and states[stop] == states[first]:
            stop += 1
        if states[first] != _HIDDEN:
            points = 2 if stop - first > _LONG else 1
            for point in range(points):
                away = (point - 0.5) * _GAUSS * (stop - first) if points == 2 else 0.0
                along = (0.5 * (first + stop - 1) + away + row.offset) / PLACES
                share = row.weight * (stop - first) / (PLACES * points)
                share *= max(1.0 + row.tilt * (along - 0.5), 0.0)
                x, y = row.x + along * row.dx, row.y + along * row.dy
                family, area, specular, diffuse, _ = point_share(cloth.front, cloth.back, x, y, directions, _SMOOTH)
                if family != GAP and states[first] == _LIT:
                    value[family] += share * specular
                    value[2 + family] += share * diffuse
                value[AREA_SUM] += share * (directions.viewer.z if cloth.projected else area)
        first = stop
    return tested


@kernel
def _find_states(cloth: ClothSide, directions: Directions, row: Row, known: Known, room: RefineRoom) -> int:
    """Write the state of each place; return how many were tested."""
    states, parts = room.states, room.parts
    for place in (0, PLACES - 1):
        states[place] = _state(cloth, directions, row, place, known)
    tested, open_parts = 2, 1
    parts[0, 0], parts[0, 1] = 0, PLACES - 1
    while open_parts > 0:
        open_parts -= 1
        low, high = parts[open_parts, 0], parts[open_parts, 1]
        if high - low <= 1:
            continue
        if states[low] == states[high] and high - low < PLACES - 1:
            for place in range(low + 1, high):
                states[place] = states[low]
            continue
        middle = (low + high) // 2
        states[middle] = _state(cloth, directions, row, middle, known)
        tested += 1
        parts[open_parts, 0], parts[open_parts, 1] = low, middle
        parts[open_parts + 1, 0], parts[open_parts + 1, 1] = middle, high
        open_parts += 2
    return tested


@inlined_kernel
def _state(cloth: ClothSide, directions: Directions, row: Row, place: int, known: Known) -> int:
    """Return whether a place is hidden, seen, or seen and lit; a gap that is seen counts as lit."""
    along = (place + row.offset) / PLACES
    x, y = row.x + along * row.dx, row.y + along * row.dy
    front, light, viewer = cloth.front, directions.light, directions.viewer
    family, side, z, nx, ny, nz, _, _, _ = surface_at(front, x, y, int(x), int(y))
    if family == GAP:
        return _LIT if gap_clear(front, cloth.back, x, y, viewer, directions.viewer_behind) else _HIDDEN
    if viewer.x * nx + viewer.y * ny + viewer.z * nz <= 0.0:
        return _HIDDEN
    if not known.seen and not visible(front, x, y, z, side, viewer):
        return _HIDDEN
    cos_i = light.x * nx + light.y * ny + light.z * nz
    if light.z > 0.0:
        return _LIT if cos_i > 0.0 and (known.lit or visible(front, x, y, z, side, light)) else _SEEN
    behind = cos_i < 0.0 and lit_from_behind(cloth.back, x, y, directions.light_behind, cloth.choices)
    return _LIT if behind else _SEEN
