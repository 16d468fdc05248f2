"""How view rays meet a cloth along a line in the viewer's azimuth: where it crosses pieces, what is seen of each.

A ray belongs to the point of the reference plane that it crosses. Seen in the viewer's azimuth, a point of height h at
s is displaced to q = s - d, with d the distance in which a ray sinks from h to the plane; across the azimuth nothing is
displaced. Going away from the viewer, a point is seen if its q is less than all q before it. On a torus h is concave,
so q(s) falls to its least at the crest that the viewer sees and rises from there: what is seen of a piece is one
interval, found by its two ends. Rays between what is covered and the near end of a piece meet the wall below it.

Over a cloth of curvature kappa the ray is a parabola: with T = |o_xy| / o_z and g the height over the plane,
d = 2 g T / (1 + sqrt(1 + 2 kappa T^2 g)) [Kuznetsov2022Curved]. A steep view's ray rises again before it has sunk to
the lowest yarns, and may meet the flank of a yarn then: this is the other root of the parabola, on which q grows
towards the crest. What it clears leaves the cloth.
"""

import math
from typing import Final, NamedTuple

import numpy as np

from pipeline.analytic.soft_nodes import nodes
from pipeline.analytic.soft_nodes.nodes import X_HIGH, X_LOW, Y_HIGH, Y_LOW, SoftNodeTable
from pipeline.compiled.arrays import Float32
from pipeline.compiled.decorators import fast_kernel, inlined_fast_kernel, inlined_kernel, kernel
from pipeline.compiled.float32 import arcsine
from pipeline.truth.geometry import heightfield
from pipeline.truth.geometry.heightfield import BETA, INVERSE_RADIUS, RADIUS, WARP, WEFT

FOOTPRINT_ENDS: Final = 2.4  # deviations at which a footprint of rays ends

NEVER: Final = 1e9  # place that no ray reaches

NEAREST: Final = 1e-5  # least length between cuts, in yarn spacings

_CREST_STEPS: Final = 8
_CREST_CLOSE, _CREST_NEAR = 0.01, 0.2  # yarn spacings, deviations: falls of the displaced place that end its search
_ROOT_STEPS: Final = 8
_THIRDS, _HALVINGS = 16, 24
_CLOSE: Final = 0.2  # of a deviation: from how near Newton's step finds the end of an interval where it is hidden,
_WHERE_IT_ENDS: Final = 1.0  # and where the footprint ends
_0, _HALF = np.float32(0.0), np.float32(0.5)
_INVERSE_PI = np.float32(1.0 / math.pi)


@kernel
def next_cut(place: float, forward: bool, radius: float) -> float:
    """Return the next border of a piece along an axis, of cells and of yarns of a radius."""
    cell = math.floor(place + NEAREST) if forward else math.ceil(place - NEAREST) - 1
    inside = place - cell
    low, high = 0.5 - radius, 0.5 + radius
    if forward:
        if inside < low - NEAREST:
            return cell + low
        return cell + high if inside < high - NEAREST and radius < 0.5 else cell + 1.0
    if inside > high + NEAREST:
        return cell + high
    return cell + low if inside > low + NEAREST and radius < 0.5 else float(cell)


@inlined_kernel
def piece_at(table: SoftNodeTable, cell: int, x: np.float32, y: np.float32) -> int:
    """Return the piece of a cell at a place within it, -1 if there is none."""
    for p in range(table.piece_starts[cell], table.piece_starts[cell + 1]):
        box = table.bounds[p]
        if box[X_LOW] <= x <= box[X_HIGH] and box[Y_LOW] <= y <= box[Y_HIGH]:
            return p
    return -1


