"""Patches integrated without random numbers: Gauss-Legendre rules on every float that the footprint reaches.

The fabric is cut into the rectangles on which its surface is smooth: floats on top, strips of the yarn beneath, gaps.
Across a yarn the nodes are taken in the angle v, x = r sin v, which turns the vertical tangent at its edge into nothing
special. A rectangle is clipped to the footprint and cut again where the kernel is narrow against it (parts); each
resulting part gets a tensor rule, cut at shadow edges (rules). Without shadows it converges spectrally, at a rate
proportional to the roughness; with them the median error falls as points^-1.1 (cloth with gaps) to points^-1.8 (narrow
footprints), where scrambled points reach points^-0.8.

Each part doubles its nodes per axis on its own, the worst first. Its error is taken to be its last change, an
overestimate of what is left, plus what a rule of its size may step over: highlights and slivers of light. Parts add up
as if their errors all had one sign, or none, whichever is more. That is an estimate, no proof: it covers the norm of
the true error in about 97 % of queries.
"""

import math
from typing import Final

import numpy as np

from pipeline.compiled.arrays import Float64, Index, Mask
from pipeline.compiled.decorators import allocating_kernel, kernel
from pipeline.truth.calibration import QUADRATURE, QUADRATURE_CURVED, squared_norm
from pipeline.truth.cloth import AREA_SUM, POINT_SUMS, ClothSide, Raw, WideQueries
from pipeline.truth.footprint.place import GAUSSIAN, Axis
from pipeline.truth.geometry.pieces import first_cells
from pipeline.truth.monte_carlo import OWEN, query_directions, sample_rows
from pipeline.truth.options import Limits, TruthOptions
from pipeline.truth.quadrature import rules

SAFETY: Final = 1.5
"""Times the estimated error that the reported one is; fitted so that 95 % of the norms of true errors are covered."""

_FLOOR: Final = 1e-6  # least reported error as a share of the mean: footprints are cut at 5.5 sigma, 4e-8 of their mass
_FIRST: Final = 1  # level of the first rule
_SPLIT: Final = 2  # level from which on lines are cut
_EVEN: Final = 1.0  # in repeats: a Gaussian this wide covers the repeat evenly, to 4e-16
_HIGHLIGHT: Final = 14.0  # n nodes miss 2 exp(-14 n alpha / angle) of a highlight, fitted for alpha .1 to .3
_FADING: Final = 0.25  # share of the change before that the last one counts for at least: it may be small by chance
_SLIVER: Final = 2.0  # n nodes an axis miss slivers of light and shade of 2 n^-3 of a part
_BARELY: Final = 0.02  # visible share of a patch below which rules may step over most of what is visible
_WORST: Final = 0.0625  # parts with this share of the worst one's squared error are refined with it


@allocating_kernel
def integrate_rows(
    cloth: ClothSide, columns: WideQueries, different: Mask, limits: Limits, split: int, first: int, last: int
) -> tuple[Float64, Float64, Index, Mask]:
    """Answer every row: means, errors, points, and whether it is barely visible; footprints lie along x and y.

    `different` has the cells that represent all others under a footprint that covers the repeat evenly: the first of
    each orbit. From level `split` on, lines are cut at shadow edges; `first` < `last` are the levels of rules.
    """
    rows = len(columns.u)
    means, errors = np.zeros((rows, AREA_SUM)), np.zeros((rows, AREA_SUM))
    counts, barely = np.zeros(rows, np.int64), np.zeros(rows, np.bool_)
    picks, ends = cloth.front.top.shape
    everything = rules.rectangles(cloth.front, np.ones((picks, ends), np.bool_))
    kinds, share = rules.rectangles(cloth.front, different), picks * ends / different.sum()
    across, along = np.zeros((rules.CUTS, 3)), np.zeros((rules.CUTS, 3))
    grid, states = np.zeros((64, 64, POINT_SUMS)), np.zeros((64, 64), np.int64)
    for row in range(rows):
        directions = query_directions(columns, row)
        cosine = directions.viewer.z if cloth.choices.shadows else 0.0
        sigma_x, sigma_y = columns.sigma[row], columns.sigma_minor[row]
        if sigma_x != sigma_y and abs(math.cos(columns.angle[row])) < 0.5:
            sigma_x, sigma_y = sigma_y, sigma_x
        x_axis = Axis(cloth.shape, columns.u[row], sigma_x, float(ends))
        y_axis = Axis(cloth.shape, columns.v[row], sigma_y, float(picks))
        even = cloth.shape == GAUSSIAN and sigma_x >= _EVEN * ends and sigma_y >= _EVEN * picks
        wo = directions.viewer
        x_lean, y_lean = rules.lean_of(cloth, wo.x, wo.z), rules.lean_of(cloth, wo.y, wo.z)
        patch = rules.QueryPatch(cloth, directions, x_axis, y_axis, x_lean, y_lean)
        parts = _all_parts(patch, kinds if even else everything, across, along)
        if even:
            parts[:, rules.BOX_WEIGHT] *= share
            parts[:, rules.MASS] *= share
        total = len(parts)

        # The first rule on every part; then the worst parts get the next, at first all of them.
        sums, levels = np.zeros((total, POINT_SUMS)), np.full(total, first)
        changes, earlier = np.zeros((total, POINT_SUMS)), np.zeros((total, POINT_SUMS))
        costs, badness = np.zeros(total, np.int64), np.zeros(total)
        for p in range(total):
            counts[row] += rules.integrate(patch, parts[p], first, split, grid, states, sums[p])
        cut = -1.0
        while True:
            refined = False
            for p in range(total):
                fits = levels[p] == first or counts[row] + 4 * costs[p] <= limits.max_count
                if badness[p] >= cut and levels[p] < last and fits:
                    earlier[p] = changes[p]
                    changes[p] = sums[p]
                    levels[p] += 1
                    costs[p] = rules.integrate(patch, parts[p], levels[p], split, grid, states, sums[p])
                    changes[p] = sums[p] - changes[p]
                    counts[row] += costs[p]
                    refined = True
            worst, size = _estimate_errors(
                cosine, parts, levels, sums, changes, earlier, means[row], errors[row], badness
            )
            if size == 0.0:
                # So many points without light: a share of 1 / count may have been missed.
                errors[row, 2:4] = abs(directions.light.z) / (math.pi * counts[row])
            reached = squared_norm(errors[row]) <= max(limits.relative_error**2 * size, limits.absolute_error**2)
            if not refined or (reached and counts[row] >= limits.min_count):
                break
            cut = _WORST * worst
        share = 0.0
        for p in range(total):
            share += sums[p, AREA_SUM] / directions.viewer.z
        barely[row] = share < _BARELY
    return means, errors, counts, barely


