"""Monte Carlo and randomised quasi-Monte Carlo: points of the footprint, doubled until the error is small enough.

The points form independent randomisations r of one point set. A component is the ratio of two sums, f = N / D. Its
standard error comes from the spread of the residuals N_r - f D_r (the linearised ratio estimator
[Cochran1977Sampling]), with RANDOMISATIONS - 1 degrees of freedom. Patches that are almost hidden get more points until
every randomisation has seen one, at most HIDDEN_PATIENCE times the limit. The error falls as count^-1/2 for independent
points, and faster for the other point sets.
"""

import math
from typing import Final

import numpy as np

from pipeline.compiled.arrays import Float64, Index
from pipeline.compiled.decorators import allocating_kernel, inlined_kernel, kernel
from pipeline.compiled.normal import normal_quantile
from pipeline.truth.calibration import SAMPLED, squared_norm
from pipeline.truth.cloth import AREA_SUM, POINT_SUMS, ClothSide, Raw, WideQueries
from pipeline.truth.footprint.place import BOX_SIDE, GAUSSIAN, Axis, place
from pipeline.truth.footprint.sequences import derive, independent_pair, owen_pair, r2_pair
from pipeline.truth.geometry.heightfield import GAP, has_gaps
from pipeline.truth.geometry.march import wrap
from pipeline.truth.options import Limits
from pipeline.truth.query import HIDDEN_SHARE
from pipeline.truth.scattering.point import Directions, directions_of, point_share, ray_share

_CERTAIN: Final = 0.001  # probability of a wrong decision that is not worth more points


@kernel
def conceal(share: float, doubt: float, mean: Float64, error: Float64) -> bool:
    """Write the answer 0 for a patch that counts as hidden; where this is not certain, raise the error.

    `share` and `doubt` are the visible share of the patch's projected area and its standard error. Returns whether the
    decision may be wrong: such a patch is worth more points.
    """
    concealed = share < HIDDEN_SHARE
    # Probability that the true share is on the other side of the limit, its error taken to be normal.
    distance = abs(share - HIDDEN_SHARE)
    wrong = 0.5 * math.erfc(distance / (math.sqrt(2.0) * doubt)) if doubt > 0.0 else 0.0
    for c in range(len(mean)):
        error[c] = math.hypot(0.0 if concealed else error[c], math.sqrt(wrong) * mean[c])
        if concealed:
            mean[c] = 0.0
    return wrong > _CERTAIN


RANDOMISATIONS: Final = 16

HIDDEN_PATIENCE: Final = 16
"""Times `max_count` that a patch may spend of which some randomisation has not seen a single point."""

INDEPENDENT, R2, OWEN = range(3)

_CORNER: Final = 0.5  # points that may pass through a gap or not, beyond what the randomisations' spread says

_EVEN: Final = 1.0  # repeats: a Gaussian with both axes as wide covers the repeat evenly, to 4e-16


@inlined_kernel
def place_in(
    ends: float, picks: float, columns: WideQueries, row: int, shape: int, first: float, second: float
) -> tuple[float, float, float]:
    """Return the point of a repeat that two numbers in (0, 1) name in the footprint of a query, and its weight."""
    u, v, sigma, sigma_minor = columns.u[row], columns.v[row], columns.sigma[row], columns.sigma_minor[row]
    angle = columns.angle[row]
    if angle == 0.0 or (shape == GAUSSIAN and sigma == sigma_minor):
        x, weight_x = place(Axis(shape, u, sigma, ends), first)
        y, weight_y = place(Axis(shape, v, sigma_minor, picks), second)
        return x, y, weight_x * weight_y
    if shape == GAUSSIAN:
        if min(sigma, sigma_minor) >= _EVEN * max(ends, picks):
            return wrap(u + first * ends, ends), wrap(v + second * picks, picks), 1.0
        a, b = sigma * normal_quantile(first), sigma_minor * normal_quantile(second)
    else:
        a, b = BOX_SIDE * sigma * (first - 0.5), BOX_SIDE * sigma_minor * (second - 0.5)
    cosine, sine = math.cos(angle), math.sin(angle)
    return wrap(u + a * cosine - b * sine, ends), wrap(v + a * sine + b * cosine, picks), 1.0


@inlined_kernel
def place_point(
    columns: WideQueries, row: int, cloth: ClothSide, first: float, second: float
) -> tuple[float, float, float]:
    """Return the same for the repeat of the cloth."""
    picks, ends = cloth.front.top.shape
    return place_in(float(ends), float(picks), columns, row, cloth.shape, first, second)


@inlined_kernel
def share_at(
    cloth: ClothSide, x: float, y: float, directions: Directions
) -> tuple[int, float, float, float, float, float, float]:
    """Return what `ray_share` does; of points of the fabric plane, which do not move, what `point_share` does."""
    if cloth.parallax:
        return ray_share(cloth.front, cloth.back, cloth.plane, x, y, directions, cloth.choices)
    family, area, specular, diffuse, through = point_share(cloth.front, cloth.back, x, y, directions, cloth.choices)
    return family, area, specular, diffuse, through, 0.0, 0.0


