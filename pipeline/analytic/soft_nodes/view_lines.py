"""Nodes that a footprint of view rays places itself: on lines in the viewer's azimuth, with nothing hidden among them.

A footprint is cut into lines in that azimuth, and what is seen of each piece along a line is one interval (view_rays).
Gauss's rule is used in it, with the density where the viewer sees each node; across the lines the midpoint rule,
or Gauss's where they run along yarns. Rays between what is covered and the near end of a piece meet the wall below it:
with `SoftNodeTable.rims` they see the surface at this end, which is one node.
"""

import math
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from pipeline.analytic.soft_horizons import AZIMUTHS, above, bend_of, ramp, sharpness_of_points
from pipeline.analytic.soft_nodes import line_nodes, nodes, view_rays
from pipeline.analytic.soft_nodes.line_nodes import LineRays, shade_lines
from pipeline.analytic.soft_nodes.nodes import BLOCK_NODES, LEVELS, X_HIGH, X_LOW, Y_HIGH, Y_LOW, SoftNodeTable
from pipeline.analytic.soft_nodes.scratch import DRAFT_ROWS, Scratch, SoftQuery
from pipeline.analytic.soft_nodes.shade import GridHorizons, directions, write_sums
from pipeline.analytic.soft_nodes.view_rays import FOOTPRINT_ENDS, NEAREST, NEVER, ViewRay, YarnCurve
from pipeline.compiled.arrays import Float32, Float64
from pipeline.compiled.decorators import fast_kernel, inlined_fast_kernel, inlined_kernel
from pipeline.compiled.float32 import arcsine
from pipeline.truth.geometry.heightfield import GAP, RADIUS, WARP, WEFT

MOST_GAUSS: Final = 6  # most nodes of an interval

GAUSS_PLACES = np.zeros((MOST_GAUSS + 1, 8), np.float32)
GAUSS_WEIGHTS = np.zeros((MOST_GAUSS + 1, 8), np.float32)
for _n in range(1, MOST_GAUSS + 1):
    GAUSS_PLACES[_n, :_n], GAUSS_WEIGHTS[_n, :_n] = np.polynomial.legendre.leggauss(_n)

_BETWEEN: Final = 0.25  # yarn spacings: distance of the lines at level 2
_COARSEST: Final = 0.9  # the same in deviations
_LENGTH: Final = 0.2  # yarn spacings of an interval for each node beyond the first
_DEVIATIONS: Final = 0.6  # and deviations
_FARTHEST: Final = 200.0  # yarn spacings that a line is followed
_STEEP: Final = 0.05  # of a radius, across the yarn: shorter intervals take places even along the line
_SMEARED: Final = 0.2  # yarn spacings across, in which a line crosses the border of a yarn
_0, _1, _HALF, _LEVELS = np.float32(0.0), np.float32(1.0), np.float32(0.5), np.float32(LEVELS)
_FROM_ABOVE = np.float32(1e-6)
_JUST = 0.5 - 1e-7  # a half, less what rounding takes: the height at which rays turn has a root
_BOX = np.float32(0.1)  # deviation of the box of a node


@inlined_kernel
def nodes_on_lines(deviation_x: float, deviation_y: float, narrowest: float, spacing: float) -> float:
    """Return a bound of the nodes that a footprint places on lines, given its least deviation of any direction."""
    widest = math.sqrt(max(deviation_x**2 + deviation_y**2 - narrowest**2, narrowest**2))
    # Parts between borders of yarns, and rims, have a node more than their length takes.
    lines = 3.0 + 2.0 * FOOTPRINT_ENDS * (1.0 / (_COARSEST * spacing) + narrowest * (1.0 / (_BETWEEN * spacing) + 1.0))
    each = 3.0 + 2.0 * FOOTPRINT_ENDS * (1.0 / (_DEVIATIONS * spacing) + widest * (1.0 / (_LENGTH * spacing) + 2.0))
    return lines * each


