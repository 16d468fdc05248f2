"""Shadowing and masking: whether a ray from the cloth leaves it, decided without a step size.

A ray crosses the fabric cell by cell. Inside one cell the top yarn's height is concave along any line (heightfield), so
height minus ray is concave too, and three facts settle most cells at once: an end above the ray hits; a slope that
falls from the start, or rises to the end, has its greatest value there; two tangents that meet below the ray prove that
nothing in between reaches it. What remains is narrowed by the tangent at the meeting point. On a cylinder the base
falls away under the ray by kappa s^2 / 2 [Kuznetsov2022Curved], which bends the ray up and keeps all of this true. The
float that a ray starts on cannot hide it: its surface is concave and the ray leaves above its tangent plane. Strips
where a narrow yarn lets the one beneath show are not concave: points are tested, then uphill from the highest of them.
"""

import math

from pipeline.compiled.decorators import inlined_kernel
from pipeline.truth.geometry import march
from pipeline.truth.geometry.heightfield import TOP, UNDER, HeightField
from pipeline.truth.geometry.march import Cell, Ray

_STRIP_POINTS = 8
_MAX_CELLS = 100_000  # a ray this long is as good as parallel to the cloth
_NARROWINGS = 40
_UPHILL_STEPS = 8


@inlined_kernel
def _altitude(z: float, towards: Ray, distance: float) -> float:
    """Return the height over the base of a ray that began at z."""
    return z + distance * (towards.rise + 0.5 * towards.bend * distance)


@inlined_kernel
def above(
    field: HeightField, side: int, x: float, y: float, z: float, towards: Ray, distance: float, cell: Cell
) -> tuple[float, float]:
    """Return how far a piece of a cell is above the ray at a distance, and how fast that grows."""
    height, slope = march.height_along(field, side, x, y, towards, distance, cell)
    return height - _altitude(z, towards, distance), slope - (towards.rise + towards.bend * distance)


@inlined_kernel
def _piece_blocks(
    field: HeightField, x: float, y: float, z: float, towards: Ray, start: float, stop: float, cell: Cell
) -> bool:
    """Return whether the top piece of a cell reaches the ray between distances `start` and `stop`."""
    low, low_slope = above(field, TOP, x, y, z, towards, start, cell)
    if low > 0.0:
        return True
    if low_slope <= 0.0:
        return False
    high, high_slope = above(field, TOP, x, y, z, towards, stop, cell)
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
        middle, slope = above(field, TOP, x, y, z, towards, meet, cell)
        if middle > 0.0:
            return True
        if slope > 0.0:
            start, low, low_slope = meet, middle, slope
        else:
            stop, high, high_slope = meet, middle, slope
    return False


@inlined_kernel
def over_strip(
    field: HeightField, x: float, y: float, z: float, towards: Ray, start: float, stop: float, first: int, cell: Cell
) -> tuple[float, float]:
    """Return distances at which the yarn beneath is below and above the ray, the latter infinity if it never is.

    `first` is 0 if the start counts, else 1.
    """
    step = (stop - start) / (_STRIP_POINTS - 1.0)
    highest, best = -math.inf, start
    for k in range(first, _STRIP_POINTS):
        s = start + step * k
        over, _ = above(field, UNDER, x, y, z, towards, s, cell)
        if over > 0.0:
            return max(s - step, start), s
        if over > highest:
            highest, best = over, s
    _, uphill = above(field, UNDER, x, y, z, towards, best, cell)
    # A sliver may lie between two points.
    low, high = (best, min(best + step, stop)) if uphill > 0.0 else (max(best - step, start), best)
    for _ in range(_UPHILL_STEPS if highest + step * abs(uphill) > 0.0 else 0):
        s = 0.5 * (low + high)
        over, growth = above(field, UNDER, x, y, z, towards, s, cell)
        if over > 0.0:
            return low, s
        low, high = (s, high) if growth > 0.0 else (low, s)
    return start, math.inf


@inlined_kernel
def _strip_blocks(
    field: HeightField, x: float, y: float, z: float, towards: Ray, start: float, stop: float, cell: Cell
) -> bool:
    """Return whether the yarn beneath reaches the ray between `start` and `stop`."""
    # A yarn may be narrower than the distance of points along the whole way.
    start, stop = march.span_over(field, 1 - int(field.top[cell.pick, cell.end]), x, y, towards, start, stop, cell)
    return stop >= start and over_strip(field, x, y, z, towards, start, stop, 0, cell)[1] < math.inf


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
    cell = march.first_cell(x, y, towards)
    own = march.float_on_top(field, cell)
    distance = 0.0
    for _ in range(_MAX_CELLS):
        if rise + bend * distance >= 0.0 and _altitude(z, towards, distance) >= field.highest:
            return True
        leave = min(cell.next_x, cell.next_y)
        # A ray is lowest where it enters the cell, unless it still sinks.
        turn = min(max(-rise / bend, distance), leave) if bend > 0.0 else distance
        if field.crown[cell.pick, cell.end] > _altitude(z, towards, turn) and leave > distance:
            is_own = side == TOP and march.float_on_top(field, cell) == own
            enter, exit_ = march.span_on_top(field, cell, x, y, towards, distance, leave)
            if exit_ > enter and not is_own and _piece_blocks(field, x, y, z, towards, enter, exit_, cell):
                return False
            if enter > distance and _strip_blocks(field, x, y, z, towards, distance, enter, cell):
                return False
            if leave > exit_ and _strip_blocks(field, x, y, z, towards, exit_, leave, cell):
                return False
        distance = leave
        cell = march.next_cell(field, cell, towards)
    return True


@inlined_kernel
def gap_clear(front: HeightField, back: HeightField, x: float, y: float, viewer: Ray, behind: Ray) -> bool:
    """Return whether neither face hides a point of a gap; `behind` is the viewer's opposite as the back sees it."""
    return visible(front, x, y, 0.0, UNDER, viewer) and visible(back, x, y, 0.0, UNDER, behind)