@inlined_kernel
def add_point(
    cloth: ClothSide, x: float, y: float, weight: float, directions: Directions, sums: Float64, r: int
) -> bool:
    """Add the weighted share of a point to row r of the sums, (rows, POINT_SUMS); return whether the viewer sees it."""
    family, area, specular, diffuse, through, _, _ = share_at(cloth, x, y, directions)
    if family != GAP:
        sums[r, family] += weight * specular
        sums[r, 2 + family] += weight * diffuse
    sums[r, 4] += weight * through
    sums[r, AREA_SUM] += weight * (directions.viewer.z if cloth.projected else area)
    return area > 0.0


@kernel
def query_directions(columns: WideQueries, row: int) -> Directions:
    """Prepare the directions of a query."""
    wi, wo = columns.wi[row], columns.wo[row]
    return directions_of(wi[0], wi[1], wi[2], wo[0], wo[1], wo[2], columns.curvature[row])


@kernel
def ratios(sums: Float64, mean: Float64, error: Float64) -> int:
    """Write ratios and standard errors from sums (RANDOMISATIONS, POINT_SUMS); return how many rows saw a point."""
    area, seen = sums[:, AREA_SUM].sum(), 0
    for r in range(RANDOMISATIONS):
        seen += sums[r, AREA_SUM] > 0.0
    for c in range(AREA_SUM):
        mean[c], error[c] = 0.0, 0.0
        if area > 0.0:
            mean[c] = sums[:, c].sum() / area
            spread = 0.0
            for r in range(RANDOMISATIONS):
                residual = sums[r, c] - mean[c] * sums[r, AREA_SUM]
                spread += residual * residual
            error[c] = math.sqrt(spread * RANDOMISATIONS / (RANDOMISATIONS - 1)) / area
            if seen < RANDOMISATIONS:
                # The ratio of a few visible randomisations follows them: their spread alone would look too small.
                error[c] = math.hypot(error[c], mean[c] / math.sqrt(seen))
    return seen


@allocating_kernel
def sample_rows(
    cloth: ClothSide, columns: WideQueries, index: Index, method: int, limits: Limits, seed: np.uint64
) -> Raw:
    """Answer every row by points that are INDEPENDENT, R2 or OWEN; a function of (seed, index) names those of a row."""
    rows = len(index)
    means, errors = np.zeros((rows, AREA_SUM)), np.zeros((rows, AREA_SUM))
    counts = np.zeros(rows, np.int64)
    sums = np.zeros((RANDOMISATIONS, POINT_SUMS))
    for row in range(rows):
        key = derive(seed, index[row])
        directions = query_directions(columns, row)
        mean, error = means[row], errors[row]
        sums[:] = 0.0
        done, target, visible = 0, limits.min_count // RANDOMISATIONS, 0
        while True:
            # Extend every randomisation from `done` to `target` points.
            for r in range(RANDOMISATIONS):
                randomisation = derive(key, r)
                for k in range(done, target):
                    if method == OWEN:
                        first, second = owen_pair(randomisation, k)
                    elif method == R2:
                        first, second = r2_pair(randomisation, k)
                    else:
                        first, second = independent_pair(randomisation, k)
                    x, y, weight = place_point(columns, row, cloth, first, second)
                    visible += add_point(cloth, x, y, weight, directions, sums, r)
            done = target

            # Stop when the requested error is reached, or the points are spent.
            seen = ratios(sums, mean, error)
            size = squared_norm(mean)
            for c in range(4):
                # One more visible point may show what none has shown so far.
                error[c] = math.hypot(error[c], math.sqrt(size) / max(visible, 1))
            if has_gaps(cloth.front):
                # Stratified points may all agree on a gap whose corner none of them has met.
                error[4] = math.hypot(error[4], _CORNER / (done * RANDOMISATIONS))
            if size == 0.0:
                # So many points without light: a share of 1 / count may have been missed.
                error[2] = error[3] = abs(directions.light.z) / (math.pi * done * RANDOMISATIONS)
            reached = squared_norm(error) <= max(limits.relative_error**2 * size, limits.absolute_error**2)
            # A patch of which hardly a point is seen says nothing of its error yet; its points cost little.
            limit = limits.max_count if seen == RANDOMISATIONS else limits.max_count * HIDDEN_PATIENCE
            if done * RANDOMISATIONS >= limit or (reached and seen == RANDOMISATIONS):
                break
            target = 2 * done
        counts[row] = done * RANDOMISATIONS
        # The visible share of the patch, and its error; `whole` is the area of a randomisation that sees all of it.
        area, square, whole = sums[:, AREA_SUM].sum() / RANDOMISATIONS, 0.0, directions.viewer.z * done
        for r in range(RANDOMISATIONS):
            square += (sums[r, AREA_SUM] - area) ** 2
        doubt = math.sqrt(square / (RANDOMISATIONS * (RANDOMISATIONS - 1))) / whole
        conceal(area / whole, doubt, mean, error)
    return Raw(means, errors, counts, np.full(rows, SAMPLED))
