"""Opacity of curved cloth along camera rays, and the cosine at which a ray just touches it.

The boundary surface lies at the height of the cloth's highest point. A camera ray enters it at a point of the footprint
with direction -wo, and the cloth falls away below it by kappa s^2 / 2 at distance s [Kuznetsov2022Curved]: seen from
the cloth, the ray is a parabola. It hits a yarn, or rises and leaves the boundary again, or passes through a gap to the
other side. Footprints lie on the boundary here, not on the reference plane below it, where colours have theirs: a ray
that leaves again meets the boundary alone, and no yarn stands out over it. Every point of the footprint is taken to see
the viewer under the same angle to its own normal.

Opacity is the share of rays that hit a yarn, coverage the share that do not leave the boundary again. They differ at
gaps alone: what the patch BSDF and the transparency say of the cloth already counts gaps, coverage does not.

In the fabric plane a gap is open. A ray that crosses the plane there runs on beneath, where it is followed in steps of
`_STEP`, until it meets the back of a yarn, leaves the cloth behind it, or comes up again through a gap. One that
crosses the plane anywhere else has hit the yarn there.
"""

import math

import numpy as np
import numpy.typing as npt

from pipeline.compiled.arrays import Float32, Float64, Index
from pipeline.compiled.decorators import allocating_kernel, kernel
from pipeline.truth.cloth import ClothSide, WideQueries, cloth_side, columns_of
from pipeline.truth.footprint.sequences import derive, owen_pair
from pipeline.truth.geometry.heightfield import GAP, UNDER, HeightField, has_gaps, surface_at
from pipeline.truth.geometry.march import Ray, ray, wrap
from pipeline.truth.geometry.visibility import visible
from pipeline.truth.monte_carlo import RANDOMISATIONS, place_point
from pipeline.truth.options import Limits, TruthOptions
from pipeline.truth.query import Queries, validate
from weaves.fabric import Fabric

_STEP = 1.0 / 256.0  # in yarn spacings, below the fabric plane only, where no concave form helps
_BISECTIONS = 50


@kernel
def _open_at(field: HeightField, x: float, y: float) -> tuple[bool, float]:
    """Return whether (x, y), anywhere on the endless cloth, is a gap, and the height there."""
    picks, ends = field.top.shape
    x, y = wrap(x, ends), wrap(y, picks)
    family, _, height, _, _, _, _, _, _ = surface_at(field, x, y, int(x), int(y))
    return family == GAP, height


@kernel
def _passes(front: HeightField, back: HeightField, x: float, y: float, towards: Ray) -> bool:
    """Return whether a sinking ray from the boundary above (x, y) goes through a gap and meets no yarn."""
    picks, ends = front.top.shape
    dx, dy, bend, high = towards.dx, towards.dy, towards.bend, front.highest
    # Its slope q where it crosses the plane, downwards: q^2 = rise^2 - 2 kappa H, H the boundary's height.
    square = towards.rise * towards.rise - 2.0 * bend * high
    if square <= 0.0:
        return False
    q = math.sqrt(square)
    down = 2.0 * high / (q - towards.rise)
    x, y = x + down * dx, y + down * dy
    empty, _ = _open_at(front, x, y)
    if not empty:
        return False

    # Back to where it came from: nothing between the boundary and the gap.
    if q == math.inf:
        return True
    back_up = Ray(-towards.x, -towards.y, -towards.z, -dx, -dy, q, bend, towards.stride_x, towards.stride_y)
    if not visible(front, wrap(x, ends), wrap(y, picks), 0.0, UNDER, back_up):
        return False

    # Beneath the plane, mirrored: the depth q s - kappa s^2 / 2 has to stay greater than that of the yarns.
    onward = Ray(towards.x, towards.y, -towards.z, dx, dy, q, bend, towards.stride_x, towards.stride_y)
    if bend <= 0.0:
        return visible(back, wrap(x, ends), wrap(y, picks), 0.0, UNDER, onward)
    square -= 2.0 * bend * back.highest
    leaves = square > 0.0
    length = 2.0 * back.highest / (q + math.sqrt(square)) if leaves else 2.0 * q / bend
    steps = int(length / _STEP) + 1
    for k in range(1, steps):
        s = length * k / steps
        empty, depth = _open_at(back, x + s * dx, y + s * dy)
        if not empty and depth > s * (q - 0.5 * bend * s):
            return False
    if leaves:
        return True

    # Up again on this side.
    x, y = x + length * dx, y + length * dy
    empty, _ = _open_at(front, x, y)
    return empty and visible(front, wrap(x, ends), wrap(y, picks), 0.0, UNDER, onward)


@kernel
def hits(front: HeightField, back: HeightField, x: float, y: float, towards: Ray, filled: bool = False) -> bool:
    """Return whether a ray, z < 0, that enters the boundary above (x, y) of the repeat hits a yarn or `filled` gap."""
    if visible(front, x, y, front.highest, UNDER, towards):
        return False
    if filled or not has_gaps(front):
        return True
    return not _passes(front, back, x, y, towards)