@fast_kernel
def _lines_across(
    ray: ViewRay, x: float, y: float, sigma: float, radii: tuple[float, float], reach: float, spacing: float,
    lines: Float64,
) -> int:  # fmt: skip
    """Write places of lines across the azimuth and the widths that they stand for, (2, most); return their number."""
    along_x = abs(ray.dy) < abs(ray.dx)
    distance = spacing * min(_BETWEEN, _COARSEST * sigma)
    if reach * min(abs(ray.dx), abs(ray.dy)) >= _SMEARED:
        count = math.ceil(2.0 * FOOTPRINT_ENDS * sigma / distance)
        apart = 2.0 * FOOTPRINT_ENDS * sigma / count
        for j in range(count):
            lines[0, j], lines[1, j] = (j - 0.5 * (count - 1)) * apart, apart
        return count
    # Along yarns, by Gauss's rule between borders. At w across the azimuth the line has x - w dy, or y + w dx.
    centre, factor, radius = (y, ray.dx, radii[WEFT]) if along_x else (x, -ray.dy, radii[WARP])
    place, stop, n = centre - FOOTPRINT_ENDS * sigma, centre + FOOTPRINT_ENDS * sigma, 0
    while place < stop - NEAREST and n < lines.shape[1] - MOST_GAUSS:
        after = min(view_rays.next_cut(place, True, radius), stop)
        half, middle = 0.5 * (after - place), 0.5 * (after + place)
        # Widths of yarns are round numbers, and so may be the quotient: it must not fall below.
        count = min(1 + int((2.0 * half + NEAREST) / distance), MOST_GAUSS)
        for i in range(count):
            lines[0, n] = (middle + half * GAUSS_PLACES[count, i] - centre) / factor
            lines[1, n] = half * GAUSS_WEIGHTS[count, i]
            n += 1
        place = after
    return n


class ViewLine(NamedTuple):
    """A line of a footprint."""

    x: float
    y: float
    """Its place s = 0, where the footprint is densest on it."""
    density: float
    sigma: float
    """Density there times the width that the line stands for, and deviation along the line."""
    apart: float  # that width


class Piece(NamedTuple):
    """A piece along a line: its curve, row of `SoftNodeTable.bounds`, family, first cell of its grid and its size."""

    curve: YarnCurve
    bounds: Float32
    family: int
    first: int
    size: int


# Eight statements in place of a loop: they become one instruction, which a loop over arrays that may overlap does not.
@inlined_fast_kernel
def _write_eight(row: Float32, k: int, values: Float32) -> None:
    """Write eight numbers from `k` on."""
    v0, v1, v2, v3 = values[0], values[1], values[2], values[3]
    v4, v5, v6, v7 = values[4], values[5], values[6], values[7]
    own = row[k : k + 8]
    own[0], own[1], own[2], own[3], own[4], own[5], own[6], own[7] = v0, v1, v2, v3, v4, v5, v6, v7


@inlined_fast_kernel
def _fill_eight(row: Float32, k: int, value: np.float32) -> None:
    """Write a number eight times from `k` on."""
    own = row[k : k + 8]
    own[0], own[1], own[2], own[3], own[4], own[5], own[6], own[7] = (
        value, value, value, value, value, value, value, value
    )  # fmt: skip


@inlined_fast_kernel
def _write_draft(
    scratch: Scratch, kind: int, k: int, start: float, stop: float, count: int, piece: Piece, of_line: ViewLine
) -> None:
    """Write the nodes of an interval from `k` on; one of no length is a rim, whose density is its whole weight."""
    draft, line, curve, bounds = scratch.drafts[kind], scratch.line, piece.curve, piece.bounds
    turned = abs(curve.by_across) * (stop - start) > _STEEP * curve.radius
    first, last = np.float32(start), np.float32(stop)
    if turned:
        first = arcsine(np.float32((curve.across + start * curve.by_across) * curve.per_radius))
        last = arcsine(np.float32((curve.across + stop * curve.by_across) * curve.per_radius))
    half, middle = _HALF * (last - first), _HALF * (last + first)
    extent = abs(half) if turned else -abs(half)
    for i in range(8):
        line[0, i], line[1, i] = middle + half * GAUSS_PLACES[count, i], extent * GAUSS_WEIGHTS[count, i]
    _write_eight(draft[line_nodes.AT], k, line[0])
    _write_eight(draft[line_nodes.LENGTH], k, line[1])
    _fill_eight(draft[line_nodes.ACROSS], k, np.float32(curve.across))
    _fill_eight(draft[line_nodes.BY_ACROSS], k, np.float32(curve.by_across))
    _fill_eight(draft[line_nodes.ALONG_FROM], k, np.float32(curve.along))
    _fill_eight(draft[line_nodes.BY_ALONG], k, np.float32(curve.by_along))
    _fill_eight(draft[line_nodes.DENSITY], k, np.float32(of_line.density))
    _fill_eight(draft[line_nodes.APART], k, np.float32(of_line.apart))
    _fill_eight(draft[line_nodes.FLOAT_BEND], k, np.float32(curve.side * curve.bend))
    _fill_eight(draft[line_nodes.FLOAT_HALF], k, np.float32(curve.half) if curve.bend > 0.0 else _0)
    _fill_eight(draft[line_nodes.FLOAT_DROP], k, np.float32(curve.drop))
    _fill_eight(draft[line_nodes.BENDING], k, bounds[nodes.CURVE])
    _fill_eight(draft[line_nodes.STEEPEST_SINE], k, bounds[nodes.BOUND])
    low, high = (bounds[Y_LOW], bounds[Y_HIGH]) if piece.family == WARP else (bounds[X_LOW], bounds[X_HIGH])
    rows = np.float32(piece.size) / (high - low)
    _fill_eight(draft[line_nodes.ROWS_FROM], k, (_HALF - bounds[nodes.SHIFT] - low) * rows)
    _fill_eight(draft[line_nodes.ROWS_PER], k, rows if piece.family == WARP else -rows)
    for i in range(8):
        scratch.firsts[kind, k + i] = piece.first


