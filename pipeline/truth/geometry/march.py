"""The endless cloth: positions wrapped into its repeat, and rays that march from cell to cell."""

import math
from typing import NamedTuple

from pipeline.compiled.decorators import inlined_kernel, kernel
from pipeline.truth.geometry import heightfield
from pipeline.truth.geometry.heightfield import OFFSET, RADIUS, TOP, UNDER, WARP, HeightField


@inlined_kernel
def wrap(x: float, repeat: float) -> float:
    """Return x modulo the repeat, in [0, repeat)."""
    wrapped = x - repeat * math.floor(x / repeat)
    return wrapped if 0.0 <= wrapped < repeat else 0.0


class Ray(NamedTuple):
    """A direction prepared for marches; the same for every point of a query."""

    x: float
    y: float
    z: float
    """The unit vector."""
    dx: float
    dy: float
    """Unit direction in the fabric plane."""
    rise: float  # height gained per unit of distance in the plane; infinite for the normal itself
    bend: float  # curvature of the base along the ray, >= 0: it falls away by bend s^2 / 2
    stride_x: float
    stride_y: float
    """Distance between two cell borders in x and in y."""


@kernel
def ray(x: float, y: float, z: float, bend: float) -> Ray:
    """Prepare a unit direction, over a base of curvature `bend` along it."""
    flat = math.sqrt(x * x + y * y)
    if flat < 1e-9:
        return Ray(x, y, z, 1.0, 0.0, math.inf if z > 0.0 else -math.inf, 0.0, 1.0, math.inf)
    dx, dy = x / flat, y / flat
    return Ray(x, y, z, dx, dy, z / flat, bend, _stride(dx), _stride(dy))


@kernel
def level_ray(dx: float, dy: float, bend: float) -> Ray:
    """Prepare a unit direction in the fabric plane."""
    return Ray(dx, dy, 0.0, dx, dy, 0.0, bend, _stride(dx), _stride(dy))


@inlined_kernel
def _stride(d: float) -> float:
    """Return the distance between two borders that a ray crosses in one axis; `d` is its direction along it."""
    return 1.0 / abs(d) if d != 0.0 else math.inf


class Cell(NamedTuple):
    """A cell on the way of a ray."""

    end: int
    pick: int
    """Its place in the repeat."""
    column: int
    row: int
    """Its place in the endless cloth, counted from the repeat in which the ray starts."""
    next_x: float
    next_y: float
    """Distance from the start at which the ray reaches the next border in x and in y."""


@inlined_kernel
def first_cell(x: float, y: float, towards: Ray) -> Cell:
    """Return the cell of the repeat in which a ray from (x, y) starts."""
    column, row, dx, dy = int(x), int(y), towards.dx, towards.dy
    next_x = ((column + 1 - x) if dx >= 0.0 else (x - column)) * towards.stride_x if dx != 0.0 else math.inf
    next_y = ((row + 1 - y) if dy >= 0.0 else (y - row)) * towards.stride_y if dy != 0.0 else math.inf
    return Cell(column, row, column, row, next_x, next_y)


@inlined_kernel
def next_cell(field: HeightField, cell: Cell, towards: Ray) -> Cell:
    """Return the cell that a ray enters when it leaves this one."""
    picks, ends = field.top.shape
    if cell.next_x <= cell.next_y:
        step = 1 if towards.dx >= 0.0 else -1
        end = cell.end + step
        end = 0 if end == ends else (ends - 1 if end < 0 else end)
        return Cell(end, cell.pick, cell.column + step, cell.row, cell.next_x + towards.stride_x, cell.next_y)
    step = 1 if towards.dy >= 0.0 else -1
    pick = cell.pick + step
    pick = 0 if pick == picks else (picks - 1 if pick < 0 else pick)
    return Cell(cell.end, pick, cell.column, cell.row + step, cell.next_x, cell.next_y + towards.stride_y)


@inlined_kernel
def float_on_top(field: HeightField, cell: Cell) -> tuple[int, int, float]:
    """Return the float on top of a cell, named by its family, its yarn and its centre on the endless cloth."""
    family = int(field.top[cell.pick, cell.end])
    offset = field.floats[cell.pick, cell.end, TOP, OFFSET]
    if family == WARP:
        return family, cell.column, cell.row - offset
    return family, cell.row, cell.column - offset


@inlined_kernel
def height_along(
    field: HeightField, side: int, x: float, y: float, towards: Ray, distance: float, cell: Cell
) -> tuple[float, float]:
    """Return the height of one piece of a cell at a distance from (x, y) along a ray, and its slope along the ray."""
    family = int(field.top[cell.pick, cell.end])
    if side == UNDER:
        family = 1 - family
    yarn, own, dx, dy = field.yarn[family], field.floats[cell.pick, cell.end, side], towards.dx, towards.dy
    x, y = x + distance * dx, y + distance * dy
    across, along = heightfield.local_position(family, own[OFFSET], x, y, cell.column, cell.row)
    height, slope_x, slope_y = heightfield.float_height(yarn, own, side, across, along)
    if family == WARP:
        return height, slope_x * dx + slope_y * dy
    return height, slope_x * dy - slope_y * dx


@kernel
def span_over(
    field: HeightField, family: int, x: float, y: float, towards: Ray, start: float, stop: float, cell: Cell
) -> tuple[float, float]:
    """Return the part of the way from `start` to `stop` that lies over a yarn of a cell; none of it: stop < start."""
    radius, slope = field.yarn[family, RADIUS], towards.dx if family == WARP else towards.dy
    across, _ = heightfield.local_position(family, 0.0, x, y, cell.column, cell.row)
    if slope == 0.0:
        return (start, stop) if abs(across) <= radius else (stop, start - 1.0)
    first, second = (-radius - across) / slope, (radius - across) / slope
    return max(start, min(first, second)), min(stop, max(first, second))


@inlined_kernel
def span_on_top(
    field: HeightField, cell: Cell, x: float, y: float, towards: Ray, start: float, stop: float
) -> tuple[float, float]:
    """Return the part of the way from `start` to `stop` through a cell that lies over its top yarn.

    Before and after that part, the yarn beneath or a gap shows. If the top yarn covers nothing, both numbers are equal.
    """
    family = int(field.top[cell.pick, cell.end])
    if field.yarn[family, RADIUS] >= 0.5:
        return start, stop
    low, high = span_over(field, family, x, y, towards, start, stop, cell)
    enter = min(low, stop)
    return enter, max(high, enter)
