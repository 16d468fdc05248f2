"""Weights: the share of a footprint that falls on each node of a table.

A footprint along the axes is a product of masses along x and y on intervals of the repeat, folded by periodicity; their
kernel, centre and repeat are those of `place`, whose points have these masses as their histogram.

Footprints of view rays have their density where the viewer sees each node, displaced by its height.
A node at p with height h is seen where its view ray crosses the reference plane of height z_0, at

    q = p - (h - z_0) wo_xy / wo_z,

and the rays around it have the area A(wo) dp = wo_z dq. So its weight is the area of the node times the density of the
footprint at q. The density is folded by the translations that map the cloth onto itself and tabulated on a grid over
the cells that differ, once for a query; nodes read it between the points of the grid. That widens it by the variance
step^2 / 6 along each axis, by which the footprint is made narrower before.
"""

import math
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from pipeline.compiled.arrays import Float32, Mask
from pipeline.compiled.decorators import fast_kernel, kernel
from pipeline.compiled.normal import normal_distribution
from pipeline.truth.cloth import WideQueries
from pipeline.truth.footprint.mixture import Line, along_axes, line_points
from pipeline.truth.footprint.place import BOX, BOX_SIDE, GAUSSIAN, Axis, folded_box
from pipeline.truth.geometry.march import wrap
from pipeline.truth.node_table.build import EDGES_X, EDGES_Y, FIRST_NODE, NODES_X, NODES_Y, ExactNodes

MOST_POINTS: Final = 32  # most points of the grid on a yarn spacing

_SPREAD_OUT = 0.8  # in repeats or periods: an axis of a Gaussian this wide covers them evenly, to 6e-6
_REACH = 5.5  # in standard deviations; what lies beyond is 4e-8
_POINTS = 3.0  # of the grid on a deviation of the footprint: the mean error of reading between them is 3e-4 of the peak
_FAR = np.float32(256.0)  # periods: no view ray within 89 degrees of the normal is displaced as far
_0, _1 = np.float32(0.0), np.float32(1.0)
_NEXT = np.uint32(1)

Squares = npt.NDArray[np.uint32]  # numbers of squares of the grid, (N,)

GridSize = tuple[np.float32, np.float32, np.float32, np.float32, np.float32, np.float32, np.int32]
"""Points of the grid on a yarn spacing; in points the lattice's length, height and shift; 1 over the first two of
these; points of a row."""


class WeightRoom(NamedTuple):
    """Room for the weights of one query."""

    points: Float32  # places and shares of the points of a mixture, (2, P)
    masses: Float32  # shares of the intervals along x and along y, by cell and kind of edges, (2, cells, kinds, n)
    touched: Mask  # true where any of them may be above 0, (2, cells, kinds)
    grid: Float32  # density at the points of the grid, row by row, (G,)
    along_x: Float32
    along_y: Float32
    """Density along both axes, the first over two periods."""
    squares: Squares  # square of the grid in which each node is seen, uint32 (N,)
    part_x: Float32
    part_y: Float32
    """Where in it, 0 to 1, (N,)."""


def weight_room(table: ExactNodes, line: Line) -> WeightRoom:
    """Return room for footprints over a table, rotated ones by a `line`."""
    kinds = 2, int(table.repeat.max()), len(table.edges)
    masses = np.zeros((*kinds, table.edges.shape[1] - 1), np.float32)
    period, rows, _ = table.lattice
    sizes = (
        (period * MOST_POINTS + 1) * (rows * MOST_POINTS + 1),
        2 * period * MOST_POINTS + 1,
        table.repeat[1] * MOST_POINTS + 1,
    )
    grid, along_x, along_y = (np.zeros(int(size), np.float32) for size in sizes)
    nodes = max(len(table.evenly), len(table.walls.height))
    points, parts = np.zeros((2, line.points), np.float32), np.zeros((2, nodes), np.float32)
    squares = np.zeros(nodes, np.uint32)
    return WeightRoom(points, masses, np.zeros(kinds, np.bool_), grid, along_x, along_y, squares, parts[0], parts[1])


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