@kernel
def in_grid(box: Float32, family: int, radius: np.float32, x: np.float32, y: np.float32, size: int) -> int:
    """Return the cell of a piece's grid at a place, counted from its first; cells are even in v across a yarn."""
    count = np.float32(size)
    last = count - np.float32(0.01)
    share_x = (x - box[X_LOW]) / (box[X_HIGH] - box[X_LOW])
    share_y = (y - box[Y_LOW]) / (box[Y_HIGH] - box[Y_LOW])
    if family == WARP:
        share_x = arcsine((x - _HALF) / radius) * _INVERSE_PI + _HALF
    elif family == WEFT:
        share_y = arcsine((y - _HALF) / radius) * _INVERSE_PI + _HALF
    row, column = min(max(share_y * count + nodes.UPPER, _0), last), min(max(share_x * count + nodes.UPPER, _0), last)
    return size * int(row) + int(column)


class ViewRay(NamedTuple):
    """How the rays of a footprint sink."""

    dx: float
    dy: float
    """The viewer's azimuth."""
    run: float  # distance in the plane for each unit of height, T
    bend: float  # curvature of the cloth in this azimuth, 1/yarn spacings
    plane: float  # height of the reference plane
    least: float  # height at which the rays rise again; that of the lowest yarn if they do not before


class YarnCurve(NamedTuple):
    """A piece of a yarn along a line, in its own frame."""

    across: float
    by_across: float
    along: float
    by_along: float
    """Place across and along the yarn, a + s a' and b + s b'."""
    per_radius: float
    radius: float
    beta: float
    """Of the yarn."""
    bend: float
    half: float
    drop: float
    side: float
    """Of its float: bend radius, 0 if it is drawn flat; half length and drop; 1 on top and -1 beneath."""


@fast_kernel
def sunk(ray: ViewRay, height: float) -> tuple[float, float]:
    """Return how far before the plane a ray has a height, and its slope there, as a share of that at the plane."""
    if ray.bend == 0.0:
        return (height - ray.plane) * ray.run, 1.0
    square = 1.0 + 2.0 * ray.bend * ray.run * ray.run * (height - ray.plane)
    if square <= 0.0:
        return -NEVER, 0.0
    root = math.sqrt(square)
    return 2.0 * (height - ray.plane) * ray.run / (1.0 + root), root


@inlined_fast_kernel
def _height_and_slope(curve: YarnCurve, s: float) -> tuple[float, float, float]:
    """Return the height at s, and two numbers whose quotient is the slope towards -s, smooth up to the border."""
    # As `float_height`: sqrt((R +- rho)^2 - b^2) - R cos u_max, times the relief.
    sine = min(1.0, max(-1.0, (curve.across + s * curve.by_across) * curve.per_radius))
    cosine = math.sqrt((1.0 - sine) * (1.0 + sine))
    rho, b = curve.radius * cosine, curve.along + s * curve.by_along
    if curve.bend == 0.0:
        return curve.beta * rho, curve.beta * sine * curve.by_across, cosine
    ring, beyond = curve.bend + curve.side * rho, 0.0
    if curve.side < 0.0:
        bound = ring * curve.half / curve.bend
        on_arc = min(max(b, -bound), bound)
        beyond = abs(b - on_arc) * curve.half / curve.drop
        b = on_arc
    root = math.sqrt((ring - b) * (ring + b))
    slope = ring * sine * curve.by_across + curve.side * b * cosine * curve.by_along
    return curve.beta * (curve.side * (root - curve.drop) + beyond), curve.beta * slope, cosine * root


@inlined_fast_kernel
def seen_at(curve: YarnCurve, ray: ViewRay, s: float) -> tuple[float, float, float]:
    """Return to where the point at s is displaced, q, and two numbers of quotient dq / ds; the first has n.o's sign."""
    height, slope, upright = _height_and_slope(curve, s)
    distance, steep = sunk(ray, height)
    return s - distance, upright * steep + ray.run * slope, upright * steep


@inlined_fast_kernel
def seen_rising(curve: YarnCurve, ray: ViewRay, s: float) -> tuple[float, float]:
    """Return the same for rays that rise: its place, and a number that is positive where they meet the flank."""
    height, slope, upright = _height_and_slope(curve, s)
    steep = math.sqrt(max(1.0 + 2.0 * ray.bend * ray.run * ray.run * (height - ray.plane), 0.0))
    return s + (1.0 + steep) / (ray.bend * ray.run), ray.run * slope - upright * steep


