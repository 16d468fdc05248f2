"""The endless cloth: positions wrapped into its repeat, rays that march from cell to cell, azimuths of tables."""

from __future__ import annotations

import math
from typing import NamedTuple

from pipeline.compiled.decorators import inlined_kernel, kernel
from pipeline.truth.geometry.heightfield import OFFSET, RADIUS, TOP, WARP, HeightField, span_over


@inlined_kernel
def wrap(x: float, repeat: float) -> float:
    """Return x modulo the repeat, in [0, repeat)."""
    wrapped = x - repeat * math.floor(x / repeat)
    return wrapped if 0.0 <= wrapped < repeat else 0.0


class Cell(NamedTuple):
    """A cell on the way of a ray.

    Attributes
    ----------
    end, pick : int
        Its place in the repeat.
    column, row : int
        Its place in the endless cloth, counted from the repeat in which the ray starts.
    next_x, next_y : float
        Distance from the start at which the ray reaches the next border in x and in y.
    """

    end: int
    pick: int
    column: int
    row: int
    next_x: float
    next_y: float


@inlined_kernel
def stride(d: float) -> float:
    """Return the distance between two borders that a ray crosses in one axis; `d` is its direction along it."""
    return 1.0 / abs(d) if d != 0.0 else math.inf


@inlined_kernel
def first_cell(x: float, y: float, dx: float, dy: float, stride_x: float, stride_y: float) -> Cell:
    """Return the cell of the repeat in which a ray from (x, y) in the unit direction (dx, dy) starts."""
    column, row = int(x), int(y)
    next_x = ((column + 1 - x) if dx >= 0.0 else (x - column)) * stride_x if dx != 0.0 else math.inf
    next_y = ((row + 1 - y) if dy >= 0.0 else (y - row)) * stride_y if dy != 0.0 else math.inf
    return Cell(column, row, column, row, next_x, next_y)


@inlined_kernel
def next_cell(cell: Cell, dx: float, dy: float, stride_x: float, stride_y: float, ends: int, picks: int) -> Cell:
    """Return the cell that a ray enters when it leaves this one."""
    if cell.next_x <= cell.next_y:
        step = 1 if dx >= 0.0 else -1
        end = cell.end + step
        end = 0 if end == ends else (ends - 1 if end < 0 else end)
        return Cell(end, cell.pick, cell.column + step, cell.row, cell.next_x + stride_x, cell.next_y)
    step = 1 if dy >= 0.0 else -1
    pick = cell.pick + step
    pick = 0 if pick == picks else (picks - 1 if pick < 0 else pick)
    return Cell(cell.end, pick, cell.column, cell.row + step, cell.next_x, cell.next_y + stride_y)


@inlined_kernel
def float_on_top(field: HeightField, cell: Cell) -> tuple[int, int, float]:
    """Return the float on top of a cell, named by its family, its yarn and its centre on the endless cloth."""
    family = int(field.top[cell.pick, cell.end])
    offset = field.floats[cell.pick, cell.end, TOP, OFFSET]
    if family == WARP:
        return family, cell.column, cell.row - offset
    return family, cell.row, cell.column - offset


@inlined_kernel
def span_on_top(
    field: HeightField, cell: Cell, x: float, y: float, dx: float, dy: float, start: float, stop: float
) -> tuple[float, float]:
    """Return the part of the way from `start` to `stop` through a cell that lies over its top yarn.

    Before and after that part, the yarn beneath or a gap shows. If the top yarn covers nothing, both numbers are equal.
    """
    family = int(field.top[cell.pick, cell.end])
    if field.yarn[family, RADIUS] >= 0.5:
        return start, stop
    low, high = span_over(field, family, x, y, dx, dy, start, stop, cell.column, cell.row)
    enter = min(low, stop)
    return enter, max(high, enter)


@kernel
def azimuth_rows(x: float, y: float, count: int) -> tuple[int, int, float]:
    """Return the two of `count` azimuths, even from +x counter-clockwise, around a direction, and its place between."""
    place = math.atan2(y, x) / (2.0 * math.pi) * count
    row = math.floor(place)
    return int(row) % count, int(row + 1) % count, place - row