@fast_kernel
def _write_meetings(
    scratch: Scratch, kind: int, k: int, ray: ViewRay, of_line: ViewLine, piece: Piece, start: float, stop: float,
    rising: bool,
) -> int:  # fmt: skip
    """Write the nodes of an interval from `k` on, even in the place where they are seen; return where they end."""
    # Where rays turn they see an endless length of a small piece: places along the line would be far apart there.
    ends = view_rays.seen_rising(piece.curve, ray, start)[0], view_rays.seen_rising(piece.curve, ray, stop)[0]
    if not rising:
        ends = view_rays.seen_at(piece.curve, ray, start)[0], view_rays.seen_at(piece.curve, ray, stop)[0]
    half, middle, sigma = 0.5 * abs(ends[1] - ends[0]), 0.5 * (ends[0] + ends[1]), of_line.sigma
    count = min(1 + int(2.0 * half / (_DEVIATIONS * sigma)), MOST_GAUSS)
    if stop <= start or half <= NEAREST or k + count > scratch.drafts.shape[2] - 2 * BLOCK_NODES:
        return k
    for i in range(count):
        q = middle + half * GAUSS_PLACES[count, i]
        share = of_line.density * half * GAUSS_WEIGHTS[count, i] * math.exp(-0.5 * (q / sigma) ** 2)
        s = view_rays.place_of(piece.curve, ray, start, stop, q, rising)
        of_node = ViewLine(of_line.x, of_line.y, share, sigma, of_line.apart)
        _write_draft(scratch, kind, k + i, s, s, 1, piece, of_node)
    return k + count


