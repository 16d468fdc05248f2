"""Patches integrated without random numbers: Gauss-Legendre rules on every float that the footprint reaches.

The fabric is cut into the rectangles on which its surface is smooth: floats on top, strips of the yarn beneath, gaps.
Across a yarn the nodes are taken in the angle v, x = r sin v, which turns the vertical tangent at its edge into nothing
special. A rectangle is clipped to the footprint and cut again where the kernel is narrow against it; on what is left,
a part, the integrand is analytic up to shadow edges, so the rule converges spectrally without shadows. Where a grid
meets edges, its lines in the direction that crosses more of them are cut at each edge, found by bisection, and every
piece of a line gets a rule of its own [Davis1984Integration].

Each part doubles its nodes per axis on its own, the worst first. Its error is taken to be its last change, an
overestimate of what is left; parts add up as if their errors all had one sign, or none, whichever is more.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from pipeline.truth.cloth import AREA, SUMS, Columns, Model
from pipeline.truth.footprint import BOX_SIDE, GAUSSIAN
from pipeline.truth.heightfield import GAP, HALF_LENGTH, OFFSET, RADIUS, TOP, UNDER, WARP, WEFT, HeightField
from pipeline.truth.kernel import kernel
from pipeline.truth.options import TruthOptions
from pipeline.truth.patch import Scene, point_share
from pipeline.truth.replicates import OWEN, query_scene, sample_rows

Floats = npt.NDArray[np.float64]
Raw = tuple[Floats, Floats, npt.NDArray[np.int64]]

SAFETY: Final = 1.0
"""Times the last change that the reported error is."""

_FLOOR: Final = 1e-6  # least reported error as a share of the mean: footprints are cut at 5.5 sigma, 4e-8 of their mass
_REACH: Final = 5.5
_RESOLVED: Final = 3.0  # widest part in standard deviations: 8 nodes give its mass to 1e-7
_FIRST: Final = 0  # level of the first rule
_BISECTIONS: Final = 10

_COUNTS: Final = (2, 4, 8, 16, 32, 64)
_RULES: Final = [np.polynomial.legendre.leggauss(count) for count in _COUNTS]
_NODES: Final = np.concatenate([nodes for nodes, _ in _RULES])  # rule of 2^(l + 1) nodes from 2^(l + 1) - 2 on
_WEIGHTS: Final = np.concatenate([weights for _, weights in _RULES])

# Columns of a part: limits across (an angle) and along, whose yarn, its middle and half width, the box's weight.
_A0, _A1, _B0, _B1, _KIND, _MIDDLE, _HALF, _BOX_WEIGHT = range(8)


class Axis(NamedTuple):
    """A footprint along x or y: kernel, centre, standard deviation, and the repeat it is folded into."""

    shape: int
    centre: float
    sigma: float
    repeat: float


@kernel
def rectangles(field: HeightField) -> Floats:
    """Return the rectangles on which the fabric is smooth, (P, 5): x from, x to, y from, y to, WARP, WEFT or GAP.

    They cover one repeat once, up to whole repeats: x and y lie in [0, 2 ends] and [0, 2 picks].
    """
    picks, ends = field.top.shape
    found = np.zeros((4 * picks * ends, 5))
    count = 0
    for pick in range(picks):
        for end in range(ends):
            for side in (TOP, UNDER):
                family = int(field.top[pick, end]) if side == TOP else 1 - int(field.top[pick, end])
                radius, margin = field.yarn[family, RADIUS], 0.5 - field.yarn[1 - family, RADIUS]
                half, offset = field.floats[pick, end, side, HALF_LENGTH], field.floats[pick, end, side, OFFSET]
                middle = (end if family == WARP else pick) + 0.5
                cell = float(pick if family == WARP else end)
                # A yarn that never changes side is cut at the cells, whose gloss may differ.
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
                        count += 1
            width, height = 0.5 - field.yarn[WARP, RADIUS], 0.5 - field.yarn[WEFT, RADIUS]
            if width > 0.0 and height > 0.0:
                found[count, 0], found[count, 1] = end + 1.0 - width, end + 1.0 + width
                found[count, 2], found[count, 3] = pick + 1.0 - height, pick + 1.0 + height
                found[count, 4] = GAP
                count += 1
    return found[:count]


@kernel
def _density(axis: Axis, x: float) -> float:
    """Return the folded Gaussian at x, up to a factor; 1 for a box, whose parts carry their weight."""
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
        return total / share
    for k in range(1, 4):
        total += math.exp(-2.0 * (math.pi * share * k) ** 2) * math.cos(2.0 * math.pi * k * away)
    return math.sqrt(2.0 * math.pi) * max(1.0 + 2.0 * total, 0.0)


@kernel
def _cut(axis: Axis, low: float, high: float, pieces: Floats) -> int:
    """Write the pieces of [low, high] that the footprint reaches, (from, to, weight); return their number."""
    count = 0
    if axis.shape == GAUSSIAN:
        reach = _REACH * axis.sigma
        # From half a repeat on, images meet: the folded kernel is taken everywhere.
        everywhere = reach >= 0.5 * axis.repeat
        first = 0.0 if everywhere else math.ceil((low - axis.centre - reach) / axis.repeat)
        last = 0.0 if everywhere else math.floor((high - axis.centre + reach) / axis.repeat)
        image = first
        while image <= last:
            middle = axis.centre + image * axis.repeat
            start = low if everywhere else max(low, middle - reach)
            stop = high if everywhere else min(high, middle + reach)
            number = math.ceil((stop - start) / (_RESOLVED * axis.sigma))
            for k in range(number):
                pieces[count, 0] = start + (stop - start) * k / number
                pieces[count, 1] = start + (stop - start) * (k + 1) / number
                pieces[count, 2] = 1.0
                count += 1
            image += 1.0
        return count
    # So many whole repeats everywhere, and one more around the centre, or opposite it.
    side = BOX_SIDE * axis.sigma
    whole = float(math.floor(side / axis.repeat))
    reach = 0.5 * (side - whole * axis.repeat)
    centre = axis.centre + (0.5 * axis.repeat if whole % 2.0 == 1.0 else 0.0)
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
def _parts(rectangle: Floats, x_axis: Axis, y_axis: Axis, x_pieces: Floats, y_pieces: Floats, parts: Floats) -> int:
    """Write the parts of a rectangle that the footprint reaches if `parts` has rows; return their number."""
    across_x = rectangle[4] != WEFT
    if across_x:
        columns = _cut(x_axis, rectangle[0], rectangle[1], x_pieces)
        rows = _cut(y_axis, rectangle[2], rectangle[3], y_pieces) if columns > 0 else 0
        low, high, across, along = rectangle[0], rectangle[1], x_pieces, y_pieces
    else:
        columns = _cut(y_axis, rectangle[2], rectangle[3], x_pieces)
        rows = _cut(x_axis, rectangle[0], rectangle[1], y_pieces) if columns > 0 else 0
        low, high, across, along = rectangle[2], rectangle[3], x_pieces, y_pieces
    if len(parts) > 0:
        middle, half = 0.5 * (low + high), 0.5 * (high - low)
        for k in range(columns):
            from_, to = across[k, 0], across[k, 1]
            if rectangle[4] != GAP:
                from_ = math.asin(min(max((from_ - middle) / half, -1.0), 1.0))
                to = math.asin(min(max((to - middle) / half, -1.0), 1.0))
            for n in range(rows):
                part = parts[k * rows + n]
                part[_A0], part[_A1], part[_B0], part[_B1] = from_, to, along[n, 0], along[n, 1]
                part[_KIND], part[_MIDDLE], part[_HALF] = rectangle[4], middle, half
                part[_BOX_WEIGHT] = across[k, 2] * along[n, 2]
    return columns * rows


@kernel
def _weight_across(part: Floats, axis: Axis, a: float) -> float:
    """Return kernel times length for each unit of the coordinate across."""
    if part[_KIND] == GAP:
        return _density(axis, a)
    return part[_HALF] * math.cos(a) * _density(axis, part[_MIDDLE] + part[_HALF] * math.sin(a))


@kernel
def _shares(model: Model, query: Scene, part: Floats, a: float, b: float, shares: Floats) -> int:
    """Write what a point of a part adds to the sums; return which of viewer, light and back it sees, as bits."""
    picks, ends = model.front.top.shape
    across = a if part[_KIND] == GAP else part[_MIDDLE] + part[_HALF] * math.sin(a)
    x, y = (b, across) if part[_KIND] == WEFT else (across, b)
    x = x - ends if x >= ends else x
    y = y - picks if y >= picks else y
    family, area, specular, diffuse, through = point_share(model.front, model.back, x, y, query, model.choices)
    shares[:] = 0.0
    if family != GAP:
        shares[family], shares[2 + family] = specular, diffuse
    shares[4] = through
    shares[AREA] = query.viewer.z if model.projected else area
    state = 1 if area > 0.0 else 0
    if specular + diffuse > 0.0:
        state += 2
    if family == GAP and through > 0.0:
        state += 4
    return state


@kernel
def _integrate(
    model: Model, query: Scene, part: Floats, x_axis: Axis, y_axis: Axis, level: int, split: bool,
    grid: Floats, states: npt.NDArray[np.int64], sums: Floats,
) -> int:
    """Write the sums over a part with 2^(level + 1) nodes an axis; return the points used."""
    n, rule = 2 << level, (2 << level) - 2
    across, along = (y_axis, x_axis) if part[_KIND] == WEFT else (x_axis, y_axis)
    half_a, half_b = 0.5 * (part[_A1] - part[_A0]), 0.5 * (part[_B1] - part[_B0])
    mid_a, mid_b = 0.5 * (part[_A1] + part[_A0]), 0.5 * (part[_B1] + part[_B0])
    for i in range(n):
        for j in range(n):
            a, b = mid_a + half_a * _NODES[rule + i], mid_b + half_b * _NODES[rule + j]
            states[i, j] = _shares(model, query, part, a, b, grid[i, j])
    used = n * n

    # Lines run in the direction that crosses more edges.
    crossed_a, crossed_b = 0, 0
    for i in range(n):
        for j in range(n):
            crossed_a += i > 0 and states[i, j] != states[i - 1, j]
            crossed_b += j > 0 and states[i, j] != states[i, j - 1]
    inner_a = crossed_a >= crossed_b
    sums[:] = 0.0
    line, point = np.zeros(SUMS), np.zeros(SUMS)
    middle, half = (mid_a, half_a) if inner_a else (mid_b, half_b)
    for k in range(n):
        if inner_a:
            fixed = mid_b + half_b * _NODES[rule + k]
            outer = half_b * _WEIGHTS[rule + k] * _density(along, fixed)
        else:
            fixed = mid_a + half_a * _NODES[rule + k]
            outer = half_a * _WEIGHTS[rule + k] * _weight_across(part, across, fixed)
        line[:] = 0.0
        begin, first = middle - half, 0
        for m in range(1, n + 1):
            before = states[m - 1, k] if inner_a else states[k, m - 1]
            if m < n and (not split or (states[m, k] if inner_a else states[k, m]) == before):
                continue
            finish = middle + half
            if m < n:
                low, high = middle + half * _NODES[rule + m - 1], middle + half * _NODES[rule + m]
                for _ in range(_BISECTIONS):
                    centre = 0.5 * (low + high)
                    a, b = (centre, fixed) if inner_a else (fixed, centre)
                    if _shares(model, query, part, a, b, point) == before:
                        low = centre
                    else:
                        high = centre
                used += _BISECTIONS
                finish = 0.5 * (low + high)
            if m == n and first == 0:
                # No edge: the grid's own nodes serve.
                for i in range(n):
                    t = middle + half * _NODES[rule + i]
                    weight = half * _WEIGHTS[rule + i]
                    weight *= _weight_across(part, across, t) if inner_a else _density(along, t)
                    line += weight * (grid[i, k] if inner_a else grid[k, i])
            elif before != 0 or model.projected:
                size = 2
                while size < m - first:
                    size *= 2
                for i in range(size - 2, 2 * size - 2):
                    t = 0.5 * (begin + finish) + 0.5 * (finish - begin) * _NODES[i]
                    weight = 0.5 * (finish - begin) * _WEIGHTS[i]
                    weight *= _weight_across(part, across, t) if inner_a else _density(along, t)
                    a, b = (t, fixed) if inner_a else (fixed, t)
                    _shares(model, query, part, a, b, point)
                    line += weight * point
                used += size
            begin, first = finish, m
        sums += outer * line
    sums *= part[_BOX_WEIGHT]
    return used


@kernel
def integrate_rows(
    model: Model, columns: Columns, relative_error: float, min_count: int, max_count: int, split: bool, top: int,
    lowest: int,
) -> Raw:
    """Answer every row; all footprints have axes along x and y.

    Parameters
    ----------
    model, columns : Model, Columns
        The cloth and the queries.
    relative_error, min_count, max_count
        As in `TruthOptions`.
    split : bool
        Whether lines are cut at shadow edges.
    top, lowest : int
        Greatest and first level.
    """
    rows = len(columns.u)
    means, errors = np.zeros((rows, AREA)), np.zeros((rows, AREA))
    counts = np.zeros(rows, np.int64)
    picks, ends = model.front.top.shape
    pieces = rectangles(model.front)
    x_pieces, y_pieces = np.zeros((32, 3)), np.zeros((32, 3))
    grid, states = np.zeros((64, 64, SUMS)), np.zeros((64, 64), np.int64)
    for row in range(rows):
        query = query_scene(columns, row)
        sigma_x, sigma_y = columns.sigma[row], columns.sigma_minor[row]
        if sigma_x != sigma_y and abs(math.cos(columns.angle[row])) < 0.5:
            sigma_x, sigma_y = sigma_y, sigma_x
        x_axis = Axis(model.shape, columns.u[row], sigma_x, float(ends))
        y_axis = Axis(model.shape, columns.v[row], sigma_y, float(picks))
        total = 0
        for p in range(len(pieces)):
            total += _parts(pieces[p], x_axis, y_axis, x_pieces, y_pieces, np.zeros((0, 8)))
        parts = np.zeros((total, 8))
        total = 0
        for p in range(len(pieces)):
            total += _parts(pieces[p], x_axis, y_axis, x_pieces, y_pieces, parts[total:])

        # Two rules on every part, for a first change.
        sums, changes, levels = np.zeros((total, SUMS)), np.zeros((total, SUMS)), np.zeros(total, np.int64)
        costs, badness = np.zeros(total, np.int64), np.zeros(total)
        for p in range(total):
            counts[row] += _integrate(
                model, query, parts[p], x_axis, y_axis, lowest, split, grid, states, changes[p]
            )
            levels[p] = lowest
        cut = -1.0
        while True:
            refined = False
            for p in range(total):
                fits = levels[p] == lowest or counts[row] + 4 * costs[p] <= max_count
                if badness[p] >= cut and levels[p] < top and fits:
                    if levels[p] > lowest:
                        changes[p] = sums[p]
                    levels[p] += 1
                    costs[p] = _integrate(
                        model, query, parts[p], x_axis, y_axis, levels[p], split, grid, states, sums[p]
                    )
                    changes[p] = sums[p] - changes[p]
                    counts[row] += costs[p]
                    refined = True
            worst, reached = _judge(sums, changes, means[row], errors[row], badness, relative_error)
            if not refined or (reached and counts[row] >= min_count):
                break
            cut = 0.0625 * worst
    return means, errors, counts


@kernel
def _judge(
    sums: Floats, changes: Floats, mean: Floats, error: Floats, badness: Floats, relative_error: float
) -> tuple[float, bool]:
    """Write means, errors and each part's squared error; return the worst, and whether the error asked for is met."""
    area, worst, size, squares = 0.0, 0.0, 0.0, 0.0
    badness[:] = 0.0
    for p in range(len(sums)):
        area += sums[p, AREA]
    if area <= 0.0:
        mean[:], error[:] = 0.0, 0.0
        return 0.0, False
    for c in range(AREA):
        total, signed, unsigned = 0.0, 0.0, 0.0
        for p in range(len(sums)):
            total += sums[p, c]
        mean[c] = total / area
        for p in range(len(sums)):
            residual = (changes[p, c] - mean[c] * changes[p, AREA]) / area
            signed += residual
            unsigned += residual * residual
            if c < 4:
                badness[p] += residual * residual
                worst = max(worst, badness[p])
        error[c] = SAFETY * max(abs(signed), math.sqrt(unsigned)) + _FLOOR * mean[c]
        if c < 4:
            size += mean[c] * mean[c]
            squares += error[c] * error[c]
    return worst, squares <= relative_error * relative_error * size


