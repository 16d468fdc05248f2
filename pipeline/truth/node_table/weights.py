"""Weights: the share of a footprint that falls on each node of a table.

A footprint along the axes is a product of masses along x and y on intervals of the repeat, folded by periodicity; their
kernel, centre and repeat are those of `place`, whose points have these masses as their histogram.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from pipeline.compiled.arrays import Float32, Mask
from pipeline.compiled.decorators import fast_kernel, kernel
from pipeline.compiled.normal import normal_distribution
from pipeline.truth.cloth import WideQueries
from pipeline.truth.footprint.mixture import Line, along_axes, line_points
from pipeline.truth.footprint.place import BOX, BOX_SIDE, GAUSSIAN, Axis, folded_box
from pipeline.truth.geometry.march import wrap
from pipeline.truth.node_table.build import EDGES_X, EDGES_Y, FIRST_NODE, NODES_X, NODES_Y, ExactNodes

_0, _1 = np.float32(0.0), np.float32(1.0)


_SPREAD_OUT = 0.8  # in repeats: an axis of a Gaussian this wide covers the repeat evenly, to 6e-6
_REACH = 5.5  # in standard deviations; what lies beyond is 4e-8


class WeightRoom(NamedTuple):
    """Room for the weights of one query."""

    masses: Float32  # shares of the intervals along x and along y, by cell and kind of edges, (2, cells, kinds, n)
    touched: Mask  # true where any of them may be above 0, (2, cells, kinds)
    points: Float32  # places and shares of the points of a mixture, (2, P)


def weight_room(table: ExactNodes, line: Line) -> WeightRoom:
    """Return room for footprints over a table, rotated ones by a `line`."""
    size = 2, int(table.repeat.max()), len(table.edges)
    masses = np.zeros((*size, table.edges.shape[1] - 1), np.float32)
    return WeightRoom(masses, np.zeros(size, np.bool_), np.zeros((2, line.points), np.float32))


@kernel
def interval_masses(axis: Axis, edges: Float32, cell: float, masses: Float32) -> bool:
    """Write the mass of each interval between neighbouring edges; return whether any may be above 0.

    `edges` (n + 1,) are rising positions, in [0, 1], in the cell that starts at `cell`; over a whole repeat the masses
    (n,) sum to 1.
    """
    shape, centre, sigma, repeat = axis
    count = len(masses)
    if shape == GAUSSIAN and sigma >= _SPREAD_OUT * repeat:
        even = np.float32(1.0 / repeat)
        for k in range(count):
            masses[k] = (edges[k + 1] - edges[k]) * even
        return True
    side = BOX_SIDE * sigma
    whole, even, reach = 0.0, np.float32(0.0), _REACH * sigma
    if shape == BOX:
        whole, reach, centre = folded_box(axis)
        even = np.float32(whole / side)
    for k in range(count):
        masses[k] = even * (edges[k + 1] - edges[k])
    first = math.ceil((cell - centre - reach) / repeat)
    last = math.floor((cell + 1.0 - centre + reach) / repeat)
    for image in range(first, last + 1):
        middle = np.float32(centre + image * repeat - cell)
        if shape == GAUSSIAN:
            _add_gaussian(edges, middle, np.float32(1.0 / sigma), masses)
        else:
            _add_box(edges, middle, np.float32(reach), np.float32(1.0 / side), masses)
    return last >= first or whole > 0.0


@fast_kernel
def _add_gaussian(edges: Float32, middle: np.float32, inverse: np.float32, masses: Float32) -> None:
    for k in range(len(masses)):
        below = normal_distribution((edges[k] - middle) * inverse)
        masses[k] += normal_distribution((edges[k + 1] - middle) * inverse) - below


@fast_kernel
def _add_box(edges: Float32, middle: np.float32, reach: np.float32, inverse: np.float32, masses: Float32) -> None:
    for k in range(len(masses)):
        low = min(max(edges[k] - middle, -reach), reach)
        high = min(max(edges[k + 1] - middle, -reach), reach)
        masses[k] += (high - low) * inverse


@kernel
def fill_weights(
    table: ExactNodes, shape: int, columns: WideQueries, row: int, line: Line, room: WeightRoom, weight: Float32
) -> None:
    """Write the share of a footprint that falls on each node and its copies; a rotated one by a `line` (mixture)."""
    weight[:] = _0
    ends, picks = float(table.repeat[0]), float(table.repeat[1])
    u, v, sigma_x, sigma_y = columns.u[row], columns.v[row], columns.sigma[row], columns.sigma_minor[row]
    if columns.angle[row] == 0.0:
        _add(table, Axis(shape, u, sigma_x, ends), Axis(shape, v, sigma_y, picks), _1, room, weight)
        return
    sigma_x, sigma_y, correlation = along_axes(sigma_x, sigma_y, columns.angle[row])
    blur, shift = math.sqrt(1.0 - abs(correlation)), math.sqrt(abs(correlation))
    shift_x, shift_y = shift * sigma_x, math.copysign(shift, correlation) * sigma_y
    places, shares = room.points[0], room.points[1]
    for point in range(line_points(correlation, line, places, shares)):
        x_axis = Axis(shape, u + places[point] * shift_x, blur * sigma_x, ends)
        y_axis = Axis(shape, v + places[point] * shift_y, blur * sigma_y, picks)
        _add(table, x_axis, y_axis, shares[point], room, weight)


@kernel
def _add(table: ExactNodes, x_axis: Axis, y_axis: Axis, share: np.float32, room: WeightRoom, weight: Float32) -> None:
    """Add `share` of a footprint along the axes."""
    kinds, masses, touched = len(table.edges), room.masses, room.touched
    for axis in range(2):
        shape, centre, sigma, repeat = x_axis if axis == 0 else y_axis
        own = Axis(shape, wrap(centre, repeat), sigma, repeat)
        for cell in range(table.repeat[axis]):
            for kind in range(kinds):
                touched[axis, cell, kind] = interval_masses(
                    own, table.edges[kind], float(cell), masses[axis, cell, kind]
                )
    for p in range(len(table.pieces)):
        piece = table.pieces[p]
        start, across, lines = piece[FIRST_NODE], piece[NODES_X], piece[NODES_Y]
        for c in range(table.copies.shape[1]):
            end, pick = table.copies[p, c, 0], table.copies[p, c, 1]
            if touched[0, end, piece[EDGES_X]] and touched[1, pick, piece[EDGES_Y]]:
                along_x, along_y = masses[0, end, piece[EDGES_X]], masses[1, pick, piece[EDGES_Y]]
                _add_product(along_x[:across], along_y[:lines], share, weight[start : start + across * lines])


@fast_kernel
def _add_product(along_x: Float32, along_y: Float32, share: np.float32, weight: Float32) -> None:
    """Add `share` of the products of the shares along x and along y to the nodes of a grid."""
    across = len(along_x)
    for j in range(len(along_y)):
        if along_y[j] > _0:
            line, factor = weight[j * across : (j + 1) * across], share * along_y[j]
            for i in range(across):
                line[i] += factor * along_x[i]


@fast_kernel
def any_weight(share: Float32) -> bool:
    """Return whether any of the shares is above 0."""
    total = _0
    for k in range(len(share)):
        total += share[k]
    return bool(total > _0)
