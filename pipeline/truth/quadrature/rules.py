"""Smooth parts of a patch and their Gauss-Legendre rules, whose lines are cut where light or view is lost.

Floats on top, strips of the yarn beneath where the one on top is narrow, and gaps cover one repeat once. Footprints are
folded: a position represents all its images. A kernel that is narrow against a rectangle cuts it further, so that a
rule of few nodes resolves it. The integrand jumps at shadow edges and bends where the yarn turns away from the light or
the viewer, which it does along its edges under any slanted direction, shadows or not. Where a grid of nodes meets such
edges, its lines in the direction that crosses more of them are cut at each, found by bisection, and every piece of a
line gets a rule of its own. The integrand of the other direction is then smooth wherever edges run across the lines.

A footprint of view rays has its density where the ray to a point of the yarn crosses the reference plane: a point of
height h at p counts as p - (h - z0) wo_xy / wo_z. All that is seen is integrated so; walls are left out.
"""

import math
from typing import Final, NamedTuple

import numpy as np

from pipeline.compiled.arrays import Float64, Index, Mask
from pipeline.compiled.decorators import allocating_kernel, kernel
from pipeline.truth.cloth import AREA_SUM, POINT_SUMS, ClothSide
from pipeline.truth.footprint.place import BOX_SIDE, GAUSSIAN, Axis, folded_box
from pipeline.truth.geometry import heightfield
from pipeline.truth.geometry.heightfield import GAP, RADIUS, TOP, UNDER, WARP, WEFT, HeightField
from pipeline.truth.scattering.point import Directions, point_share

_REACH: Final = 5.5
_RESOLVED: Final = 3.0  # widest part in standard deviations: 8 nodes give its mass to 1e-7
CUTS: Final = 64
"""Most pieces that a rectangle is cut into along an axis. View rays at grazing angles may ask for more."""

# Columns of a part: limits across (the angle v; at gaps x) and along, whose yarn, its middle and half width, the box's
# weight, the larger of the angles that the surface turns by across and along, over the roughness, and its share of the
# footprint, which is 1 for all parts together.
A0, A1, B0, B1, KIND, MIDDLE, HALF, BOX_WEIGHT, TURNING, MASS = range(10)
PART: Final = 10


@allocating_kernel
def rectangles(field: HeightField, wanted_cells: Mask) -> Float64:
    """Return the rectangles on which the fabric is smooth, (P, 6), that begin in the cells wanted.

    Columns: x from, x to, y from, y to, WARP, WEFT or GAP, and the yarn's turn for each unit along it, in radians.
    Together they cover one repeat once, up to whole repeats: x and y lie in [0, 2 ends] and [0, 2 picks].
    """
    picks, ends = field.top.shape
    found = np.zeros((4 * picks * ends, 6))
    count = 0
    for pick in range(picks):
        for end in range(ends):
            if not wanted_cells[pick, end]:
                continue
            for side in (TOP, UNDER):
                family = int(field.top[pick, end]) if side == TOP else 1 - int(field.top[pick, end])
                radius, margin = field.yarn[family, RADIUS], 0.5 - field.yarn[1 - family, RADIUS]
                own = field.floats[pick, end, side]
                half, offset = own[heightfield.HALF_LENGTH], own[heightfield.OFFSET]
                middle = (end if family == WARP else pick) + 0.5
                cell = float(pick if family == WARP else end)
                # A yarn that never changes side has floats without end: it is cut at the cells.
                first = half == math.inf or offset < 0.75 - half
                last = half == math.inf or offset > half - 0.75
                for strip in range(2):
                    if side == TOP:
                        low, high = cell, cell + (1.0 if half == math.inf else 2.0 * half)
                        wanted = first and strip == 0
                    elif strip == 0:
                        low, high = cell, cell + margin
                        wanted = first and margin > 0.0
                    else:
                        low, high = cell + 1.0 - margin, cell + 1.0 + (0.0 if last else margin)
                        wanted = margin > 0.0
                    if wanted:
                        at = 0 if family == WARP else 2
                        found[count, at], found[count, at + 1] = middle - radius, middle + radius
                        found[count, 2 - at], found[count, 3 - at] = low, high
                        found[count, 4] = family
                        if own[heightfield.BEND_RADIUS] > 0.0:
                            found[count, 5] = field.yarn[family, heightfield.BEND] / half
                        count += 1
            width, height = 0.5 - field.yarn[WARP, RADIUS], 0.5 - field.yarn[WEFT, RADIUS]
            if width > 0.0 and height > 0.0:
                found[count, 0], found[count, 1] = end + 1.0 - width, end + 1.0 + width
                found[count, 2], found[count, 3] = pick + 1.0 - height, pick + 1.0 + height
                found[count, 4] = GAP
                count += 1
    return found[:count]