def quadrature_rows(
    model: Model, columns: Columns, index: npt.NDArray[np.int64], options: TruthOptions, seed: int
) -> Raw:
    """Answer every row: means and error bounds (N, 5), and points used.

    Rotated footprints are no product in x and y; they are sampled as `owen` does, and only they depend on `seed`.

    Parameters
    ----------
    model, columns : Model, Columns
        The cloth and the queries.
    index : int (N,)
        Name of each row.
    options : TruthOptions
        Error asked for, and counts; the points of the two first rules may exceed `max_count`.
    seed : int
        Name of the random numbers.
    """
    quarter = np.sin(2.0 * columns.angle)
    aligned = (np.abs(quarter) < 1e-6) | ((model.shape == GAUSSIAN) & (columns.sigma == columns.sigma_minor))
    rows = len(index)
    means, errors, counts = np.zeros((rows, AREA)), np.zeros((rows, AREA)), np.zeros(rows, np.int64)
    limits = options.relative_error, options.min_count, options.max_count
    if aligned.any():
        found = integrate_rows(model, columns.take(aligned), *limits, True, len(_COUNTS) - 1, _FIRST)
        means[aligned], errors[aligned], counts[aligned] = found
    if not aligned.all():
        rotated = ~aligned
        found = sample_rows(model, columns.take(rotated), index[rotated], OWEN, *limits, np.uint64(seed))
        means[rotated], errors[rotated], counts[rotated] = found
    return means, errors, counts