@allocating_kernel
def _opacity_rows(
    cloth: ClothSide, columns: WideQueries, index: Index, limits: Limits, seed: np.uint64, filled: bool
) -> tuple[Float64, Float64]:
    """Return opacities and their standard errors (N,): ratios of randomisations' sums, doubled up to the tolerance."""
    rows = len(index)
    open_cloth = has_gaps(cloth.front) and not filled
    means, errors = np.zeros(rows), np.zeros(rows)
    sums = np.zeros((RANDOMISATIONS, 2))
    for row in range(rows):
        wo = columns.wo[row]
        if wo[2] <= 0.0:
            continue
        towards = ray(-wo[0], -wo[1], -wo[2], columns.curvature[row])
        fall = cloth.front.highest - cloth.front.lowest
        if not open_cloth and towards.rise * towards.rise >= 2.0 * towards.bend * fall:
            means[row] = 1.0  # the ray sinks below every yarn
            continue
        key = derive(seed, index[row])
        sums[:] = 0.0
        hit, done, target = 0, 0, limits.min_count // RANDOMISATIONS
        while True:
            for r in range(RANDOMISATIONS):
                randomisation = derive(key, r)
                for k in range(done, target):
                    first, second = owen_pair(randomisation, k)
                    x, y, weight = place_point(columns, row, cloth, first, second)
                    sums[r, 1] += weight
                    if hits(cloth.front, cloth.back, x, y, towards, filled):
                        sums[r, 0] += weight
                        hit += 1
            done = target
            points = done * RANDOMISATIONS
            total = sums[:, 1].sum()
            means[row] = sums[:, 0].sum() / total
            if hit == 0 or hit == points:
                # Points that all agree have no spread: the standard deviation by the rule of succession.
                errors[row] = math.sqrt((points + 1.0) / (points + 3.0)) / (points + 2.0)
            else:
                spread = 0.0
                for r in range(RANDOMISATIONS):
                    spread += (sums[r, 0] - means[row] * sums[r, 1]) ** 2
                errors[row] = math.sqrt(spread * RANDOMISATIONS / (RANDOMISATIONS - 1)) / total
            if errors[row] <= limits.relative_error or points >= limits.max_count:
                break
            target = 2 * done
    return means, errors


def opacity(
    fabric: Fabric, queries: Queries, options: TruthOptions, seed: int, start: int = 0, filled: bool = False
) -> tuple[Float32, Float32]:
    """Return the share of a footprint's camera rays that hit any yarn before they leave the boundary, and its error.

    Both are float32 (N,); the standard error is 0 only where the answer is known without sampling. Always from `owen`
    points, with shadows; `relative_error` is taken of full opacity. `wi` plays no part; `wo` may have any sign: with
    wo.z <= 0 a ray leaves the boundary where it enters, which is an opacity of 0. Seed, start and errors are as in
    `pipeline.truth.estimator.estimate`. With `filled` gaps stop rays, too.
    """
    # Viewers at or beyond the horizon are no fault here, so they are lifted above it for the check.
    lifted = queries.wo.copy()
    lifted[:, 2] = np.maximum(np.abs(lifted[:, 2]), np.float32(1e-30))
    validate(queries._replace(wi=lifted, wo=lifted))
    index = start + np.arange(len(queries.u))
    columns = columns_of(queries._replace(wi=lifted))
    mean, error = _opacity_rows(cloth_side(fabric, options), columns, index, options.limits, np.uint64(seed), filled)
    return mean.astype(np.float32), error.astype(np.float32)


def coverage(fabric: Fabric, queries: Queries, options: TruthOptions, seed: int) -> tuple[Float32, Float32]:
    """Return the share of a footprint's camera rays that do not leave the boundary again, and its error.

    As `opacity`, from the same rays, but gaps count as filled: it is 1 for flat cloth.
    """
    return opacity(fabric, queries, options, seed, filled=True)


@allocating_kernel
def _grazing_rows(field: HeightField, u: Float64, v: Float64, azimuth: Float64, curvature: Float64) -> Float64:
    picks, ends = field.top.shape
    cosines = np.zeros(len(u))
    for row in range(len(u)):
        x, y = wrap(u[row], ends), wrap(v[row], picks)
        dx, dy = -math.cos(azimuth[row]), -math.sin(azimuth[row])
        # Bisection in the tangent of the angle to the boundary; at the upper end the ray sinks below every yarn.
        low, high = 0.0, math.sqrt(2.0 * curvature[row] * (field.highest - field.lowest))
        for _ in range(_BISECTIONS):
            middle = 0.5 * (low + high)
            flat = 1.0 / math.sqrt(1.0 + middle * middle)
            if visible(field, x, y, field.highest, UNDER, ray(dx * flat, dy * flat, -middle * flat, curvature[row])):
                low = middle
            else:
                high = middle
        cosines[row] = high / math.sqrt(1.0 + high * high)
    return cosines


def grazing_cosine(
    fabric: Fabric, u: npt.ArrayLike, v: npt.ArrayLike, azimuth: npt.ArrayLike, curvature: npt.ArrayLike
) -> Float64:
    """Return the cosine of the viewer's angle to the normal at which a ray just touches the cloth.

    At one point of a cloth without gaps, opacity is a step in the cosine: 0 below this one, 1 above. It is never
    negative, because a ray enters the boundary from outside; it is 0 for flat cloth, into which every ray sinks, and on
    a crest, which touches the boundary. Gaps count as filled to the height of the lowest yarn, so that a ray that would
    pass through one has a cosine too.

    The ray enters the boundary at (u, v), any place in yarn spacings, from the viewer's `azimuth`, the angle from x in
    radians, and kappa along it is `curvature`, 1/yarn spacings, 0 <= kappa <= 1. All are broadcast; cosines are in
    [0, 1).
    """
    columns = np.broadcast_arrays(*(np.asarray(column, np.float64) for column in (u, v, azimuth, curvature)))
    flat = [np.ascontiguousarray(column).reshape(-1) for column in columns]
    cosines = _grazing_rows(cloth_side(fabric, TruthOptions()).front, *flat)
    return np.asarray(cosines.reshape(columns[0].shape))
