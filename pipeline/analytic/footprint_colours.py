"""Colours of the components where ends or picks differ in colour, for methods that know four components.

Light and viewer in front: soft nodes are summed thread by thread of the weave's repeat (pipeline.analytic.soft_nodes),
each component apart, and each thread has the mean colour of its copies in the footprint. A copy counts by the density
of the footprint where the viewer sees its nodes, times the area that is seen of them. From behind, each thread counts
by the footprint's mass on its cells, times the share of each cell in which it is seen from straight above.
pipeline.truth.scattering.thread_colours has the exact colours.
"""

import math
from functools import lru_cache
from typing import Final, NamedTuple

import numpy as np

from pipeline.analytic.soft_horizons import around
from pipeline.analytic.soft_nodes.answer import LONGEST, query_sums, shortened
from pipeline.analytic.soft_nodes.groups import COLUMNS
from pipeline.analytic.soft_nodes.nodes import GROUP_FAMILY, LINES, START, SoftNodeTable, tabulate
from pipeline.analytic.soft_nodes.seen_areas import angle_of, write_areas
from pipeline.analytic.soft_nodes.shade import DIFFUSE, SPECULAR
from pipeline.analytic.soft_nodes.wide import RESOLVED, Sight, density, form, sight, touched, where_seen
from pipeline.compiled.arrays import Float32, Float64
from pipeline.compiled.decorators import allocating_kernel, kernel
from pipeline.truth.footprint.mixture import COARSE_LINE, Footprints, along_axes, footprints, line_points, narrow_axis
from pipeline.truth.geometry.heightfield import WARP
from pipeline.truth.query import Queries
from weaves.fabric import Fabric

_REACH: Final = 5.5  # in standard deviations; what lies beyond is 4e-8
_SPREAD_OUT: Final = 0.8  # in repeats: an axis of a Gaussian this wide covers the repeat evenly, to 6e-6
_POINTS: Final = COARSE_LINE.points
_MOST: Final = COARSE_LINE.most
_HIDDEN: Final = 1e-6  # share of a cell that a yarn covers in any case: where it is not seen it has a colour, too
_CHUNK: Final = 4096  # queries whose sums are held at a time
_FAINT: Final = 1e-6  # share of the light by which threads count in any case
_TINY: Final = 1e-30
_0 = np.float32(0.0)

Patch = tuple[float, float, np.float32, np.float32, np.float32]
"""Centre of a footprint, deviations along x and y, and their correlation."""


class Threads(NamedTuple):
    """The coloured ends, or picks, of a fabric."""

    colours: Float64  # k_s, k_d and k_dt of each of the sequence, (n, 9)
    seen: Float64
    """Share of each cell in which the yarn is seen from above, (threads of the weave's repeat, crossing threads)."""
    repeat: int  # repeat of weave and colours together
    even: Float64
    """Mean colour of those that fall on each of the weave's repeat, over their number,
    (threads of the weave's repeat, 9)."""


def footprint_colours(fabric: Fabric, queries: Queries) -> Float64:
    """Return the colours of the components of N queries, float64 (N, 4, 3), linear sRGB.

    Footprints are of any kind; thinner ellipses than a `COARSE_LINE` resolves count as wider. Cloth counts as flat.
    """
    result, back = np.empty((len(queries.u), 4, 3)), queries.wo[:, 2] < 0.0
    if back.any():
        result[back] = footprint_colours(fabric.back(), queries.take(back).turned())
        if not back.all():
            result[~back] = footprint_colours(fabric, queries.take(~back))
        return result
    front = queries.wi[:, 2] > 0.0
    if front.any():
        result[front] = _by_sums(fabric, queries.take(front))
    if not front.all():
        result[~front] = _from_above(fabric, queries.take(~front))
    return result


