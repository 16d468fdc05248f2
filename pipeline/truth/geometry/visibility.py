"""Shadowing and masking: whether a ray from the cloth leaves it, decided without a step size.

A ray crosses the fabric cell by cell. Inside one cell the top yarn's height is concave along any line (heightfield), so
height minus ray is concave too, and three facts settle most cells at once: an end above the ray hits; a slope that
falls from the start, or rises to the end, has its greatest value there; two tangents that meet below the ray prove that
nothing in between reaches it. What remains is narrowed by the tangent at the meeting point. On a cylinder the base
falls away under the ray by kappa s^2 / 2 [Kuznetsov2022Curved], which bends the ray up and keeps all of this true. The
float that a ray starts on cannot hide it: its surface is concave and the ray leaves above its tangent plane. Strips
where a narrow yarn lets the one beneath show are not concave; they are searched at `_STRIP_POINTS` points.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from pipeline.compiled.decorators import inlined_kernel, kernel
from pipeline.truth.geometry.heightfield import TOP, UNDER, HeightField, height_along, span_over
from pipeline.truth.geometry.march import Cell, first_cell, float_on_top, next_cell, span_on_top, stride

_STRIP_POINTS = 16
_MAX_CELLS = 100_000  # a ray this long is as good as parallel to the cloth
_NARROWINGS = 40


class Ray(NamedTuple):
    """A direction prepared for `visible`; the same for every point of a query.

    Attributes
    ----------
    x, y, z : float
        The unit vector.
    dx, dy : float
        Unit direction in the fabric plane.
    rise : float
        Height gained per unit of distance in the plane; infinite for the normal itself.
    bend : float
        Curvature of the base along the ray, >= 0: it falls away by bend s^2 / 2.
    stride_x, stride_y : float
        Distance between two cell borders in x and in y.
    """

    x: float
    y: float
    z: float
    dx: float
    dy: float
    rise: float
    bend: float
    stride_x: float
    stride_y: float


@inlined_kernel
def _altitude(z: float, towards: Ray, distance: float) -> float:
    """Return the height over the base of a ray that began at z."""
    return z + distance * (towards.rise + 0.5 * towards.bend * distance)


@inlined_kernel
def _piece_blocks(
    field: HeightField,
    x: float,
    y: float,
    z: float,
    towards: Ray,
    start: float,
    stop: float,
    cell: Cell,
) -> bool:
    """Return whether the top piece of a cell reaches the ray between distances `start` and `stop`."""
    end, pick, column, row = cell.end, cell.pick, cell.column, cell.row
    dx, dy, rise, bend = towards.dx, towards.dy, towards.rise, towards.bend
    low, low_slope = height_along(field, TOP, x + start * dx, y + start * dy, dx, dy, end, pick, column, row)
    low, low_slope = low - _altitude(z, towards, start), low_slope - (rise + bend * start)
    if low > 0.0:
        return True
    if low_slope <= 0.0:
        return False
    high, high_slope = height_along(field, TOP, x + stop * dx, y + stop * dy, dx, dy, end, pick, column, row)
    high, high_slope = high - _altitude(z, towards, stop), high_slope - (rise + bend * stop)
    if high > 0.0:
        return True
    if high_slope >= 0.0:
        return False
    for _ in range(_NARROWINGS):
        # Tangents at both ends bound a concave function from above; they meet at `meet`.
        meet = (high - low + low_slope * start - high_slope * stop) / (low_slope - high_slope)
        if low + low_slope * (meet - start) <= 0.0:
            return False
        # Near a yarn's edge a tangent is vertical and meets at the end itself: stay inside.
        width = stop - start
        meet = min(max(meet, start + 0.125 * width), stop - 0.125 * width)
        middle, slope = height_along(field, TOP, x + meet * dx, y + meet * dy, dx, dy, end, pick, column, row)
        middle, slope = middle - _altitude(z, towards, meet), slope - (rise + bend * meet)
        if middle > 0.0:
            return True
        if slope > 0.0:
            start, low, low_slope = meet, middle, slope
        else:
            stop, high, high_slope = meet, middle, slope
    return False


@inlined_kernel
def _strip_blocks(
    field: HeightField,
    x: float,
    y: float,
    z: float,
    towards: Ray,
    start: float,
    stop: float,
    cell: Cell,
) -> bool:
    """Return whether the yarn beneath reaches the ray between `start` and `stop`; tested at `_STRIP_POINTS` points."""
    end, pick, column, row = cell.end, cell.pick, cell.column, cell.row
    dx, dy = towards.dx, towards.dy
    family = 1 - int(field.top[pick, end])
    # A yarn may be narrower than the distance of points along the whole way.
    start, stop = span_over(field, family, x, y, dx, dy, start, stop, column, row)
    if stop < start:
        return False
    for k in range(_STRIP_POINTS):
        s = start + (stop - start) * k / (_STRIP_POINTS - 1.0)
        height, _ = height_along(field, UNDER, x + s * dx, y + s * dy, dx, dy, end, pick, column, row)
        if height > _altitude(z, towards, s):
            return True
    return False


@kernel
def ray(x: float, y: float, z: float, bend: float) -> Ray:
    """Prepare a unit direction, over a base of curvature `bend` along it."""
    flat = math.sqrt(x * x + y * y)
    if flat < 1e-9:
        return Ray(x, y, z, 1.0, 0.0, math.inf if z > 0.0 else -math.inf, 0.0, 1.0, math.inf)
    dx, dy = x / flat, y / flat
    return Ray(x, y, z, dx, dy, z / flat, bend, stride(dx), stride(dy))


@inlined_kernel
def visible(field: HeightField, x: float, y: float, z: float, side: int, towards: Ray) -> bool:
    """Return whether the point (x, y, z) sees a direction; a point on the cloth needs one above its tangent plane.

    Parameters
    ----------
    field : HeightField
        The repeat.
    x, y, z : float
        The point, not below the surface, 0 <= x < ends, 0 <= y < picks.
    side : int
        TOP for a point on the yarn on top; else UNDER.
    towards : Ray
        The direction.
    """
    dx, dy, rise, bend = towards.dx, towards.dy, towards.rise, towards.bend
    stride_x, stride_y = towards.stride_x, towards.stride_y
    if rise == math.inf:
        return True
    if rise <= 0.0 and (bend <= 0.0 or z - 0.5 * rise * rise / bend <= field.lowest):
        return False
    picks, ends = field.top.shape
    cell = first_cell(x, y, dx, dy, stride_x, stride_y)
    own_family, own_yarn, own_centre = float_on_top(field, cell)
    distance = 0.0
    for _ in range(_MAX_CELLS):
        if rise + bend * distance >= 0.0 and _altitude(z, towards, distance) >= field.highest:
            return True
        leave = min(cell.next_x, cell.next_y)
        # A ray is lowest where it enters the cell, unless it still sinks.
        turn = min(max(-rise / bend, distance), leave) if bend > 0.0 else distance
        if field.crown[cell.pick, cell.end] > _altitude(z, towards, turn) and leave > distance:
            family, yarn, centre = float_on_top(field, cell)
            is_own = side == TOP and family == own_family and yarn == own_yarn and centre == own_centre
            enter, exit_ = span_on_top(field, cell, x, y, dx, dy, distance, leave)
            if exit_ > enter and not is_own and _piece_blocks(field, x, y, z, towards, enter, exit_, cell):
                return False
            if enter > distance and _strip_blocks(field, x, y, z, towards, distance, enter, cell):
                return False
            if leave > exit_ and _strip_blocks(field, x, y, z, towards, exit_, leave, cell):
                return False
        distance = leave
        cell = next_cell(cell, dx, dy, stride_x, stride_y, ends, picks)
    return True