@inlined_fast_kernel
def _fill_block(draft: Float32, firsts: npt.NDArray[np.uint32], stop: int) -> int:
    """Fill the last block of nodes with such that weigh nothing; return the number of nodes."""
    for k in (stop, stop + 8):
        for row in range(DRAFT_ROWS):
            _fill_eight(draft[row], k, draft[row, stop - 1])
        _fill_eight(draft[line_nodes.DENSITY], k, _0)
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
    of_gap, gaps, covered, limit = view_rays.sunk(ray, 0.0)[0], 0.0, NEVER, scratch.drafts.shape[2] - 2 * BLOCK_NODES
    stopped, slit_from, slit_to = 0.0, 0.0, 0.0
    left, right = -FOOTPRINT_ENDS * sigma, FOOTPRINT_ENDS * sigma
    low = right + view_rays.sunk(ray, table.highest)[0]
    rising, lowest = ray.least > table.lowest, view_rays.sunk(ray, max(ray.least, table.lowest))[0]
    if rising:
        lowest = view_rays.sunk(ray, table.highest)[0] - 2.0 * math.sqrt(
            max(1.0 + 2.0 * ray.bend * ray.run * ray.run * (table.highest - ray.plane), 0.0)
        ) / (ray.bend * ray.run)  # fmt: skip
    last = max(left + lowest, low - _FARTHEST)
    while low > last and covered > left:
        # The next cut on the way from the viewer.
        high, low = low, last
        if abs(ex) > NEAREST:
            low = max(low, min((view_rays.next_cut(x0 + high * ex, ex < 0.0, warp_radius) - x0) / ex, high - NEAREST))
        if abs(ey) > NEAREST:
            low = max(low, min((view_rays.next_cut(y0 + high * ey, ey < 0.0, weft_radius) - y0) / ey, high - NEAREST))
        in_x, in_y = x0 + 0.5 * (low + high) * ex, y0 + 0.5 * (low + high) * ey
        column, row = math.floor(in_x), math.floor(in_y)
        # Of whole numbers: a quotient of floats is rounded, and integer division is slow.
        repeats_x, repeats_y = math.floor((column + 0.5) * per_ends), math.floor((row + 0.5) * per_picks)
        cell = int((row - picks * repeats_y) * ends + column - ends * repeats_x)
        p = view_rays.piece_at(table, cell, np.float32(in_x - column), np.float32(in_y - row))
        if p < 0 or high - low < 2.0 * NEAREST:
            continue
        family, first, bounds = table.pieces[p, nodes.FAMILY], table.pieces[p, nodes.BLOCK] * per_grid, table.bounds[p]
        if family == GAP:
            q_low, q_high = max(low - of_gap, left), min(high - of_gap, right, covered)
            covered = min(covered, low - of_gap)
            if q_high > q_low:
                q = 0.5 * (q_low + q_high)
                share = view_line.density * (q_high - q_low) * math.exp(-0.5 * (q / sigma) ** 2)
                at_x, at_y = np.float32(x0 + (q + of_gap) * ex - column), np.float32(y0 + (q + of_gap) * ey - row)
                at = first + view_rays.in_grid(bounds, family, _HALF, at_x, at_y, size)
                through = float(_gap_seen(scratch, look, at, size * size))
                gaps += share * through
                stopped += share * (1.0 - through)
            continue
        if low - view_rays.sunk(ray, table.crowns[p])[0] >= min(covered, right):
            continue
        curve = view_rays.curve_of(table, p, ray, x0 - column, y0 - row)
        piece = Piece(curve, bounds, family, first, size)
        wall_to, begin, end, before = min(covered, right), low, high, covered
        if rising:
            begin, end = view_rays.reached(curve, ray, low, high)
            if end <= begin:
                continue
            wall_to = min(wall_to, view_rays.seen_rising(curve, ray, high)[0]) if end == high else -NEVER
        start, stop, seen, covered, wall_from = view_rays.seen_interval(curve, ray, begin, end, sigma, covered)
        kind = column % of_warp if family == WARP else of_warp + row % of_weft
        k, wall_from = stops[kind], max(wall_from, left)
        if table.rims and wall_to - wall_from > NEAREST and k < limit:
            rim = stopped + view_line.density * _under_bell(wall_from / sigma, wall_to / sigma) * sigma
            of_rim, stopped = ViewLine(x0, y0, rim, sigma, view_line.apart), 0.0
            _write_draft(scratch, kind, k, high, high, 1, piece, of_rim)
            k += 1
            stops[kind] = k
        if rising:
            k = _write_meetings(scratch, kind, k, ray, view_line, piece, start, stop, False)
            crest = view_rays.rising_crest(curve, ray, begin, end)
            start, stop = view_rays.rising_interval(curve, ray, crest, end, left, min(before, right))
            k = _write_meetings(scratch, kind, k, ray, view_line, piece, start, stop, True)
            # Of rays that cleared the last piece, this one stops some, or it opens a new slit above it.
            cleared = max(view_rays.seen_rising(curve, ray, crest)[0], view_rays.seen_at(curve, ray, end)[0])
            if cleared < before:
                slit_from, slit_to = cleared, before
            elif slit_to > slit_from:
                start, stop = view_rays.rising_interval(
                    curve, ray, crest, end, max(slit_from, left), min(slit_to, right)
                )
                k = _write_meetings(scratch, kind, k, ray, view_line, piece, start, stop, True)
                slit_from = max(slit_from, cleared)
            stops[kind] = k
            continue
        # Nodes of no length would count as a rim.
        if stop - start < NEAREST or k >= limit:
            continue
        count = 1 + int(max((stop - start + NEAREST) / _LENGTH, seen / (_DEVIATIONS * sigma)) / table.spacing)
        count = min(count, MOST_GAUSS)
        _write_draft(scratch, kind, k, start, stop, count, piece, view_line)
        stops[kind] = k + count
    return gaps


