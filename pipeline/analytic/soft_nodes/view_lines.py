"""Nodes that a footprint of view rays places itself: on lines in the viewer's azimuth, with nothing hidden among them.

A ray belongs to the point of the reference plane that it crosses. Seen in the viewer's azimuth, a point of height h at
s is displaced to q = s - d, with d the distance in which a ray sinks from h to the plane; across the azimuth nothing is
displaced. So a footprint is cut into lines in that azimuth, and each line is a curve h(s). Going away from the viewer,
a point is seen if its q is less than all q before it. On a torus h is concave, so q(s) falls to its least at the crest
that the viewer sees and rises from there: what is seen of a piece is one interval, found by its two ends. Gauss's rule
is used in it, with the density at q; across the lines the trapezoidal rule. Rays between what is covered and the near
end of a piece meet the wall below it: with `SoftNodeTable.rims` they see the surface at this end, which is one node.

Over a cloth of curvature kappa the ray is a parabola: with T = |o_xy| / o_z and g the height over the plane,
d = 2 g T / (1 + sqrt(1 + 2 kappa T^2 g)) [Kuznetsov2022Curved]. A steep view's ray rises again before it has sunk to
the lowest yarns, and may meet the flank of a yarn then: this is the other root of the parabola, on which q grows
towards the crest. What it clears leaves the cloth.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from pipeline.analytic.soft_horizons import AZIMUTHS, above, ramp, sharpness_of_points
from pipeline.analytic.soft_nodes.ellipse_nodes import in_grid, next_cut, piece_at
from pipeline.analytic.soft_nodes.footprint_nodes import (
    GAUSS_PLACES,
    GAUSS_WEIGHTS,
    MOST_ACROSS,
    fill_eight,
    write_eight,
)
from pipeline.analytic.soft_nodes.line_nodes import (
    ACROSS,
    ALONG_FROM,
    APART,
    AT,
    BENDING,
    BY_ACROSS,
    BY_ALONG,
    DENSITY,
    FLOAT_BEND,
    FLOAT_DROP,
    FLOAT_HALF,
    LENGTH,
    ROWS_FROM,
    ROWS_PER,
    STEEPEST_SINE,
)
from pipeline.analytic.soft_nodes.nodes import (
    BLOCK,
    BLOCK_NODES,
    BOUND,
    CURVE,
    FAMILY,
    LEVELS,
    SHIFT,
    X_HIGH,
    X_LOW,
    Y_HIGH,
    Y_LOW,
    SoftNodeTable,
)
from pipeline.analytic.soft_nodes.scratch import DRAFT_ROWS, Scratch, SoftQuery
from pipeline.compiled.arrays import Float32, Float64
from pipeline.compiled.decorators import fast_kernel, inlined_fast_kernel
from pipeline.compiled.float32 import arcsine
from pipeline.truth.geometry.heightfield import (
    AXIS_DROP,
    BEND_RADIUS,
    BETA,
    GAP,
    HALF_LENGTH,
    INVERSE_RADIUS,
    RADIUS,
    WARP,
    WEFT,
)

_BETWEEN: Final = 0.25  # yarn spacings: distance of the lines at level 2
_COARSEST: Final = 0.9  # the same in deviations
_FOOTPRINT_ENDS: Final = 2.4  # where the footprint ends, in deviations
_LENGTH: Final = 0.2  # yarn spacings of an interval for each node beyond the first
_DEVIATIONS: Final = 0.6  # and deviations
_NEAREST: Final = 1e-5  # least length of a segment
_CREST_STEPS: Final = 8
_CREST_CLOSE: Final = 1e-2
_ROOT_STEPS: Final = 8
_THIRDS, _HALVINGS = 16, 24
_CLOSE: Final = 0.02  # of a deviation: how near the end of an interval is found where something hides the rest,
_WHERE_IT_ENDS: Final = 0.3  # and where the footprint ends
_NEVER: Final = 1e9
_FARTHEST: Final = 200.0  # yarn spacings that a line is followed
_STEEP: Final = 0.05  # of a radius, across the yarn: shorter intervals take places even along the line
_0, _HALF, _LEVELS = np.float32(0.0), np.float32(0.5), np.float32(LEVELS)
_SMEARED: Final = 0.2  # yarn spacings across, in which a line crosses the border of a yarn


class ViewRay(NamedTuple):
    """How the rays of a footprint sink.

    Attributes
    ----------
    dx, dy : float
        The viewer's azimuth.
    run : float
        Distance in the plane for each unit of height, T.
    bend : float
        Curvature of the cloth in this azimuth, 1/yarn spacings.
    plane : float
        Height of the reference plane.
    least : float
        Height at which the rays rise again; that of the lowest yarn if they do not before.
    """

    dx: float
    dy: float
    run: float
    bend: float
    plane: float
    least: float


class YarnCurve(NamedTuple):
    """A piece of a yarn along a line, in its own frame.

    Attributes
    ----------
    across, by_across, along, by_along : float
        Place across and along the yarn, a + s a' and b + s b'.
    per_radius, radius, beta : float
        Of the yarn.
    bend, half, drop, side : float
        Of its float: bend radius, 0 if it is drawn flat; half length and drop; 1 on top and -1 beneath.
    """

    across: float
    by_across: float
    along: float
    by_along: float
    per_radius: float
    radius: float
    beta: float
    bend: float
    half: float
    drop: float
    side: float


@fast_kernel
def sunk(ray: ViewRay, height: float) -> tuple[float, float]:
    """Return how far before the plane a ray has a height, and its slope there, as a share of that at the plane."""
    if ray.bend == 0.0:
        return (height - ray.plane) * ray.run, 1.0
    square = 1.0 + 2.0 * ray.bend * ray.run * ray.run * (height - ray.plane)
    if square <= 0.0:
        return -_NEVER, 0.0
    root = math.sqrt(square)
    return 2.0 * (height - ray.plane) * ray.run / (1.0 + root), root


@inlined_fast_kernel
def _height_and_slope(curve: YarnCurve, s: float) -> tuple[float, float, float]:
    """Return the height at s, and two numbers whose quotient is the slope towards -s, smooth up to the yarn's border.

    The height is that of `torus_height` and `height_beneath`, sqrt((R +- rho)^2 - b^2) - R cos u_max times the relief.
    """
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
def _seen(curve: YarnCurve, ray: ViewRay, s: float) -> tuple[float, float]:
    """Return to where the point at s is displaced, and a number with the sign of n.o."""
    height, slope, upright = _height_and_slope(curve, s)
    distance, steep = sunk(ray, height)
    return s - distance, upright * steep + ray.run * slope


@inlined_fast_kernel
def _seen_rising(curve: YarnCurve, ray: ViewRay, s: float) -> tuple[float, float]:
    """Return the same for rays that rise: its place, and a number that is positive where they meet the flank."""
    height, slope, upright = _height_and_slope(curve, s)
    steep = math.sqrt(max(1.0 + 2.0 * ray.bend * ray.run * ray.run * (height - ray.plane), 0.0))
    return s + (1.0 + steep) / (ray.bend * ray.run), ray.run * slope - upright * steep


@fast_kernel
def _reached(curve: YarnCurve, ray: ViewRay, low: float, high: float) -> tuple[float, float]:
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
def _rising_crest(curve: YarnCurve, ray: ViewRay, low: float, high: float) -> float:
    """Return the crest of a piece that rising rays clear; they meet the flank between it and `high`."""
    if _seen_rising(curve, ray, high)[1] <= 0.0:
        return high
    crest = low
    if _seen_rising(curve, ray, low)[1] < 0.0:
        for _ in range(_HALVINGS):
            middle = 0.5 * (crest + high)
            if _seen_rising(curve, ray, middle)[1] > 0.0:
                high = middle
            else:
                crest = middle
    return crest


@fast_kernel
def _rising_interval(
    curve: YarnCurve, ray: ViewRay, crest: float, high: float, q_from: float, q_to: float
) -> tuple[float, float]:
    """Return from where to where a flank is seen by rising rays from `q_from` to `q_to`."""
    start, stop = crest, high
    if q_to <= q_from or _seen_rising(curve, ray, crest)[0] <= q_from or _seen_rising(curve, ray, high)[0] >= q_to:
        return high, high
    if _seen_rising(curve, ray, high)[0] < q_from:
        stop = _place_of(curve, ray, crest, high, q_from, True)
    if _seen_rising(curve, ray, crest)[0] > q_to:
        start = _place_of(curve, ray, crest, high, q_to, True)
    return start, stop


@fast_kernel
def _place_of(curve: YarnCurve, ray: ViewRay, low: float, high: float, target: float, rising: bool) -> float:
    """Return the place between two that rays through `target` meet."""
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        q = _seen_rising(curve, ray, middle)[0] if rising else _seen(curve, ray, middle)[0]
        if (q > target) == rising:
            low = middle
        else:
            high = middle
    return 0.5 * (low + high)


@inlined_fast_kernel
def _crest(
    curve: YarnCurve, ray: ViewRay, low: float, high: float, at_low: float, at_high: float, q_high: float
) -> tuple[float, float]:  # fmt: skip
    """Return where between a place that faces away and one that faces the viewer the displaced place is least, and it.

    Illinois' method; the error of the least place is of second order.
    """
    kept, q = 0, q_high
    for _ in range(_CREST_STEPS):
        s = low + (high - low) * at_low / (at_low - at_high)
        q, at = _seen(curve, ray, s)
        if at > 0.0:
            high, at_high = s, at
            at_low *= 0.5 if kept > 0 else 1.0
            kept = 1
        else:
            low, at_low = s, at
            at_high *= 0.5 if kept < 0 else 1.0
            kept = -1
        if high - low < _CREST_CLOSE or abs(at) < _CREST_CLOSE:
            return s, q
    return s, q


@inlined_fast_kernel
def _at_place(
    curve: YarnCurve, ray: ViewRay, crest: float, high: float, q_crest: float, q_high: float, target: float, near: float
) -> float:  # fmt: skip
    """Return an s between the crest and `high` that is displaced to `target`, or to a place as `near` as that.

    Displaced places rise between them. Steps are those of parabolas through both ends, level at the first one.
    """
    s = high
    for _ in range(_ROOT_STEPS):
        s = crest + (high - crest) * math.sqrt((target - q_crest) / (q_high - q_crest))
        q, _ = _seen(curve, ray, s)
        if abs(q - target) < near:
            break
        if q > target:
            high, q_high = s, q
        else:
            crest, q_crest = s, q
    return s


@fast_kernel
def nodes_on_lines(deviation_x: float, deviation_y: float, narrowest: float, spacing: float) -> float:
    """Return a bound of the nodes that a footprint places on lines, given its least deviation of any direction."""
    widest = math.sqrt(max(deviation_x**2 + deviation_y**2 - narrowest**2, narrowest**2))
    # Parts between borders of yarns, and rims, have a node more than their length takes.
    lines = 3.0 + 2.0 * _FOOTPRINT_ENDS * (1.0 / (_COARSEST * spacing) + narrowest * (1.0 / (_BETWEEN * spacing) + 1.0))
    nodes = 3.0 + 2.0 * _FOOTPRINT_ENDS * (1.0 / (_DEVIATIONS * spacing) + widest * (1.0 / (_LENGTH * spacing) + 2.0))
    return lines * nodes


@fast_kernel
def _lines_across(
    ray: ViewRay, x: float, y: float, sigma: float, radii: tuple[float, float], reach: float, spacing: float,
    lines: Float64,
) -> int:  # fmt: skip
    """Write places of lines across the azimuth and the widths that they stand for, (2, most); return their number.

    Lines that run along yarns have places by Gauss's rule between the borders of yarns.
    """
    along_x = abs(ray.dy) < abs(ray.dx)
    distance = spacing * min(_BETWEEN, _COARSEST * sigma)
    if reach * min(abs(ray.dx), abs(ray.dy)) >= _SMEARED:
        count = math.ceil(_FOOTPRINT_ENDS * sigma / distance)
        apart = _FOOTPRINT_ENDS * sigma / count
        for j in range(2 * count + 1):
            lines[0, j], lines[1, j] = (j - count) * apart, apart
        return 2 * count + 1
    # At w across the azimuth the line has x = x - w dy, or y = y + w dx.
    centre, factor, radius = (y, ray.dx, radii[WEFT]) if along_x else (x, -ray.dy, radii[WARP])
    place, stop, n = centre - _FOOTPRINT_ENDS * sigma, centre + _FOOTPRINT_ENDS * sigma, 0
    while place < stop - _NEAREST and n < lines.shape[1] - MOST_ACROSS:
        after = min(next_cut(place, True, radius), stop)
        half, middle = 0.5 * (after - place), 0.5 * (after + place)
        # Widths of yarns are round numbers, and so may be the quotient: it must not fall below.
        count = min(1 + int((2.0 * half + _NEAREST) / distance), MOST_ACROSS)
        for i in range(count):
            lines[0, n] = (middle + half * GAUSS_PLACES[count, i] - centre) / factor
            lines[1, n] = half * GAUSS_WEIGHTS[count, i]
            n += 1
        place = after
    return n


class ViewLine(NamedTuple):
    """A line of a footprint.

    Attributes
    ----------
    x, y : float
        Its place s = 0, where the footprint is densest on it.
    density, sigma : float
        Density there times the width that the line stands for, and deviation along the line.
    apart : float
        That width.
    """

    x: float
    y: float
    density: float
    sigma: float
    apart: float


@inlined_fast_kernel
def _curve_of(table: SoftNodeTable, p: int, ray: ViewRay, x: float, y: float) -> YarnCurve:
    """Return the curve of a piece along a line that has s = 0 at (x, y) from the corner of the cell."""
    family, box, own = table.pieces[p, FAMILY], table.bounds[p], table.floats[p]
    yarn, side = table.heights[family], -1.0 if box[CURVE] < 0.0 else 1.0
    a, by_a, b, by_b = x - 0.5, ray.dx, y - 0.5 + box[SHIFT], ray.dy
    if family == WEFT:
        # Along a weft, y of its frame runs against x.
        a, by_a, b, by_b = y - 0.5, ray.dy, -(x - 0.5 + box[SHIFT]), -ray.dx
    return YarnCurve(
        a, by_a, b, by_b, yarn[INVERSE_RADIUS], yarn[RADIUS], yarn[BETA], own[BEND_RADIUS], own[HALF_LENGTH],
        own[AXIS_DROP], side,
    )  # fmt: skip


@inlined_fast_kernel
def _interval(
    curve: YarnCurve, ray: ViewRay, low: float, high: float, sigma: float, covered: float
) -> tuple[float, float, float, float, float]:
    """Return from where to where a piece between two places is seen, how long that seems, and what is covered then.

    Rays from `covered` on meet something nearer to the viewer. The interval is empty if its end is not behind its
    start, and cut where the footprint ends. Returned last is the displaced place of the piece's near end: rays from
    there to `covered` meet the wall below it. It is `covered` if this end faces away from the viewer.
    """
    crest, left, right = low, -_FOOTPRINT_ENDS * sigma, _FOOTPRINT_ENDS * sigma
    q_crest, at_low = _seen(curve, ray, low)
    q_high, at_high = _seen(curve, ray, high)
    if at_low < 0.0:
        if at_high <= 0.0:
            return low, low, 0.0, min(covered, q_high), covered
        crest, q_crest = _crest(curve, ray, low, high, at_low, at_high, q_high)
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


@inlined_fast_kernel
def _write_draft(
    draft: Float32, k: int, start: float, stop: float, count: int, curve: YarnCurve, of_line: ViewLine, bounds: Float32,
    family: int, size: int, line: Float32,
) -> None:  # fmt: skip
    """Write the nodes of an interval from `k` on: even along the line, or in the angle across the yarn.

    An interval of no length is a rim, whose density is its whole weight.
    """
    turned = abs(curve.by_across) * (stop - start) > _STEEP * curve.radius
    first, last = np.float32(start), np.float32(stop)
    if turned:
        first = arcsine(np.float32((curve.across + start * curve.by_across) * curve.per_radius))
        last = arcsine(np.float32((curve.across + stop * curve.by_across) * curve.per_radius))
    half, middle = _HALF * (last - first), _HALF * (last + first)
    extent = abs(half) if turned else -abs(half)
    for i in range(8):
        line[0, i], line[1, i] = middle + half * GAUSS_PLACES[count, i], extent * GAUSS_WEIGHTS[count, i]
    write_eight(draft[AT], k, line[0])
    write_eight(draft[LENGTH], k, line[1])
    fill_eight(draft[ACROSS], k, np.float32(curve.across))
    fill_eight(draft[BY_ACROSS], k, np.float32(curve.by_across))
    fill_eight(draft[ALONG_FROM], k, np.float32(curve.along))
    fill_eight(draft[BY_ALONG], k, np.float32(curve.by_along))
    fill_eight(draft[DENSITY], k, np.float32(of_line.density))
    fill_eight(draft[APART], k, np.float32(of_line.apart))
    fill_eight(draft[FLOAT_BEND], k, np.float32(curve.side * curve.bend))
    fill_eight(draft[FLOAT_HALF], k, np.float32(curve.half) if curve.bend > 0.0 else _0)
    fill_eight(draft[FLOAT_DROP], k, np.float32(curve.drop))
    fill_eight(draft[BENDING], k, bounds[CURVE])
    fill_eight(draft[STEEPEST_SINE], k, bounds[BOUND])
    low, high = (bounds[Y_LOW], bounds[Y_HIGH]) if family == WARP else (bounds[X_LOW], bounds[X_HIGH])
    rows = np.float32(size) / (high - low)
    fill_eight(draft[ROWS_FROM], k, (_HALF - bounds[SHIFT] - low) * rows)
    fill_eight(draft[ROWS_PER], k, rows if family == WARP else -rows)


class Piece(NamedTuple):
    """A piece along a line: its curve, row of `SoftNodeTable.bounds`, family, first cell of its grid and its size."""

    curve: YarnCurve
    bounds: Float32
    family: int
    first: int
    size: int


@fast_kernel
def _write_meetings(
    scratch: Scratch, kind: int, k: int, ray: ViewRay, of_line: ViewLine, piece: Piece, start: float, stop: float,
    rising: bool,
) -> int:  # fmt: skip
    """Write the nodes of an interval from `k` on, even in the place where they are seen; return where they end.

    Where rays turn they see an endless length of a small piece: places along the line would be far apart there.
    """
    ends = _seen_rising(piece.curve, ray, start)[0], _seen_rising(piece.curve, ray, stop)[0]
    if not rising:
        ends = _seen(piece.curve, ray, start)[0], _seen(piece.curve, ray, stop)[0]
    half, middle, sigma = 0.5 * abs(ends[1] - ends[0]), 0.5 * (ends[0] + ends[1]), of_line.sigma
    count = min(1 + int(2.0 * half / (_DEVIATIONS * sigma)), MOST_ACROSS)
    if stop <= start or half <= _NEAREST or k + count > scratch.drafts.shape[2] - 2 * BLOCK_NODES:
        return k
    draft = scratch.drafts[kind]
    for i in range(count):
        q = middle + half * GAUSS_PLACES[count, i]
        share = of_line.density * half * GAUSS_WEIGHTS[count, i] * math.exp(-0.5 * (q / sigma) ** 2)
        s = _place_of(piece.curve, ray, start, stop, q, rising)
        of_node = ViewLine(of_line.x, of_line.y, share, sigma, of_line.apart)
        _write_draft(
            draft, k + i, s, s, 1, piece.curve, of_node, piece.bounds, piece.family, piece.size, scratch.line
        )  # fmt: skip
        for j in range(8):
            scratch.firsts[kind, k + i + j] = piece.first
    return k + count


@inlined_fast_kernel
def _fill_block(draft: Float32, firsts: npt.NDArray[np.uint32], stop: int) -> int:
    """Fill the last block of nodes with such that weigh nothing; return the number of nodes."""
    for k in (stop, stop + 8):
        for row in range(DRAFT_ROWS):
            fill_eight(draft[row], k, draft[row, stop - 1])
        fill_eight(draft[DENSITY], k, _0)
        for i in range(8):
            firsts[k + i] = firsts[stop - 1]
    return -(-stop // BLOCK_NODES) * BLOCK_NODES


@inlined_fast_kernel
def _gap_seen(scratch: Scratch, look: SoftQuery, at: int, per_azimuth: int) -> np.float32:
    """Return the share of a cell of a gap's grid through which the viewer sees; what hides it is a step."""
    low, high = scratch.grid[at + look.low_o * per_azimuth], scratch.grid[at + look.high_o * per_azimuth]
    sharp = sharpness_of_points(_0) / _LEVELS
    return ramp(above(look.oz * _LEVELS, np.float32(low), np.float32(high), look.turn_o, sharp))