@allocating_kernel
def _all_parts(patch: rules.QueryPatch, pieces: Float64, across: Float64, along: Float64) -> Float64:
    """Return the parts of all rectangles that the footprint reaches, (n, PART)."""
    parts, total = np.zeros((0, rules.PART)), 0
    for p in range(len(pieces)):
        total += rules.cut_parts(patch, pieces[p], across, along, parts)
    parts, total = np.zeros((total, rules.PART)), 0
    for p in range(len(pieces)):
        total += rules.cut_parts(patch, pieces[p], across, along, parts[total:])
    return parts


@kernel
def _estimate_errors(
    cosine: float, parts: Float64, levels: Index, sums: Float64, changes: Float64, earlier: Float64, mean: Float64,
    error: Float64, badness: Float64,
) -> tuple[float, float]:  # fmt: skip
    """Write means, errors and each part's squared error; return the worst, and the squared size of the means.

    What both rules of a part may have stepped over is added to its change: highlights, and, where `cosine` (the
    viewer's, 0 without shadows) says so, slivers that are seen or lit.
    """
    area, worst = sums[:, AREA_SUM].sum(), 0.0
    mean[:], error[:], badness[:] = 0.0, 0.0, 0.0
    if area <= 0.0:
        return 0.0, 0.0
    for c in range(AREA_SUM):
        for p in range(len(sums)):
            mean[c] += sums[p, c] / area
    size = squared_norm(mean)
    for c in range(AREA_SUM):
        signed, unsigned = 0.0, 0.0
        for p in range(len(sums)):
            residual = (changes[p, c] - mean[c] * changes[p, AREA_SUM]) / area
            signed += residual
            n = float(2 << levels[p])
            missed = _SLIVER / (n * n * n) * parts[p, rules.MASS] * cosine / area * mean[c]
            before = _FADING * (earlier[p, c] - mean[c] * earlier[p, AREA_SUM]) / area
            square = max(residual * residual, before * before) + missed * missed
            if c == parts[p, rules.KIND] and parts[p, rules.TURNING] > 0.0:
                missed = 2.0 * math.exp(-_HIGHLIGHT * n / parts[p, rules.TURNING]) * sums[p, AREA_SUM] / area
                square += missed * missed * size
            unsigned += square
            if c < 4:
                badness[p] += square
                worst = max(worst, badness[p])
        error[c] = SAFETY * max(abs(signed), math.sqrt(unsigned)) + _FLOOR * mean[c]
    return worst, size


def quadrature_rows(cloth: ClothSide, columns: WideQueries, index: Index, options: TruthOptions, seed: int) -> Raw:
    """Answer every row; the points of the two first rules may exceed `max_count`.

    Rotated footprints are no product in x and y; rays over curved cloth may turn. Of patches that are almost hidden,
    rules may step over all that is visible. All these are sampled as `owen` does, and only they depend on `seed`.
    """
    quarter = np.sin(2.0 * columns.angle)
    aligned = (np.abs(quarter) < 1e-6) | ((cloth.shape == GAUSSIAN) & (columns.sigma == columns.sigma_minor))
    if cloth.parallax:
        aligned &= columns.curvature <= 0.0
    answers = Raw.empty(len(index))
    if aligned.any():
        mean, error, count, barely = integrate_rows(
            cloth, columns.take(aligned), first_cells(cloth.front), options.limits, _SPLIT, _FIRST, rules.RULES - 1
        )
        curved = columns.curvature[aligned] > 0.0
        answers.put(aligned, mean, error, count, np.where(curved, QUADRATURE_CURVED, QUADRATURE))
        aligned[aligned] = ~barely
    if not aligned.all():
        rest = ~aligned
        answers.put(rest, *sample_rows(cloth, columns.take(rest), index[rest], OWEN, options.limits, np.uint64(seed)))
    return answers