@fast_kernel
def reached(curve: YarnCurve, ray: ViewRay, low: float, high: float) -> tuple[float, float]:
    """Return between which places of a piece rays reach it that rise at `ViewRay.least`; none: the second is first."""
    # The highest place, by thirds.
    left, right = low, high
    for _ in range(_THIRDS):
        third = (right - left) / 3.0
        if _height_and_slope(curve, left + third)[0] < _height_and_slope(curve, right - third)[0]:
            left += third
        else:
            right -= third
    top = 0.5 * (left + right)
    if _height_and_slope(curve, top)[0] <= ray.least:
        return high, low
    first = low if _height_and_slope(curve, low)[0] > ray.least else _halve(curve, ray, top, low)
    return first, high if _height_and_slope(curve, high)[0] > ray.least else _halve(curve, ray, top, high)


@fast_kernel
def _halve(curve: YarnCurve, ray: ViewRay, inside: float, outside: float) -> float:
    """Return the place between two at which rays just reach a piece."""
    for _ in range(_HALVINGS):
        middle = 0.5 * (inside + outside)
        if _height_and_slope(curve, middle)[0] > ray.least:
            inside = middle
        else:
            outside = middle
    return inside


@fast_kernel
def rising_crest(curve: YarnCurve, ray: ViewRay, low: float, high: float) -> float:
    """Return the crest of a piece that rising rays clear; they meet the flank between it and `high`."""
    if seen_rising(curve, ray, high)[1] <= 0.0:
        return high
    crest = low
    if seen_rising(curve, ray, low)[1] < 0.0:
        for _ in range(_HALVINGS):
            middle = 0.5 * (crest + high)
            if seen_rising(curve, ray, middle)[1] > 0.0:
                high = middle
            else:
                crest = middle
    return crest


@fast_kernel
def rising_interval(
    curve: YarnCurve, ray: ViewRay, crest: float, high: float, q_from: float, q_to: float
) -> tuple[float, float]:
    """Return from where to where a flank is seen by rising rays from `q_from` to `q_to`."""
    start, stop = crest, high
    if q_to <= q_from or seen_rising(curve, ray, crest)[0] <= q_from or seen_rising(curve, ray, high)[0] >= q_to:
        return high, high
    if seen_rising(curve, ray, high)[0] < q_from:
        stop = place_of(curve, ray, crest, high, q_from, True)
    if seen_rising(curve, ray, crest)[0] > q_to:
        start = place_of(curve, ray, crest, high, q_to, True)
    return start, stop


@fast_kernel
def place_of(curve: YarnCurve, ray: ViewRay, low: float, high: float, target: float, rising: bool) -> float:
    """Return the place between two that rays through `target` meet."""
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        q = seen_rising(curve, ray, middle)[0] if rising else seen_at(curve, ray, middle)[0]
        if (q > target) == rising:
            low = middle
        else:
            high = middle
    return 0.5 * (low + high)


@inlined_fast_kernel
def _crest(
    curve: YarnCurve, ray: ViewRay, low: float, high: float, at_low: float, at_high: float, enough: float, near: float
) -> tuple[float, float]:  # fmt: skip
    """Return where the displaced place is least, or a place behind that is displaced to `enough` or farther; and it."""
    # Illinois' method: without halves an end that is kept makes steps far shorter than the way to the crest.
    kept, s, q = 0, high, enough
    for _ in range(_CREST_STEPS):
        s = low + (high - low) * at_low / (at_low - at_high)
        q, at, level = seen_at(curve, ray, s)
        if at > 0.0:
            if q <= enough:
                break
            high, at_high, at_low, kept = s, at, at_low * (0.5 if kept > 0 else 1.0), 1
        else:
            low, at_low, at_high, kept = s, at, at_high * (0.5 if kept < 0 else 1.0), -1
        step = low + (high - low) * at_low / (at_low - at_high) - s
        # The slope falls to 0 along the step.
        lower = -0.5 * step * at / max(level, NEAREST)
        if lower < near:
            return s, q - lower
    return s, q


