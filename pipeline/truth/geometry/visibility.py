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

from pipeline.compiled.decorators import inlined_kernel
from pipeline.truth.geometry.heightfield import TOP, UNDER, HeightField
from pipeline.truth.geometry.march import (
    Cell,
    Ray,
    first_cell,
    float_on_top,
    height_along,
    next_cell,
    span_on_top,
    span_over,
)

_STRIP_POINTS = 16
_MAX_CELLS = 100_000  # a ray this long is as good as parallel to the cloth
_NARROWINGS = 40


@inlined_kernel
def _altitude(z: float, towards: Ray, distance: float) -> float:
    """Return the height over the base of a ray that began at z."""
    return z + distance * (towards.rise + 0.5 * towards.bend * distance)


@inlined_kernel
def _piece_blocks(
    field: HeightField, x: float, y: float, z: float, towards: Ray, start: float, stop: float, cell: Cell
) -> bool:
    """Return whether the top piece of a cell reaches the ray between distances `start` and `stop`."""
    rise, bend = towards.rise, towards.bend
    low, low_slope = height_along(field, TOP, x, y, towards, start, cell)
    low, low_slope = low - _altitude(z, towards, start), low_slope - (rise + bend * start)
    if low > 0.0:
        return True
    if low_slope <= 0.0:
        return False
    high, high_slope = height_along(field, TOP, x, y, towards, stop, cell)
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
        middle, slope = height_along(field, TOP, x, y, towards, meet, cell)
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
    field: HeightField, x: float, y: float, z: float, towards: Ray, start: float, stop: float, cell: Cell
) -> bool:
    """Return whether the yarn beneath reaches the ray between `start` and `stop`; tested at `_STRIP_POINTS` points."""
    family = 1 - int(field.top[cell.pick, cell.end])
    # A yarn may be narrower than the distance of points along the whole way.
    start, stop = span_over(field, family, x, y, towards, start, stop, cell)
    if stop < start:
        return False
    for k in range(_STRIP_POINTS):
        s = start + (stop - start) * k / (_STRIP_POINTS - 1.0)
        height, _ = height_along(field, UNDER, x, y, towards, s, cell)
        if height > _altitude(z, towards, s):
            return True
    return False


@inlined_kernel
def visible(field: HeightField, x: float, y: float, z: float, side: int, towards: Ray) -> bool:
    """Return whether the point (x, y, z) sees a direction; a point on the cloth needs one above its tangent plane.

    The point is not below the surface, 0 <= x < ends, 0 <= y < picks; `side` is TOP if it is on the yarn on top.
    """
    rise, bend = towards.rise, towards.bend
    if rise == math.inf:
        return True
    if rise <= 0.0 and (bend <= 0.0 or z - 0.5 * rise * rise / bend <= field.lowest):
        return False
    cell = first_cell(x, y, towards)
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
            enter, exit_ = span_on_top(field, cell, x, y, towards, distance, leave)
            if exit_ > enter and not is_own and _piece_blocks(field, x, y, z, towards, enter, exit_, cell):
                return False
            if enter > distance and _strip_blocks(field, x, y, z, towards, distance, enter, cell):
                return False
            if leave > exit_ and _strip_blocks(field, x, y, z, towards, exit_, leave, cell):
                return False
        distance = leave
        cell = next_cell(field, cell, towards)
    return True