@kernel
def density(axis: Axis, x: float) -> float:
    """Return the folded Gaussian at x, of mass 1 a repeat; 1 for a box, whose parts carry their weight."""
    if axis.shape != GAUSSIAN:
        return 1.0
    away = (x - axis.centre) / axis.repeat
    away -= math.floor(away + 0.5)
    share = axis.sigma / axis.repeat
    total = 0.0
    if share < 0.3:
        for image in range(-2, 3):
            distance = (away + image) / share
            total += math.exp(-0.5 * distance * distance)
        return total / (math.sqrt(2.0 * math.pi) * axis.sigma)
    for k in range(1, 4):
        total += math.exp(-2.0 * (math.pi * share * k) ** 2) * math.cos(2.0 * math.pi * k * away)
    return max(1.0 + 2.0 * total, 0.0) / axis.repeat


class Lean(NamedTuple):
    """How far view rays lead along x or y: by how much for each unit of height, at least and at most over the cloth."""

    slope: float
    least: float
    most: float


@kernel
def lean_of(cloth: ClothSide, towards: float, cosine: float) -> Lean:
    """Return the lean of view rays of a direction: its component along an axis, and its cosine; 0 without parallax."""
    slope = towards / cosine if cloth.parallax else 0.0
    highest, lowest = cloth.front.highest - cloth.plane, cloth.front.lowest - cloth.plane
    return Lean(slope, min(slope * highest, slope * lowest), max(slope * highest, slope * lowest))