@inlined_fast_kernel
def _at_place(
    curve: YarnCurve, ray: ViewRay, crest: float, high: float, q_crest: float, q_high: float, target: float, near: float
) -> float:  # fmt: skip
    """Return an s between the crest and `high` that is displaced to `target`: Newton's step from a place so `near`."""
    # Displaced places rise between them. Steps are those of parabolas through both ends, level at the first one.
    s = high
    for _ in range(_ROOT_STEPS):
        s = crest + (high - crest) * math.sqrt((target - q_crest) / (q_high - q_crest))
        q, at, level = seen_at(curve, ray, s)
        if abs(q - target) < near:
            # Of the root of the distance from the crest, in which a parabola is a line.
            over = max(q - q_crest, 0.0)
            step = 2.0 * (math.sqrt(over * (target - q_crest)) - over) * level / max(at, NEAREST)
            inside = min(max(s + step, crest), high)
            if abs(s + step - inside) < NEAREST:
                return inside
        if q > target:
            high, q_high = s, q
        else:
            crest, q_crest = s, q
    return s


@inlined_fast_kernel
def curve_of(table: SoftNodeTable, p: int, ray: ViewRay, x: float, y: float) -> YarnCurve:
    """Return the curve of a piece along a line that has s = 0 at (x, y) from the corner of the cell."""
    family, box, own = table.pieces[p, nodes.FAMILY], table.bounds[p], table.floats[p]
    yarn, side = table.heights[family], -1.0 if box[nodes.CURVE] < 0.0 else 1.0
    a, by_a, b, by_b = x - 0.5, ray.dx, y - 0.5 + box[nodes.SHIFT], ray.dy
    if family == WEFT:
        # Along a weft, y of its frame runs against x.
        a, by_a, b, by_b = y - 0.5, ray.dy, -(x - 0.5 + box[nodes.SHIFT]), -ray.dx
    return YarnCurve(
        a, by_a, b, by_b, yarn[INVERSE_RADIUS], yarn[RADIUS], yarn[BETA], own[heightfield.BEND_RADIUS],
        own[heightfield.HALF_LENGTH], own[heightfield.AXIS_DROP], side,
    )  # fmt: skip


@inlined_fast_kernel
def seen_interval(
    curve: YarnCurve, ray: ViewRay, low: float, high: float, sigma: float, covered: float
) -> tuple[float, float, float, float, float]:
    """Return from where to where a piece between two places is seen, how long that seems, and what is covered then.

    Rays from `covered` on meet something nearer to the viewer. The interval is empty if its end is not behind its
    start, and cut where the footprint ends. Returned last is the displaced place of the piece's near end: rays from
    there to `covered` meet the wall below it. It is `covered` if this end faces away from the viewer.
    """
    crest, left, right = low, -FOOTPRINT_ENDS * sigma, FOOTPRINT_ENDS * sigma
    q_crest, at_low, _ = seen_at(curve, ray, low)
    q_high, at_high, _ = seen_at(curve, ray, high)
    if at_low < 0.0:
        if at_high <= 0.0:
            return low, low, 0.0, min(covered, q_high), covered
        crest, q_crest = _crest(curve, ray, low, high, at_low, at_high, left, min(_CREST_CLOSE, _CREST_NEAR * sigma))
    q_from, q_to = max(q_crest, left), min(q_high, right, covered)
    start, stop = crest, high
    if q_to > q_from:
        if q_from > q_crest:
            start = _at_place(curve, ray, crest, high, q_crest, q_high, q_from, _WHERE_IT_ENDS * sigma)
        if q_to < q_high:
            near = (_WHERE_IT_ENDS if q_to == right else _CLOSE) * sigma
            stop = _at_place(curve, ray, crest, high, q_crest, q_high, q_to, near)
    else:
        stop = start
    return start, stop, q_to - q_from, min(covered, q_crest), q_high