def _by_sums(fabric: Fabric, queries: Queries) -> Float64:
    """Return the colours of N queries by the sums of each thread, (N, 4, 3)."""
    table, (warp, weft) = _table(fabric), _threads(fabric)
    result = np.empty((len(queries.u), 4, 3))
    for start in range(0, len(result), _CHUNK):
        part = queries.take(slice(start, start + _CHUNK))
        sums, _ = query_sums(table, part)
        wo = np.ascontiguousarray(part.raised().wo, np.float32)
        weights = np.ascontiguousarray(sums[:, :, (SPECULAR, DIFFUSE)], np.float64)
        found = _weighed_colours(table, warp, weft, footprints(part), wo, weights)
        result[start : start + _CHUNK] = found.transpose(0, 2, 1, 3).reshape(-1, 4, 3)
    return result


def _from_above(fabric: Fabric, queries: Queries) -> Float64:
    """Return the colours of N queries by what is seen from straight above, (N, 4, 3)."""
    wide = [np.ascontiguousarray(queries[k], np.float64) for k in (0, 1, 2, 5, 6)]
    means = _mean_colours(*_threads(fabric), *wide).reshape(-1, 2, 3, 3)
    through = (queries.wi[:, 2] * queries.wo[:, 2] < 0.0)[:, None, None]
    return np.concatenate([means[:, :, 0], np.where(through, means[:, :, 2], means[:, :, 1])], axis=1)


@lru_cache(maxsize=16)
def _table(fabric: Fabric) -> SoftNodeTable:
    return tabulate(fabric, by_thread=True)


@lru_cache(maxsize=64)
def _threads(fabric: Fabric) -> tuple[Threads, Threads]:
    """Return the ends and the picks as kernels read them."""
    over = fabric.weave.warp_over
    warp, weft = fabric.warp.width, fabric.weft.width
    warp_seen = np.where(over, warp, (1.0 - weft) * warp)
    weft_seen = np.where(over, (1.0 - warp) * weft, weft)
    found = []
    for thread_colours, seen, repeat in zip(
        fabric.thread_colours(), (warp_seen.T, weft_seen), fabric.repeat, strict=True
    ):
        colours, even = np.concatenate(thread_colours, axis=1), np.zeros((len(seen), 9))
        for thread in range(repeat):
            even[thread % len(seen)] += colours[thread % len(colours)] / repeat
        visible = np.ascontiguousarray(np.maximum(seen, _HIDDEN))
        found.append(Threads(np.ascontiguousarray(colours), visible, repeat, even))
    return found[0], found[1]


@allocating_kernel
def _mean_colours(
    warp: Threads, weft: Threads, u: Float64, v: Float64, major: Float64, minor: Float64, angle: Float64
) -> Float64:
    """Return k_s, k_d and k_dt of the ends and of the picks in N footprints, (N, 2, 9)."""
    ends, picks = warp.seen.shape
    found = np.zeros((len(u), 2, 9))
    weights = np.zeros(2)
    masses = np.zeros(ends), np.zeros(picks)
    sums = np.zeros((ends, 9)), np.zeros((picks, 9))
    points = np.zeros((2, _POINTS), np.float32)
    for row in range(len(u)):
        x, y, correlation = along_axes(major[row], minor[row], angle[row])
        correlation = min(max(correlation, -_MOST), _MOST)
        blur, shift = math.sqrt(1.0 - abs(correlation)), math.sqrt(abs(correlation))
        weights[:] = 0.0
        for point in range(line_points(correlation, COARSE_LINE, points[0], points[1])):
            z = points[0, point] * shift
            _fold(warp, u[row] + z * x, blur * x, masses[0], sums[0])
            _fold(weft, v[row] + math.copysign(z, z * correlation) * y, blur * y, masses[1], sums[1])
            share = points[1, point]
            weights[0] += _add(warp.seen, masses[1], masses[0], sums[0], share, found[row, 0])
            weights[1] += _add(weft.seen, masses[0], masses[1], sums[1], share, found[row, 1])
        for family in range(2):
            found[row, family] /= weights[family]
    return found


