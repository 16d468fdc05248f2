"""Colours of the components where ends or picks differ in colour, for methods that know four components.

Light and viewer in front: soft nodes are summed thread by thread of the weave's repeat (pipeline.analytic.soft_nodes),
each component apart, and each thread has the mean colour of its copies in the footprint. From behind, each thread
counts by the footprint's mass on its cells, times the share of each cell in which it is seen from straight above.
pipeline.truth.scattering.thread_colours has the exact colours. Nothing aliases: masses are integrals of a Gaussian.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Final, NamedTuple

import numpy as np

from pipeline.analytic.soft_nodes.answer import SMALLEST, query_sums
from pipeline.analytic.soft_nodes.nodes import SoftNodeTable, tabulate
from pipeline.analytic.soft_nodes.shade import DIFFUSE, SPECULAR
from pipeline.compiled.arrays import Float64
from pipeline.compiled.decorators import allocating_kernel, kernel
from pipeline.truth.footprint.mixture import COARSE_LINE, along_axes, deviations, line_points
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


class Threads(NamedTuple):
    """The coloured ends, or picks, of a fabric.

    Attributes
    ----------
    colours : float64 (n, 9)
        k_s, k_d and k_dt of each of the sequence.
    seen : float64 (threads of the weave's repeat, crossing threads)
        Share of each cell in which the yarn is seen from above.
    repeat : int
        Repeat of weave and colours together.
    even : float64 (threads of the weave's repeat, 9)
        Mean colour of those that fall on each of the weave's repeat, over their number.
    """

    colours: Float64
    seen: Float64
    repeat: int
    even: Float64


def footprint_colours(fabric: Fabric, queries: Queries) -> Float64:
    """Return the colours of the components of N queries, float64 (N, 4, 3), linear sRGB.

    Parameters
    ----------
    fabric : Fabric
        The cloth.
    queries : Queries
        Footprints of any kind; thinner ellipses than a `COARSE_LINE` resolves count as wider. Cloth counts as flat.
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
        u, v, x, y = (np.ascontiguousarray(a, np.float64) for a in (part.u, part.v, *deviations(part, SMALLEST)[:2]))
        weights = np.ascontiguousarray(sums[:, :, (SPECULAR, DIFFUSE)], np.float64)
        found = weighed_colours(warp, weft, u, v, x, y, weights)
        result[start : start + _CHUNK] = found.transpose(0, 2, 1, 3).reshape(-1, 4, 3)
    return result


def _from_above(fabric: Fabric, queries: Queries) -> Float64:
    """Return the colours of N queries by what is seen from straight above, (N, 4, 3)."""
    wide = [np.ascontiguousarray(queries[k], np.float64) for k in (0, 1, 2, 5, 6)]
    means = mean_colours(*_threads(fabric), *wide).reshape(-1, 2, 3, 3)
    through = (queries.wi[:, 2] * queries.wo[:, 2] < 0.0)[:, None, None]
    diffuse = np.where(through, means[:, :, 2], means[:, :, 1])
    return np.concatenate([means[:, :, 0], diffuse], axis=1)


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
def mean_colours(
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
            for c in range(9):
                found[row, family, c] /= weights[family]
    return found


@allocating_kernel
def weighed_colours(
    warp: Threads, weft: Threads, u: Float64, v: Float64, x: Float64, y: Float64, weights: Float64
) -> Float64:
    """Return k_s and k_d of the ends and of the picks in N footprints of deviations x and y, (N, 2, 2, 3).

    `weights` (N, ends + picks, 2) are the specular and diffuse light of each thread of the weave's repeat.
    """
    ends, picks = warp.seen.shape
    found = np.zeros((len(u), 2, 2, 3))
    masses = np.zeros(ends), np.zeros(picks)
    sums = np.zeros((ends, 9)), np.zeros((picks, 9))
    for row in range(len(u)):
        _fold(warp, u[row], x[row], masses[0], sums[0])
        _fold(weft, v[row], y[row], masses[1], sums[1])
        _weigh(masses[0], sums[0], weights[row, :ends], found[row, 0])
        _weigh(masses[1], sums[1], weights[row, ends:], found[row, 1])
    return found


@kernel
def _weigh(masses: Float64, sums: Float64, weights: Float64, found: Float64) -> None:
    """Write the mean colours of a family's threads, (2, 3), by the light of each."""
    for kind in range(2):
        total = 0.0
        for thread in range(len(masses)):
            total += weights[thread, kind]
        # Threads of a family that sends no light count by their mass.
        least, whole = max(_FAINT * total, _TINY), 0.0
        for thread in range(len(masses)):
            if masses[thread] > 0.0:
                weight = weights[thread, kind] / masses[thread] + least
                whole += weight * masses[thread]
                for c in range(3):
                    found[kind, c] += weight * sums[thread, 3 * kind + c]
        for c in range(3):
            found[kind, c] /= whole


@kernel
def _fold(family: Threads, centre: float, sigma: float, masses: Float64, sums: Float64) -> None:
    """Write the mass of an axis of a footprint on each thread of the weave's repeat, and the same times its colour."""
    threads, colours = len(masses), family.colours
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
        place, colour = thread % threads, thread % len(colours)
        masses[place] += mass
        for c in range(9):
            sums[place, c] += mass * colours[colour, c]


@kernel
def _add(seen: Float64, across: Float64, masses: Float64, sums: Float64, share: float, found: Float64) -> float:
    """Add the colours of a family's threads, by what is seen of them; return the added weight.

    `seen` is (threads, crossing threads), `across` the mass on each crossing thread.
    """
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