@inlined_fast_kernel
def _under_bell(low: float, high: float) -> float:
    """Return the integral of exp(-x^2 / 2)."""
    return math.sqrt(0.5 * math.pi) * (math.erf(high * math.sqrt(0.5)) - math.erf(low * math.sqrt(0.5)))


@inlined_fast_kernel
def _place_line(
    table: SoftNodeTable, scratch: Scratch, look: SoftQuery, ray: ViewRay, view_line: ViewLine
) -> float:  # fmt: skip
    """Place the nodes of one line, from the viewer on until all its rays have met something; return the gaps seen."""
    ends, picks, size = table.repeat[0], table.repeat[1], table.grid.shape[2]
    per_ends, per_picks, per_grid = 1.0 / ends, 1.0 / picks, AZIMUTHS * size * size
    of_warp, of_weft, stops = table.kinds[0], table.kinds[1], scratch.stops
    warp_radius, weft_radius = table.heights[WARP, RADIUS], table.heights[WEFT, RADIUS]
    x0, y0, ex, ey, sigma = view_line.x, view_line.y, ray.dx, ray.dy, view_line.sigma
    of_gap, gaps, covered, limit = sunk(ray, 0.0)[0], 0.0, _NEVER, scratch.drafts.shape[2] - 2 * BLOCK_NODES
    stopped, slit_from, slit_to = 0.0, 0.0, 0.0
    left, right = -_FOOTPRINT_ENDS * sigma, _FOOTPRINT_ENDS * sigma
    low = right + sunk(ray, table.highest)[0]
    rising, lowest = ray.least > table.lowest, sunk(ray, max(ray.least, table.lowest))[0]
    if rising:
        lowest = sunk(ray, table.highest)[0] - 2.0 * math.sqrt(
            max(1.0 + 2.0 * ray.bend * ray.run * ray.run * (table.highest - ray.plane), 0.0)
        ) / (ray.bend * ray.run)  # fmt: skip
    last = max(left + lowest, low - _FARTHEST)
    while low > last and covered > left:
        # The next cut on the way from the viewer.
        high, low = low, last
        if abs(ex) > _NEAREST:
            low = max(low, min((next_cut(x0 + high * ex, ex < 0.0, warp_radius) - x0) / ex, high - _NEAREST))
        if abs(ey) > _NEAREST:
            low = max(low, min((next_cut(y0 + high * ey, ey < 0.0, weft_radius) - y0) / ey, high - _NEAREST))
        in_x, in_y = x0 + 0.5 * (low + high) * ex, y0 + 0.5 * (low + high) * ey
        column, row = math.floor(in_x), math.floor(in_y)
        # Of whole numbers: a quotient of floats is rounded, and integer division is slow.
        repeats_x, repeats_y = math.floor((column + 0.5) * per_ends), math.floor((row + 0.5) * per_picks)
        cell = int((row - picks * repeats_y) * ends + column - ends * repeats_x)
        p = piece_at(table.piece_starts, table.bounds, cell, np.float32(in_x - column), np.float32(in_y - row))
        if p < 0 or high - low < 2.0 * _NEAREST:
            continue
        family, first, bounds = table.pieces[p, FAMILY], table.pieces[p, BLOCK] * per_grid, table.bounds[p]
        if family == GAP:
            q_low, q_high = max(low - of_gap, left), min(high - of_gap, right, covered)
            covered = min(covered, low - of_gap)
            if q_high > q_low:
                q = 0.5 * (q_low + q_high)
                share = view_line.density * (q_high - q_low) * math.exp(-0.5 * (q / sigma) ** 2)
                at_x, at_y = np.float32(x0 + (q + of_gap) * ex - column), np.float32(y0 + (q + of_gap) * ey - row)
                at = first + in_grid(bounds, family, _HALF, at_x, at_y, size)
                through = float(_gap_seen(scratch, look, at, size * size))
                gaps += share * through
                stopped += share * (1.0 - through)
            continue
        if low - sunk(ray, table.crowns[p])[0] >= min(covered, right):
            continue
        curve = _curve_of(table, p, ray, x0 - column, y0 - row)
        wall_to, reached_to, before = min(covered, right), high, covered
        reached_from = low
        if rising:
            reached_from, reached_to = _reached(curve, ray, low, high)
            if reached_to <= reached_from:
                continue
            wall_to = min(wall_to, _seen_rising(curve, ray, high)[0]) if reached_to == high else -_NEVER
        start, stop, seen, covered, wall_from = _interval(curve, ray, reached_from, reached_to, sigma, covered)
        kind = column % of_warp if family == WARP else of_warp + row % of_weft
        k, wall_from = stops[kind], max(wall_from, left)
        if table.rims and wall_to - wall_from > _NEAREST and k < limit:
            rim = stopped + view_line.density * _under_bell(wall_from / sigma, wall_to / sigma) * sigma
            of_rim, stopped = ViewLine(x0, y0, rim, sigma, view_line.apart), 0.0
            _write_draft(
                scratch.drafts[kind], k, high, high, 1, curve, of_rim, bounds, family, size, scratch.line
            )  # fmt: skip
            for i in range(8):
                scratch.firsts[kind, k + i] = first
            k += 1
            stops[kind] = k
        if rising:
            of_piece = Piece(curve, bounds, family, first, size)
            k = _write_meetings(scratch, kind, k, ray, view_line, of_piece, start, stop, False)
            crest = _rising_crest(curve, ray, reached_from, reached_to)
            start, stop = _rising_interval(curve, ray, crest, reached_to, left, min(before, right))
            k = _write_meetings(scratch, kind, k, ray, view_line, of_piece, start, stop, True)
            # Of rays that cleared the last piece, this one stops some, or it opens a new slit above it.
            cleared = max(_seen_rising(curve, ray, crest)[0], _seen(curve, ray, reached_to)[0])
            if cleared < before:
                slit_from, slit_to = cleared, before
            elif slit_to > slit_from:
                start, stop = _rising_interval(curve, ray, crest, reached_to, max(slit_from, left), min(slit_to, right))
                k = _write_meetings(scratch, kind, k, ray, view_line, of_piece, start, stop, True)
                slit_from = max(slit_from, cleared)
            stops[kind] = k
            continue
        if stop <= start or k >= limit:
            continue
        count = 1 + int(max((stop - start + _NEAREST) / _LENGTH, seen / (_DEVIATIONS * sigma)) / table.spacing)
        count = min(count, MOST_ACROSS)
        _write_draft(
            scratch.drafts[kind], k, start, stop, count, curve, view_line, bounds, family, size, scratch.line
        )  # fmt: skip
        for i in range(8):
            scratch.firsts[kind, k + i] = first
        stops[kind] = k + count
    return gaps