@allocating_kernel
def _weighed_colours(
    table: SoftNodeTable, warp: Threads, weft: Threads, patches: Footprints, wo: Float32, weights: Float64
) -> Float64:
    """Return k_s and k_d of the ends and of the picks in N footprints, (N, 2, 2, 3).

    `weights` (N, ends + picks, 2) are the specular and diffuse light of each thread of the weave's repeat.
    """
    u, v, deviation_x, deviation_y, correlation = patches
    ends, picks = warp.seen.shape
    found = np.zeros((len(u), 2, 2, 3))
    masses = np.zeros(ends), np.zeros(picks)
    sums = np.zeros((ends, 9)), np.zeros((picks, 9))
    areas, seen = np.zeros(table.evenly.shape, np.float32), np.empty((2, table.evenly.size), np.float32)
    of_lines = areas.reshape(-1, COLUMNS)
    for row in range(len(u)):
        dx, dy, rho = deviation_x[row], deviation_y[row], correlation[row]
        narrowest = np.float32(narrow_axis(dx, dy, rho))
        low, high, turn = around(wo[row, 0], wo[row, 1])
        step, part = angle_of(wo[row, 2])
        write_areas(table.areas, low, high, turn, step, part, areas)
        towards = sight(wo[row, 0], wo[row, 1], wo[row, 2], _0)
        where_seen(table, towards, seen)
        if narrowest >= table.uniform:
            _fold_seen(table, warp, 0, u[row], dx, of_lines, seen, masses[0], sums[0])
            _fold_seen(table, weft, 1, v[row], dy, of_lines, seen, masses[1], sums[1])
        else:
            if max(dx, dy) > LONGEST:
                dx, dy, rho = shortened(dx, dy, rho, narrowest)
            patch = np.float64(u[row]), np.float64(v[row]), dx, dy, rho
            _add_cells(table, (warp, weft), patch, towards, of_lines, seen, masses, sums)
        _weigh(warp, masses[0], sums[0], weights[row, :ends], found[row, 0])
        _weigh(weft, masses[1], sums[1], weights[row, ends:], found[row, 1])
    return found


@kernel
def _add_cells(
    table: SoftNodeTable, threads: tuple[Threads, Threads], patch: Patch, towards: Sight, areas: Float32, seen: Float32,
    masses: tuple[Float64, Float64], sums: tuple[Float64, Float64],
) -> None:  # fmt: skip
    """Write what a footprint sees of each thread, and the same times its colour, cell by cell."""
    for family in range(2):
        masses[family][:], sums[family][:] = 0.0, 0.0
    x, y, dx, dy, rho = patch
    ends, picks = len(masses[0]), len(masses[1])
    dx, dy = max(dx, np.float32(RESOLVED)), max(dy, np.float32(RESOLVED))
    of_xx, of_yy, of_xy = form(dx, dy, rho)
    x_low, x_high, y_low, y_high = touched(table, towards, dx, dy)
    for row in range(math.floor(y + y_low), math.floor(y + y_high) + 1):
        for column in range(math.floor(x + x_low), math.floor(x + x_high) + 1):
            middle_x, middle_y = np.float32(x - column), np.float32(y - row)
            end, pick = column % ends, row % picks
            cell = pick * ends + end
            for c in range(table.group_starts[cell], table.group_starts[cell + 1]):
                group = table.groups[table.cell_groups[c]]
                start, family, total = group[START] // np.uint32(COLUMNS), group[GROUP_FAMILY], 0.0
                if family > 1:
                    continue
                for line in range(start, start + group[LINES]):
                    for k in range(COLUMNS):
                        at = COLUMNS * line + k
                        at_x, at_y = seen[0, at] - middle_x, seen[1, at] - middle_y
                        share = table.spots[line, 2, k] * max(areas[line, k], np.float32(_HIDDEN))
                        total += share * density(at_x, at_y, of_xx, of_yy, of_xy)
                copy, thread = (column, end) if family == WARP else (row, pick)
                _add_thread(threads[family].colours, copy, thread, total, masses[family], sums[family])


@kernel
def _add_thread(colours: Float64, copy: int, thread: int, mass: float, masses: Float64, sums: Float64) -> None:
    """Add what is seen of a copy of a thread."""
    masses[thread] += mass
    for c in range(9):
        sums[thread, c] += mass * colours[copy % len(colours), c]


