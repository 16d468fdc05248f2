"""The point of the cloth that a ray meets first, found without a step size.

A view ray sinks from the height of the highest yarn, cell by cell, as the rays of `visibility` rise. Over the yarn on
top, height minus ray is concave along the ray: it lies below its tangents, so Newton's steps from a place where the ray
is above the yarn never pass the first meeting, and converge to it. A ray that is below a piece where it enters it has
met the wall between this piece and the last. In gaps nothing stops a ray; it goes on to yarns further down, or leaves
the cloth below. On a base that falls away by kappa s^2 / 2 it may rise again and leave above. A ray from one yarn to
the next may rise too; the float that it leaves cannot stop it (`pipeline.truth.geometry.visibility`).
"""

import math
from typing import NamedTuple

from pipeline.compiled.decorators import inlined_kernel, kernel
from pipeline.truth.geometry.heightfield import GAP, TOP, UNDER, HeightField, surface_at
from pipeline.truth.geometry.march import Cell, Ray, first_cell, float_on_top, next_cell, span_on_top, span_over, wrap
from pipeline.truth.geometry.visibility import above, over_strip

ON_YARN, ON_WALL, MISSED = 0, 1, 2  # ends of a ray

_MAX_CELLS = 100_000
_NEWTON_STEPS = 60
_HALVINGS = 48
_CLOSE = 1e-13  # in yarn spacings: a step that ends the search
_LEVEL = 1e-9  # height above the ray that counts as on it: neighbouring cells round their common border differently
_INSIDE = 1e-12  # distance of a point from the border of its cell
_BEHIND = 1e-9  # distance of a point of a wall from the border that the ray crosses


class Hit(NamedTuple):
    """Where a ray ends."""

    what: int  # ON_YARN, ON_WALL or MISSED
    x: float
    y: float
    """The point, in the cell (pick, end) of the repeat; the start of the ray if it meets nothing."""
    end: int
    pick: int
    """The cell."""
    distance: float  # distance from the start of the ray, in the fabric plane


@kernel
def sinking(viewer: Ray, highest: float, plane: float) -> tuple[Ray, float, float]:
    """Return the view ray that crosses the reference plane at a point, from the height of the highest yarn on.

    `viewer` leads from the plane to the viewer; the cloth falls away below it by kappa s^2 / 2. Also returned is how
    far from the point the ray starts, and at what distance from there it crosses the fabric plane: infinity if never.
    """
    if viewer.rise == math.inf:
        down = Ray(-viewer.x, -viewer.y, -viewer.z, viewer.dx, viewer.dy, -math.inf, 0.0, 1.0, math.inf)
        return down, 0.0, 0.0
    slope = math.sqrt(viewer.rise * viewer.rise + 2.0 * viewer.bend * (highest - plane))
    x, y, z, dx, dy, bend = -viewer.x, -viewer.y, -viewer.z, -viewer.dx, -viewer.dy, viewer.bend
    towards = Ray(x, y, z, dx, dy, -slope, bend, viewer.stride_x, viewer.stride_y)
    return towards, 2.0 * (highest - plane) / (viewer.rise + slope), _level_at(towards, highest)


@kernel
def _level_at(towards: Ray, height: float) -> float:
    """Return the distance at which a sinking ray has lost a height, or infinity if it rises before."""
    square = towards.rise * towards.rise - 2.0 * towards.bend * height
    return 2.0 * height / (math.sqrt(square) - towards.rise) if square > 0.0 else math.inf


@inlined_kernel
def _meets_top(
    field: HeightField, x: float, y: float, z: float, towards: Ray, start: float, stop: float, cell: Cell
) -> float:
    """Return the distance at which a ray above the top piece of a cell at `start` meets it; more than `stop`: never."""
    s = start
    for _ in range(_NEWTON_STEPS):
        over, growth = above(field, TOP, x, y, z, towards, s, cell)
        if over >= 0.0:
            return s
        if growth <= 0.0:
            return math.inf
        step = -over / growth
        s += step
        if s > stop:
            return math.inf
        if step < _CLOSE:
            return s
    return s