@kernel
def fill_displaced(
    table: ExactNodes, plane: float, columns: WideQueries, row: int, line: Line, room: WeightRoom, weight: Float32
) -> int:
    """Write the share of a Gaussian footprint of rays that falls on each node and its copies; rotated ones by a `line`.

    `plane` is the height of the reference plane. The folded density, of mean 1, is left in the grid; returned are its
    points on a yarn spacing.
    """
    period, rows, slip = table.lattice
    picks = int(table.repeat[1])
    major, minor = columns.sigma[row], columns.sigma_minor[row]
    points = int(min(max(math.ceil(_POINTS / min(major, minor)), 2), MOST_POINTS))
    widened = 1.0 / (6.0 * points * points)
    # At least half of the variance is left, whatever the footprint.
    major = math.sqrt(max(major * major - widened, 0.5 * major * major))
    minor = math.sqrt(max(minor * minor - widened, 0.5 * minor * minor))
    sigma_x, sigma_y, correlation = major, minor, 0.0
    if columns.angle[row] != 0.0:
        sigma_x, sigma_y, correlation = along_axes(major, minor, columns.angle[row])
    blur, shift = math.sqrt(1.0 - abs(correlation)), math.sqrt(abs(correlation))
    shift_x, shift_y = shift * sigma_x, math.copysign(shift, correlation) * sigma_y
    width, height = period * points, rows * points
    grid = room.grid[: (width + 1) * (height + 1)]
    grid[:] = _0
    along_x, along_y = room.along_x[: 2 * width + 1], room.along_y[: picks * points + 1]
    places, shares = room.points[0], room.points[1]
    for point in range(line_points(correlation, line, places, shares)):
        x, y = columns.u[row] + places[point] * shift_x, columns.v[row] + places[point] * shift_y
        _folded(x, blur * sigma_x, period, points, shares[point] * np.float64(period * rows), along_x)
        _folded(y, blur * sigma_y, picks, points, 1.0, along_y)
        for n in range(picks // rows):
            # A point n rows further up stands for itself `slip` further along.
            own_x = along_x[(n * slip * points) % width :]
            _add_product(own_x[: width + 1], along_y[n * height : (n + 1) * height + 1], _1, grid)
    wo = columns.wo[row]
    read_density(table.lattice, points, plane, wo[0] / wo[2], wo[1] / wo[2], room, table.places, table.evenly, weight)
    return points


@kernel
def _folded(centre: float, sigma: float, period: int, points: int, scale: float, density: Float32) -> None:
    """Write `scale` times a Gaussian folded by a period, at even places from 0 on, so many on a yarn spacing."""
    whole = period * points
    if sigma >= _SPREAD_OUT * period:
        density[:] = np.float32(scale / period)
        return
    density[:] = _0
    reach = _REACH * sigma
    factor, inverse = scale / (math.sqrt(2.0 * math.pi) * sigma), 1.0 / (points * sigma)
    first, last = math.ceil((centre - reach) * points), math.floor((centre + reach) * points)
    for k in range(first, last + 1):
        z = (k - centre * points) * inverse
        density[k % whole] += np.float32(factor * math.exp(-0.5 * z * z))
    for k in range(whole, len(density)):
        density[k] = density[k - whole]


@kernel
def read_density(
    lattice: tuple[int, int, int], points: int, plane: float, shift_x: float, shift_y: float, room: WeightRoom,
    places: Float32, evenly: Float32, weight: Float32,
) -> None:  # fmt: skip
    """Write `evenly` times the density where `places`, (3, N), are seen; `shift` is wo_xy / wo_z."""
    period, rows, slip = lattice
    width, height, stride = np.float32(period * points), np.float32(rows * points), period * points + 1
    # What is multiplied by, in place of a division, is inverted here.
    size = np.float32(points), width, height, np.float32(slip * points), _1 / width, _1 / height, np.int32(stride)
    count = len(weight)
    squares, part_x, part_y = room.squares[:count], room.part_x[:count], room.part_y[:count]
    _find(places, np.float32(plane), np.float32(shift_x), np.float32(shift_y), size, squares, part_x, part_y)
    _read(room.grid, np.uint32(stride), squares, part_x, part_y, evenly, weight)


@fast_kernel
def _find(
    places: Float32, plane: np.float32, shift_x: np.float32, shift_y: np.float32, size: GridSize, squares: Squares,
    part_x: Float32, part_y: Float32,
) -> None:  # fmt: skip
    """Write in which square of the grid each of the `places` is seen, (3, N), and where in it."""
    points, width, height, slip, narrower, lower, stride = size
    for k in range(len(squares)):
        above = places[2, k] - plane
        x, y = (places[0, k] - above * shift_x) * points, (places[1, k] - above * shift_y) * points
        # Conversions cut towards 0: numbers of periods are made positive before.
        turns = np.float32(np.int32(y * lower + _FAR)) - _FAR
        y -= turns * height
        x -= turns * slip
        x -= (np.float32(np.int32(x * narrower + _FAR)) - _FAR) * width
        # Rounding may leave a place on the far border.
        column, line = np.int32(min(max(x, _0), width - _1)), np.int32(min(max(y, _0), height - _1))
        part_x[k], part_y[k] = x - np.float32(column), y - np.float32(line)
        squares[k] = np.uint32(line * stride + column)


@fast_kernel
def _read(
    grid: Float32, step: np.uint32, squares: Squares, part_x: Float32, part_y: Float32, evenly: Float32, weight: Float32
) -> None:
    """Write `evenly` times the density of the grid, whose rows have `step` points."""
    for k in range(len(weight)):
        at = squares[k]
        above = np.uint32(at + step)
        low, high = grid[at], grid[above]
        low += part_x[k] * (grid[np.uint32(at + _NEXT)] - low)
        high += part_x[k] * (grid[np.uint32(above + _NEXT)] - high)
        weight[k] = evenly[k] * (low + part_y[k] * (high - low))


@fast_kernel
def any_weight(share: Float32) -> bool:
    """Return whether any of the shares is above 0."""
    total = _0
    for k in range(len(share)):
        total += share[k]
    return bool(total > _0)
