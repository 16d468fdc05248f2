"""Weights of view rays: the density of a footprint where the viewer sees each node, displaced by its height.

A node at p with height h is seen where its view ray crosses the reference plane of height z_0, at

    q = p - (h - z_0) wo_xy / wo_z,

and the rays around it have the area A(wo) dp = wo_z dq. So its weight is the area of the node times the density of the
footprint at q. The density is folded by the translations that map the cloth onto itself and tabulated on a grid over
the cells that differ, once for a query; nodes read it between the points of the grid. That widens it by the variance
step^2 / 6 along each axis, by which the footprint is made narrower before.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from pipeline.compiled.arrays import Float32
from pipeline.compiled.decorators import fast_kernel, kernel
from pipeline.truth.cloth import WideQueries
from pipeline.truth.footprint.mixture import Line, along_axes, line_points
from pipeline.truth.node_table.build import ExactNodes

MOST_POINTS: Final = 32  # most points of the grid on a yarn spacing

_POINTS = 3.0  # of the grid on a deviation of the footprint: the mean error of reading between them is 3e-4 of the peak
_REACH = 5.5  # in standard deviations; what lies beyond is 4e-8
_SPREAD_OUT = 0.8  # in periods: an axis of a Gaussian this wide is even, to 6e-6
_FAR = np.float32(256.0)  # periods: no view ray within 89 degrees of the normal is displaced as far
_0, _1 = np.float32(0.0), np.float32(1.0)
_NEXT = np.uint32(1)


Squares = npt.NDArray[np.uint32]  # numbers of squares of the grid, (N,)


class GridSize(NamedTuple):
    """Size of the grid: points on a yarn spacing, then in points the lattice's length, height and shift.

    `narrower` and `lower` are 1 over the first two, `stride` is the number of points of a row.
    """

    points: np.float32
    width: np.float32
    height: np.float32
    slip: np.float32
    narrower: np.float32
    lower: np.float32
    stride: np.int32


class DensityRoom(NamedTuple):
    """Room for the density of one footprint."""

    grid: Float32  # density at the points of the grid, row by row, (G,)
    along_x: Float32
    along_y: Float32
    """Density along both axes, the first over two periods."""
    points: Float32  # places and shares of the points of a mixture, (2, P)
    squares: Squares  # square of the grid in which each node is seen, uint32 (N,)
    part_x: Float32
    part_y: Float32
    """Where in it, 0 to 1, (N,)."""


def density_room(table: ExactNodes, line: Line) -> DensityRoom:
    """Return room for footprints over a table, rotated ones by a `line`."""
    period, rows, _ = table.lattice
    sizes = (
        (period * MOST_POINTS + 1) * (rows * MOST_POINTS + 1),
        2 * period * MOST_POINTS + 1,
        table.repeat[1] * MOST_POINTS + 1,
    )
    grid, along_x, along_y = (np.zeros(int(size), np.float32) for size in sizes)
    nodes = max(len(table.evenly), len(table.walls.height))
    points, parts = np.zeros((2, line.points), np.float32), np.zeros((2, nodes), np.float32)
    return DensityRoom(grid, along_x, along_y, points, np.zeros(nodes, np.uint32), parts[0], parts[1])


@kernel
def fill_displaced(
    table: ExactNodes, plane: float, columns: WideQueries, row: int, line: Line, room: DensityRoom, weight: Float32
) -> int:
    """Write the share of a Gaussian footprint of rays that falls on each node and its copies; rotated ones by a `line`.

    `plane` is the height of the reference plane. Returns the points of the grid on a yarn spacing.
    """
    wo = columns.wo[row]
    points = _fill_density(table, columns, row, line, room)
    read_density(table.lattice, points, plane, wo[0] / wo[2], wo[1] / wo[2], room, table.places, table.evenly, weight)
    return points


@kernel
def _fill_density(table: ExactNodes, columns: WideQueries, row: int, line: Line, room: DensityRoom) -> int:
    """Write the folded density of a footprint, of mean 1, to the grid; return the points on a yarn spacing."""
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
            _add_outer(own_x[: width + 1], along_y[n * height : (n + 1) * height + 1], grid)
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


@fast_kernel
def _add_outer(along_x: Float32, along_y: Float32, grid: Float32) -> None:
    """Add the products of two densities to the grid."""
    width = len(along_x)
    for j in range(len(along_y)):
        factor = along_y[j]
        if factor > _0:
            own = grid[j * width : (j + 1) * width]
            for i in range(width):
                own[i] += factor * along_x[i]


@kernel
def read_density(
    lattice: tuple[int, int, int], points: int, plane: float, shift_x: float, shift_y: float, room: DensityRoom,
    places: Float32, evenly: Float32, weight: Float32,
) -> None:  # fmt: skip
    """Write `evenly` times the density where `places`, (3, N), are seen; `shift` is wo_xy / wo_z."""
    period, rows, slip = lattice
    width, height, stride = np.float32(period * points), np.float32(rows * points), period * points + 1
    size = GridSize(
        np.float32(points), width, height, np.float32(slip * points), _1 / width, _1 / height, np.int32(stride)
    )
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
    for k in range(len(squares)):
        above = places[2, k] - plane
        x, y = (places[0, k] - above * shift_x) * size.points, (places[1, k] - above * shift_y) * size.points
        # Conversions cut towards 0: numbers of periods are made positive before.
        turns = np.float32(np.int32(y * size.lower + _FAR)) - _FAR
        y -= turns * size.height
        x -= turns * size.slip
        x -= (np.float32(np.int32(x * size.narrower + _FAR)) - _FAR) * size.width
        # Rounding may leave a place on the far border.
        column, line = np.int32(min(max(x, _0), size.width - _1)), np.int32(min(max(y, _0), size.height - _1))
        part_x[k], part_y[k] = x - np.float32(column), y - np.float32(line)
        squares[k] = np.uint32(line * size.stride + column)


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