@kernel
def _cut(axis: Axis, lean: Lean, low: float, high: float, pieces: Float64) -> int:
    """Write the pieces of [low, high] that the footprint reaches, (from, to, weight); return their number."""
    count = 0
    if axis.shape == GAUSSIAN:
        before, after = _REACH * axis.sigma - lean.least, _REACH * axis.sigma + lean.most
        # From half a repeat on, images meet: the folded kernel is taken everywhere.
        everywhere = before + after >= axis.repeat
        first = 0.0 if everywhere else math.ceil((low - axis.centre - after) / axis.repeat)
        last = 0.0 if everywhere else math.floor((high - axis.centre + before) / axis.repeat)
        image = first
        while image <= last:
            middle = axis.centre + image * axis.repeat
            start = low if everywhere else max(low, middle - before)
            stop = high if everywhere else min(high, middle + after)
            # On a round yarn a ray's place changes by up to sqrt(1 + slope^2) times the arc.
            number = math.ceil((stop - start) * math.sqrt(1.0 + lean.slope**2) / (_RESOLVED * axis.sigma))
            number = min(number, CUTS // max(1, int(last - first) + 1))
            for k in range(number):
                pieces[count, 0] = start + (stop - start) * k / number
                pieces[count, 1] = start + (stop - start) * (k + 1) / number
                pieces[count, 2] = 1.0
                count += 1
            image += 1.0
        return count
    side = BOX_SIDE * axis.sigma
    whole, reach, centre = folded_box(axis)
    image = float(math.ceil((low - centre - reach) / axis.repeat))
    last = math.floor((high - centre + reach) / axis.repeat)
    cursor = low
    while True:
        middle = centre + image * axis.repeat
        start = min(max(middle - reach, low), high) if image <= last else high
        stop = min(max(middle + reach, low), high) if image <= last else high
        for begin, finish, weight in ((cursor, start, whole), (start, stop, whole + 1.0)):
            if weight > 0.0 and finish > begin:
                pieces[count, 0], pieces[count, 1], pieces[count, 2] = begin, finish, weight / side
                count += 1
        cursor = stop
        if image > last:
            return count
        image += 1.0


@kernel
def _mass(axis: Axis, lean: Lean, low: float, high: float) -> float:
    """Return the integral of `density`, over heights that of a wider kernel, by Simpson's rule: 4 % off at worst."""
    centre, sigma = axis.centre + 0.5 * (lean.least + lean.most), axis.sigma + 0.25 * (lean.most - lean.least)
    wider, middle = Axis(axis.shape, centre, sigma, axis.repeat), 0.5 * (low + high)
    return (high - low) / 6.0 * (density(wider, low) + 4.0 * density(wider, middle) + density(wider, high))


class QueryPatch(NamedTuple):
    """A query's patch of one side of a cloth."""

    cloth: ClothSide
    directions: Directions
    x: Axis
    y: Axis
    x_lean: Lean
    y_lean: Lean


@kernel
def cut_parts(patch: QueryPatch, rectangle: Float64, across: Float64, along: Float64, parts: Float64) -> int:
    """Write the parts of a rectangle that the footprint reaches if `parts` has rows; return their number.

    `across` and `along` are scratch: what is cut along each axis of the yarn.
    """
    x_axis, y_axis, x_lean, y_lean = patch.x, patch.y, patch.x_lean, patch.y_lean
    first, second, at = (y_axis, x_axis, 2) if rectangle[4] == WEFT else (x_axis, y_axis, 0)
    first_lean, second_lean = (y_lean, x_lean) if rectangle[4] == WEFT else (x_lean, y_lean)
    low, high = rectangle[at], rectangle[at + 1]
    columns = _cut(first, first_lean, low, high, across)
    rows = _cut(second, second_lean, rectangle[2 - at], rectangle[3 - at], along) if columns > 0 else 0
    if len(parts) > 0:
        middle, half = 0.5 * (low + high), 0.5 * (high - low)
        for k in range(columns):
            from_, to = across[k, 0], across[k, 1]
            if rectangle[4] != GAP:
                from_ = math.asin(min(max((from_ - middle) / half, -1.0), 1.0))
                to = math.asin(min(max((to - middle) / half, -1.0), 1.0))
            for n in range(rows):
                part = parts[k * rows + n]
                part[A0], part[A1], part[B0], part[B1] = from_, to, along[n, 0], along[n, 1]
                part[KIND], part[MIDDLE], part[HALF] = rectangle[4], middle, half
                part[BOX_WEIGHT] = across[k, 2] * along[n, 2]
                x, y = (along[n], across[k]) if rectangle[4] == WEFT else (across[k], along[n])
                part[MASS] = part[BOX_WEIGHT] * _mass(x_axis, x_lean, x[0], x[1]) * _mass(y_axis, y_lean, y[0], y[1])
                if rectangle[4] != GAP:
                    turn = max(to - from_, rectangle[5] * (along[n, 1] - along[n, 0]))
                    part[TURNING] = turn / patch.cloth.front.yarn[int(rectangle[4]), heightfield.ALPHA]
    return columns * rows


_BISECTIONS: Final = 8
RULES: Final = 6  # number of rules; level l has 2^(l + 1) nodes an axis

_RULES: Final = [np.polynomial.legendre.leggauss(2 << level) for level in range(RULES)]
_NODES: Final = np.concatenate([nodes for nodes, _ in _RULES])  # rule of 2^(l + 1) nodes from 2^(l + 1) - 2 on
_WEIGHTS: Final = np.concatenate([weights for _, weights in _RULES])


@kernel
def _shares(patch: QueryPatch, part: Float64, a: float, b: float, shares: Float64) -> int:
    """Write the shares of a point of a part in the sums; return which of viewer, light and back it sees, as bits."""
    cloth, directions = patch.cloth, patch.directions
    picks, ends = cloth.front.top.shape
    across = a if part[KIND] == GAP else part[MIDDLE] + part[HALF] * math.sin(a)
    x, y = (b, across) if part[KIND] == WEFT else (across, b)
    x = x - ends if x >= ends else x
    y = y - picks if y >= picks else y
    family, area, specular, diffuse, through = point_share(cloth.front, cloth.back, x, y, directions, cloth.choices)
    above = 0.0
    if cloth.parallax:
        above = heightfield.surface_at(cloth.front, x, y, int(x), int(y))[2] - cloth.plane
    weight = density(patch.x, x - patch.x_lean.slope * above) * density(patch.y, y - patch.y_lean.slope * above)
    if part[KIND] != GAP:
        weight *= part[HALF] * math.cos(a)
    shares[:] = 0.0
    if family != GAP:
        shares[family], shares[2 + family] = weight * specular, weight * diffuse
    shares[4] = weight * through
    shares[AREA_SUM] = weight * (directions.viewer.z if cloth.projected else area)
    state = 1 if area > 0.0 else 0
    if specular + diffuse > 0.0:
        state += 2
    if family == GAP and through > 0.0:
        state += 4
    return state


@allocating_kernel
def integrate(
    patch: QueryPatch, part: Float64, level: int, split: int, grid: Float64, states: Index, sums: Float64
) -> int:
    """Write the sums over a part with 2^(level + 1) nodes an axis; return the points used."""
    n, rule = 2 << level, (2 << level) - 2
    half_a, half_b = 0.5 * (part[A1] - part[A0]), 0.5 * (part[B1] - part[B0])
    mid_a, mid_b = 0.5 * (part[A1] + part[A0]), 0.5 * (part[B1] + part[B0])
    for i in range(n):
        for j in range(n):
            a, b = mid_a + half_a * _NODES[rule + i], mid_b + half_b * _NODES[rule + j]
            states[i, j] = _shares(patch, part, a, b, grid[i, j])
    used = n * n

    # Lines run in the direction that crosses more edges.
    crossed_a, crossed_b = 0, 0
    for i in range(n):
        for j in range(n):
            crossed_a += i > 0 and states[i, j] != states[i - 1, j]
            crossed_b += j > 0 and states[i, j] != states[i, j - 1]
    inner_a = crossed_a >= crossed_b
    sums[:] = 0.0
    line, point = np.zeros(POINT_SUMS), np.zeros(POINT_SUMS)
    middle, half = (mid_a, half_a) if inner_a else (mid_b, half_b)
    mid_outer, half_outer = (mid_b, half_b) if inner_a else (mid_a, half_a)
    for k in range(n):
        fixed, outer = mid_outer + half_outer * _NODES[rule + k], half_outer * _WEIGHTS[rule + k]
        line[:] = 0.0
        begin, first = middle - half, 0
        for m in range(1, n + 1):
            before = states[m - 1, k] if inner_a else states[k, m - 1]
            if m < n and (level < split or (states[m, k] if inner_a else states[k, m]) == before):
                continue
            finish = middle + half
            if m < n:
                low, high = middle + half * _NODES[rule + m - 1], middle + half * _NODES[rule + m]
                for _ in range(_BISECTIONS):
                    centre = 0.5 * (low + high)
                    a, b = (centre, fixed) if inner_a else (fixed, centre)
                    if _shares(patch, part, a, b, point) == before:
                        low = centre
                    else:
                        high = centre
                used += _BISECTIONS
                finish = 0.5 * (low + high)
            if m == n and first == 0:
                # No edge: the grid's own nodes serve.
                for i in range(n):
                    line += half * _WEIGHTS[rule + i] * (grid[i, k] if inner_a else grid[k, i])
            elif before != 0 or patch.cloth.projected:
                size = 2
                while size < m - first:
                    size *= 2
                for i in range(size - 2, 2 * size - 2):
                    t = 0.5 * (begin + finish) + 0.5 * (finish - begin) * _NODES[i]
                    a, b = (t, fixed) if inner_a else (fixed, t)
                    _shares(patch, part, a, b, point)
                    line += 0.5 * (finish - begin) * _WEIGHTS[i] * point
                used += size
            begin, first = finish, m
        sums += outer * line
    sums *= part[BOX_WEIGHT]
    return used
