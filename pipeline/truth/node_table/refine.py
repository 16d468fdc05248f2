"""Refinement of an answer: nodes that a border of a shadow crosses, or may cross, are sampled with exact visibility.

All other nodes keep their share from the table. A few hundred points are then as accurate as thousands over the whole
footprint.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from pipeline.compiled.arrays import Float32, Float64
from pipeline.compiled.decorators import allocating_kernel, kernel
from pipeline.truth.cloth import AREA, SUMS, ClothSide
from pipeline.truth.footprint.sequences import uniform
from pipeline.truth.geometry.heightfield import GAP
from pipeline.truth.monte_carlo import add_point
from pipeline.truth.node_table.build import COLUMNS, FAMILY, KIND_X, KIND_Y, ROWS, START, Table
from pipeline.truth.node_table.kernels import SMOOTH
from pipeline.truth.node_table.shares import NodeShares
from pipeline.truth.scattering.point import Directions

UNSEEN: Final = 0.002
"""Relative error of an answer that neither nodes nor borders show."""

_NEGLIGIBLE: Final = 1e-5


@allocating_kernel
def refine(
    cloth: ClothSide,
    table: Table,
    directions: Directions,
    key: np.uint64,
    side: int,
    shares: NodeShares,
    below: float,
    mean: Float64,
    error: Float64,
) -> int:
    """Replace the shares of the nodes on borders by samples with exact visibility; return the number of points.

    Each such node gets `side` by `side` jittered points. `mean` and `error` of the four components are the table's and
    are written; `below` is the table's denominator.
    """
    subsamples = side * side
    change, variance = np.zeros(SUMS), np.zeros(4)
    value, first, second = np.zeros((1, SUMS)), np.zeros(SUMS), np.zeros(4)
    points = 0
    weight, margins, lit_margins = shares.weight, shares.margins, shares.lit_margins
    for p in range(len(table.pieces)):
        piece = table.pieces[p]
        start, across, family = piece[START], piece[COLUMNS], piece[FAMILY]
        stop = start + across * piece[ROWS]
        gap = family == GAP
        end, pick = table.copies[p, 0, 0], table.copies[p, 0, 1]
        x_edges, y_edges = table.edges[piece[KIND_X]], table.edges[piece[KIND_Y]]
        for k in range(start, stop):
            a, c = np.float64(shares.areas[k]), np.float64(0.0 if gap else shares.diffuses[k]) / math.pi
            s, share = np.float64(shares.speculars[k]), np.float64(weight[k])
            if share <= 0.0:
                continue
            border = _on_border(margins, k, across, start, stop) or _on_border(lit_margins, k, across, start, stop)
            if not border and shares.undecided[k] == 0.0:
                if gap:
                    continue
                # Error from curvature within the node.
                for kind, part in ((0, s), (2, c)):
                    residual = part - mean[kind + family] * a
                    variance[kind + family] += residual * residual * SMOOTH
                continue
            if share < _NEGLIGIBLE * below:
                continue
            i, j = (k - start) % across, (k - start) // across
            tilt_x = _tilt(weight, k, 1, x_edges, i, across)
            tilt_y = _tilt(weight, k, across, y_edges, j, piece[ROWS])
            first[:], second[:] = 0.0, 0.0
            for sub in range(subsamples):
                u = (sub % side + uniform(key, k, 2 * sub)) / side
                v = (sub // side + uniform(key, k, 2 * sub + 1)) / side
                x = end + x_edges[i] + u * (x_edges[i + 1] - x_edges[i])
                y = pick + y_edges[j] + v * (y_edges[j + 1] - y_edges[j])
                value[:] = 0.0
                tilted = share * max(1.0 + tilt_x * (u - 0.5) + tilt_y * (v - 0.5), 0.0)
                add_point(cloth, x, y, tilted, directions, value, 0)
                for q in range(4):
                    residual = value[0, q] - mean[q] * value[0, AREA]
                    second[q] += residual * residual
                for q in range(SUMS):
                    first[q] += value[0, q]
            points += subsamples
            for q in range(4):
                residual = first[q] - mean[q] * first[AREA]
                spread = second[q] - residual * residual / subsamples
                variance[q] += max(spread, 0.0) / (subsamples * (subsamples - 1.0))
                change[q] += first[q] / subsamples
            change[AREA] += first[AREA] / subsamples - a
            if not gap:
                change[family] -= s
                change[2 + family] -= c
    total = below if cloth.projected else below + change[AREA]
    for q in range(4):
        mean[q] = max((mean[q] * below + change[q]) / total, 0.0)
        error[q] = math.sqrt(variance[q]) / total + UNSEEN * mean[q]
    return points


@kernel
def _on_border(margins: Float32, k: int, columns: int, first: int, last: int) -> bool:
    """Return whether a neighbour of node k is on the other side of a border."""
    here = margins[k] > 0.0
    column = (k - first) % columns
    if column > 0 and (margins[k - 1] > 0.0) != here:
        return True
    if column < columns - 1 and (margins[k + 1] > 0.0) != here:
        return True
    if k - columns >= first and (margins[k - columns] > 0.0) != here:
        return True
    return k + columns < last and (margins[k + columns] > 0.0) != here


@kernel
def _tilt(weight: Float32, k: int, step: int, edges: Float32, place: int, count: int) -> float:
    """Return the relative change of the footprint's density across node k, from its neighbours along one axis."""
    if place == 0 or place == count - 1:
        return 0.0
    below = weight[k - step] / (edges[place] - edges[place - 1])
    above = weight[k + step] / (edges[place + 2] - edges[place + 1])
    return float(0.5 * (above - below) * (edges[place + 1] - edges[place]) / weight[k])