@inlined_fast_kernel
def place_on_view_lines(
    table: SoftNodeTable, scratch: Scratch, look: SoftQuery, ray: ViewRay
) -> tuple[np.float32, np.float32]:
    """Place the nodes of a footprint of rays; return the area seen through gaps, and 1 / deviation along lines.

    Writes `Scratch.drafts` and `Scratch.firsts`, whole blocks of each kind of yarn, and in `Scratch.stops` how many.
    Weights are shares of the footprint in the fabric plane, which A(wo) turns into shares of its rays.
    """
    scratch.stops[:] = 0
    xx, yy, xy = look.dx * look.dx, look.dy * look.dy, look.rho * look.dx * look.dy
    ex, ey, lines, gaps = ray.dx, ray.dy, scratch.view_lines, 0.0
    # Deviation across the azimuth; drift and deviation along it, given the place across.
    across = math.sqrt(xx * ey * ey + yy * ex * ex - 2.0 * xy * ex * ey)
    drift = (ex * ey * (yy - xx) + xy * (ex * ex - ey * ey)) / (across * across)
    sigma = math.sqrt(float(max(xx * yy - xy * xy, np.float32(0.0)))) / across
    radii = table.heights[WARP, RADIUS], table.heights[WEFT, RADIUS]
    reach = 2.0 * _FOOTPRINT_ENDS * sigma
    for j in range(_lines_across(ray, look.x, look.y, across, radii, reach, table.spacing, lines)):
        w, apart = lines[0, j], lines[1, j]
        density = apart / (2.0 * math.pi * across * sigma) * math.exp(-0.5 * (w / across) ** 2)
        x, y = look.x - w * ey + drift * w * ex, look.y + w * ex + drift * w * ey
        gaps += _place_line(table, scratch, look, ray, ViewLine(x, y, density, sigma, apart))
    for kind in range(len(scratch.stops)):
        if scratch.stops[kind] > 0:
            scratch.stops[kind] = _fill_block(scratch.drafts[kind], scratch.firsts[kind], scratch.stops[kind])
    return np.float32(gaps) * look.oz, np.float32(1.0 / sigma)