@inlined_kernel
def _ends_in(
    field: HeightField, side: int, x: float, y: float, z: float, towards: Ray, start: float, stop: float, cell: Cell
) -> tuple[int, float]:
    """Return what a ray meets of a piece of a cell between two distances, ON_YARN, ON_WALL or MISSED, and where."""
    if side == UNDER:
        start, stop = span_over(field, 1 - int(field.top[cell.pick, cell.end]), x, y, towards, start, stop, cell)
    if stop <= start:
        return MISSED, 0.0
    over, _ = above(field, side, x, y, z, towards, start, cell)
    if over > _LEVEL:
        return ON_WALL, start
    if side == TOP:
        s = _meets_top(field, x, y, z, towards, start, stop, cell)
    else:
        # The height of the yarn beneath is not concave: meetings are sought between points.
        low, s = over_strip(field, x, y, z, towards, start, stop, 1, cell)
        for _ in range(_HALVINGS if s < math.inf else 0):
            middle = 0.5 * (low + s)
            over, _ = above(field, UNDER, x, y, z, towards, middle, cell)
            low, s = (low, middle) if over > 0.0 else (middle, s)
    return (ON_YARN, s) if s <= stop else (MISSED, 0.0)


@kernel
def first_hit(field: HeightField, x: float, y: float, z: float, towards: Ray, side: int = UNDER) -> Hit:
    """Return what a ray meets first that starts at (x, y, z), not below the surface.

    The ray sinks at first (towards.z < 0), or runs straight down; (x, y) may lie anywhere on the endless cloth. Over
    flat cloth it may also leave the cloth's own point, above its tangent plane, and rise; `side` is TOP on the yarn on
    top. The point of a ray that ends on a wall is just inside the piece above it: the border itself would belong to
    either side, as numbers are rounded.
    """
    picks, ends = field.top.shape
    x, y = wrap(x, ends), wrap(y, picks)
    rise, bend = towards.rise, towards.bend
    cell = first_cell(x, y, towards)
    if rise == math.inf:
        return Hit(MISSED, x, y, cell.end, cell.pick, 0.0)
    if rise == -math.inf:
        family, _, _, _, _, _, _, _, _ = surface_at(field, x, y, cell.end, cell.pick)
        return Hit(MISSED if family == GAP else ON_YARN, x, y, cell.end, cell.pick, 0.0)
    own = float_on_top(field, cell)
    distance = 0.0
    bottom = _level_at(towards, z - field.lowest)
    for _ in range(_MAX_CELLS):
        leave = min(cell.next_x, cell.next_y, bottom)
        # A ray is lowest where it leaves the cell, unless it rises, or will again.
        lowest = min(max(-rise / bend, distance), leave) if bend > 0.0 else (distance if rise > 0.0 else leave)
        if leave > distance and field.crown[cell.pick, cell.end] >= z + lowest * (rise + 0.5 * bend * lowest):
            is_own = side == TOP and float_on_top(field, cell) == own
            enter, exit_ = span_on_top(field, cell, x, y, towards, distance, leave)
            what, s = _ends_in(field, UNDER, x, y, z, towards, distance, enter, cell)
            if what == MISSED and not is_own:
                what, s = _ends_in(field, TOP, x, y, z, towards, enter, exit_, cell)
            if what == MISSED:
                what, s = _ends_in(field, UNDER, x, y, z, towards, exit_, leave, cell)
            if what != MISSED:
                column, row = float(cell.column - cell.end), float(cell.row - cell.pick)
                # A wall belongs to the piece behind the border, whose rim is above.
                s += _BEHIND if what == ON_WALL else 0.0
                hit_x = min(max(x + s * towards.dx - column, cell.end + _INSIDE), cell.end + 1.0 - _INSIDE)
                hit_y = min(max(y + s * towards.dy - row, cell.pick + _INSIDE), cell.pick + 1.0 - _INSIDE)
                return Hit(what, hit_x, hit_y, cell.end, cell.pick, s)
        distance = leave
        slope = rise + bend * distance
        if distance == bottom or (slope >= 0.0 and z + distance * (rise + 0.5 * bend * distance) > field.highest):
            break
        cell = next_cell(field, cell, towards)
    return Hit(MISSED, x, y, cell.end, cell.pick, distance)