@inlined_fast_kernel
def _place(table: SoftNodeTable, scratch: Scratch, look: SoftQuery, ray: ViewRay) -> tuple[np.float32, np.float32]:
    """Place the nodes of a footprint of rays; return the area seen through gaps, and 1 / deviation along lines."""
    # Weights are shares of the footprint in the fabric plane, which A(wo) turns into shares of its rays.
    scratch.stops[:] = 0
    xx, yy, xy = look.dx * look.dx, look.dy * look.dy, look.rho * look.dx * look.dy
    ex, ey, lines, gaps = ray.dx, ray.dy, scratch.view_lines, 0.0
    # Deviation across the azimuth; drift and deviation along it, given the place across.
    across = math.sqrt(xx * ey * ey + yy * ex * ex - 2.0 * xy * ex * ey)
    drift = (ex * ey * (yy - xx) + xy * (ex * ex - ey * ey)) / (across * across)
    sigma = math.sqrt(float(max(xx * yy - xy * xy, np.float32(0.0)))) / across
    radii = table.heights[WARP, RADIUS], table.heights[WEFT, RADIUS]
    reach = 2.0 * FOOTPRINT_ENDS * sigma
    for j in range(_lines_across(ray, look.x, look.y, across, radii, reach, table.spacing, lines)):
        w, apart = lines[0, j], lines[1, j]
        density = apart / (2.0 * math.pi * across * sigma) * math.exp(-0.5 * (w / across) ** 2)
        x, y = look.x - w * ey + drift * w * ex, look.y + w * ex + drift * w * ey
        gaps += _place_line(table, scratch, look, ray, ViewLine(x, y, density, sigma, apart))
    for kind in range(len(scratch.stops)):
        if scratch.stops[kind] > 0:
            scratch.stops[kind] = _fill_block(scratch.drafts[kind], scratch.firsts[kind], scratch.stops[kind])
    return np.float32(gaps) * look.oz, np.float32(1.0 / sigma)


@inlined_kernel
def sum_view_lines(table: SoftNodeTable, scratch: Scratch, look: SoftQuery, again: bool, result: Float32) -> np.float32:
    """Write the sums of a footprint of view rays (K, NODE_SUMS), and return the area seen through gaps.

    With `again` the last query was of the same place: its nodes are there.
    """
    run = np.hypot(look.ox, look.oy)
    dx, dy = (look.ox / run, look.oy / run) if run > _FROM_ABOVE else (_1, _0)
    run = run / look.oz
    bend, least = float(look.bend_o), table.lowest
    if bend > 0.0 and run > _FROM_ABOVE:
        least = max(least, table.plane - _JUST / (bend * float(run) ** 2))
    ray = ViewRay(float(dx), float(dy), float(run), bend, table.plane, least)
    if not again:
        scratch.gaps[:] = _place(table, scratch, look, ray)
    inverse = scratch.gaps[1]
    rays = LineRays(run, np.float32(table.plane), np.float32(2.0) * look.bend_o * run * run, inverse)
    back, of_warp, size = look.iz < _0, table.kinds[0], table.grid.shape[2]
    grid = scratch.behind_grid if back else scratch.grid
    low, high = np.uint32(look.low_i * size * size), np.uint32(look.high_i * size * size)
    light = GridHorizons(grid, size, low, high, look.turn_i)
    sharp, thickness = sharpness_of_points(min(look.narrowest, _BOX)), np.float32(table.thickness)
    bent = scratch.grid_falls, bend_of(look.bend_i)
    for kind in range(len(result)):
        count = scratch.stops[kind]
        if count == 0:
            continue
        family = 0 if kind < of_warp else 1
        d = directions(look.ix, look.iy, look.iz, look.ox, look.oy, look.oz, family)
        draft, firsts, yarn, own = scratch.drafts[kind], scratch.firsts[kind, :count], table.yarn[family], result[kind]
        if back:
            hidden = bool(table.heights[1 - family, RADIUS] >= 0.5)  # no gap beside the crossing yarn
            sums = shade_lines(draft, firsts, rays, light, None, sharp, d, yarn, family, thickness, True, hidden)
        elif look.bend_i > _0:
            sums = shade_lines(draft, firsts, rays, light, bent, sharp, d, yarn, family, thickness, None)
        else:
            sums = shade_lines(draft, firsts, rays, light, None, sharp, d, yarn, family, thickness, None)
        write_sums(sums, own)
    return np.float32(scratch.gaps[0])