@kernel
def _fold_seen(
    table: SoftNodeTable, family: Threads, axis: int, centre: np.float32, sigma: np.float32, areas: Float32,
    seen: Float32, masses: Float64, sums: Float64,
) -> None:  # fmt: skip
    """Write the same for an even footprint along an axis: a thread is the Gaussian of the places of its nodes."""
    threads, first = len(masses), 0 if axis == 0 else table.kinds[0]
    masses[:], sums[:] = 0.0, 0.0
    shares = table.evenly.reshape(-1, COLUMNS)
    for thread in range(threads):
        total, mean, square = 0.0, 0.0, 0.0
        a, b = table.starts[first + thread], table.starts[first + thread + 1]
        for line in range(a * len(shares) // len(table.evenly), b * len(shares) // len(table.evenly)):
            for k in range(COLUMNS):
                share = shares[line, k] * max(areas[line, k], np.float32(_HIDDEN))
                place = seen[axis, COLUMNS * line + k]
                total += share
                mean += share * place
                square += share * place * place
        if sigma >= _SPREAD_OUT * family.repeat:
            masses[thread] = total
            for c in range(9):
                sums[thread, c] = total * threads * family.even[thread, c]
            continue
        mean /= max(total, _TINY)
        wide = math.sqrt(sigma * sigma + max(square / max(total, _TINY) - mean * mean, 0.0))
        place = centre - thread - mean
        for copy in range(
            math.floor((place - _REACH * wide) / threads), math.floor((place + _REACH * wide) / threads) + 2
        ):
            away = (copy * threads - place) / wide
            _add_thread(
                family.colours, thread + copy * threads, thread, total * math.exp(-0.5 * away * away), masses, sums
            )  # fmt: skip


@kernel
def _weigh(family: Threads, masses: Float64, sums: Float64, weights: Float64, found: Float64) -> None:
    """Write the mean colours of a family's threads, (2, 3), by the light of each."""
    for kind in range(2):
        # Threads of a family that sends no light count by their mass.
        least, whole = max(_FAINT * weights[:, kind].sum(), _TINY), 0.0
        for thread in range(len(masses)):
            if masses[thread] > 0.0:
                weight = weights[thread, kind] / masses[thread] + least
                whole += weight * masses[thread]
                for c in range(3):
                    found[kind, c] += weight * sums[thread, 3 * kind + c]
        for c in range(3):
            if whole > 0.0:
                found[kind, c] /= whole
            else:  # none of it is near: it sends no light
                found[kind, c] = family.even[:, 3 * kind + c].sum()


@kernel
def _fold(family: Threads, centre: float, sigma: float, masses: Float64, sums: Float64) -> None:
    """Write the mass of an axis of a footprint on each thread of the weave's repeat, and the same times its colour."""
    threads = len(masses)
    if sigma >= _SPREAD_OUT * family.repeat:
        masses[:] = 1.0 / threads
        for thread in range(threads):
            for c in range(9):
                sums[thread, c] = family.even[thread, c]
        return
    masses[:], sums[:] = 0.0, 0.0
    first, last = math.floor(centre - _REACH * sigma), math.floor(centre + _REACH * sigma)
    scale = 1.0 / (math.sqrt(2.0) * sigma)
    below = -1.0
    for thread in range(first, last + 1):
        above = 1.0 if thread == last else math.erf((thread + 1 - centre) * scale)
        mass = 0.5 * (above - below)
        below = above
        _add_thread(family.colours, thread, thread % threads, mass, masses, sums)


@kernel
def _add(seen: Float64, across: Float64, masses: Float64, sums: Float64, share: float, found: Float64) -> float:
    """Add a family's colours by what is `seen` of threads, with mass `across` on crossing ones; return the weight."""
    weight = 0.0
    for thread in range(len(masses)):
        if masses[thread] > 0.0:
            visible = 0.0
            for crossing in range(len(across)):
                visible += share * seen[thread, crossing] * across[crossing]
            weight += masses[thread] * visible
            for c in range(9):
                found[c] += sums[thread, c] * visible
    return weight
