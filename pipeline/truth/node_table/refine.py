"""Refinement of an answer: the nodes that may be most wrong are integrated with exact visibility.

The other nodes keep their share from the table. A refined node is cut along a few rows that cross its border (cut); the
scatter of the rows states the error. Some hundred tests of visibility are then as accurate as thousands of points over
the whole footprint.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np

from pipeline.compiled.arrays import Float32, Float64
from pipeline.compiled.decorators import kernel
from pipeline.truth.cloth import AREA_SUM, POINT_SUMS, ClothSide
from pipeline.truth.footprint.sequences import uniform
from pipeline.truth.geometry.heightfield import GAP
from pipeline.truth.node_table.build import (
    EDGES_X,
    EDGES_Y,
    FINE_COUNT,
    FIRST_NODE,
    NODES_X,
    NODES_Y,
    PIECE_FAMILY,
    ExactNodes,
)
from pipeline.truth.node_table.cut import Known, Row, RowRoom, add_row, row_room
from pipeline.truth.node_table.doubts import Doubts, no_doubts
from pipeline.truth.node_table.kernels import NodeShares
from pipeline.truth.scattering.point import Directions

UNSEEN: Final = 0.002
"""Relative error of an answer that neither nodes nor borders show."""

_SPREAD: Final = 0.5
"""Variance of the mean of stratified rows over what independent rows of that scatter would have."""

_0 = np.float32(0.0)


class RefineRoom(NamedTuple):
    """Room for the refinement of a query."""

    doubts: Doubts
    """Possible errors of the nodes."""
    row: RowRoom
    """Room for a row."""
    change: Float64
    """Change of the sums, (POINT_SUMS,)."""
    variance: Float64
    """Squared error of the numerators, (4,)."""
    first: Float64
    second: Float64
    """Sums over a node's rows, and of the squares of their residuals, (POINT_SUMS,) and (4,)."""


def refine_room(nodes: int) -> RefineRoom:
    """Return room for a table of so many nodes."""
    sums, squares = np.zeros((2, POINT_SUMS)), np.zeros((2, 4))
    return RefineRoom(no_doubts(nodes), row_room(), sums[0], squares[0], sums[1], squares[1])


@kernel
def refine(
    cloth: ClothSide,
    table: ExactNodes,
    directions: Directions,
    key: np.uint64,
    rows: int,
    shares: NodeShares,
    least: float,
    below: float,
    room: RefineRoom,
    mean: Float64,
    error: Float64,
) -> int:
    """Replace the shares of nodes that may be wrong by integrals over `rows` rows each; return the places tested.

    Nodes with a score of at least `least` are refined. `mean` and `error` of the four components are the table's and
    are written; `below` is the table's denominator.
    """
    change, variance, left, score = room.change, room.variance, room.doubts.left, room.doubts.score
    change[:] = 0.0
    variance[:] = 0.0
    tested = 0
    for p in range(len(table.pieces)):
        start, family = table.pieces[p, FIRST_NODE], table.pieces[p, PIECE_FAMILY]
        for k in range(start, start + table.pieces[p, NODES_X] * table.pieces[p, NODES_Y]):
            if score[k] == _0 or score[k] < least:
                continue
            tested += _integrate(cloth, table, p, k, directions, key, rows, shares, mean, room)
            change[AREA_SUM] -= shares.areas[k]
            if family != GAP:
                change[family] -= np.float64(shares.speculars[k])
                change[2 + family] -= np.float64(shares.diffuses[k]) / math.pi
    total = below if cloth.projected else below + change[AREA_SUM]
    for q in range(4):
        mean[q] = max((mean[q] * below + change[q]) / total, 0.0)
        error[q] = math.sqrt(variance[q] + 0.25 * left[0] + left[1 + q] ** 2) / total + UNSEEN * mean[q]
    return tested


@kernel
def _integrate(
    cloth: ClothSide,
    table: ExactNodes,
    p: int,
    k: int,
    directions: Directions,
    key: np.uint64,
    rows: int,
    shares: NodeShares,
    mean: Float64,
    room: RefineRoom,
) -> int:
    """Add the integral over node k of piece p to the changes, and its squared error; return the places tested."""
    piece, weight = table.pieces[p], shares.weight
    start, across, gap = piece[FIRST_NODE], piece[NODES_X], piece[PIECE_FAMILY] == GAP
    stop = start + across * piece[NODES_Y]
    i, j = (k - start) % across, (k - start) // across
    x_edges, y_edges = table.edges[piece[EDGES_X]], table.edges[piece[EDGES_Y]]
    tilt_x = _tilt(weight, k, 1, x_edges, i, across)
    tilt_y = _tilt(weight, k, across, y_edges, j, piece[NODES_Y])
    x, dx = table.copies[p, 0, 0] + np.float64(x_edges[i]), np.float64(x_edges[i + 1]) - np.float64(x_edges[i])
    y, dy = table.copies[p, 0, 1] + np.float64(y_edges[j]), np.float64(y_edges[j + 1]) - np.float64(y_edges[j])

    # Rows lead along the axis that crosses the border.
    right, down = room.doubts.right, room.doubts.down
    along_x = right[k] + (right[k - 1] if i > 0 else _0) >= down[k] + (down[k - across] if j > 0 else _0)
    decided = shares.undecided[k] == _0
    seen = decided and _clear(shares.margins, k, i, across, start, stop)
    lit = decided and not gap and directions.light.z > 0.0 and _clear(shares.lit_margins, k, i, across, start, stop)
    known = Known(seen, lit, not gap and piece[FINE_COUNT] > 1)
    first, second, value = room.first, room.second, room.row.value
    first[:] = 0.0
    second[:] = 0.0
    tested = 0
    for r in range(rows):
        t, offset = (r + uniform(key, k, 2 * r)) / rows, uniform(key, k, 2 * r + 1)
        if along_x:
            share = weight[k] * max(1.0 + tilt_y * (t - 0.5), 0.0)
            row = Row(x, y + t * dy, dx, 0.0, offset, share, tilt_x)
        else:
            share = weight[k] * max(1.0 + tilt_x * (t - 0.5), 0.0)
            row = Row(x + t * dx, y, 0.0, dy, offset, share, tilt_y)
        tested += add_row(cloth, directions, row, known, room.row)
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
