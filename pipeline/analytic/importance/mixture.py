"""Directions drawn from the lobes of patches, and their densities.

With c the cosine of wi and near the side of the viewer:

    pdf(wi) = P_near |c| / pi + sum_k p_k(wi) + (1 - STRAIGHT_ON) p_k(wi mirrored in the fabric plane)  on the near side
            = P_far |c| / pi + STRAIGHT_ON sum_k p_k(wi)                                               on the far side

with p_k = P_k D_k(h) / (4 sigma_k(wo)), the density of light mirrored by the flakes of lobe k [Heitz2015SGGX]. Flakes
send a third of it and more to the far side, where the layer and other yarns take most of it: all but the share
STRAIGHT_ON is mirrored back. With P_straight light goes straight through, wi = -wo, which has no density. The integral
of pdf over the sphere is 1 - P_straight.

A single point is sampled exactly, by the direction that a flake mirrors to. `given` is the direction at hand, wi or wo;
`sampled` is the other one. Flakes met along `given` have normals m with density D(m) <given.m> / sigma(given): seen
through S^(1/2) = I - (1 - alpha) t t^T they are the visible half of a sphere, so a cosine-distributed n about
d = S^(1/2) given makes m = S^(1/2) n, and given mirrored in m is the sample:

    pdf = D(h) / (4 sigma(given)) over the whole sphere: reflection and transmission at once
"""

import math
from typing import Final

import numpy as np

from pipeline.analytic.importance.lobes import FAR, HEIGHT, NEAR, SHARE, SQUARE, STRAIGHT, TX, TY, TZ, Lobes
from pipeline.compiled.arrays import Float32, Float64, Mask
from pipeline.compiled.decorators import inlined_fast_kernel, kernel


@kernel
def _squeeze(
    wx: float, wy: float, wz: float, tx: float, ty: float, tz: float, alpha: float
) -> tuple[float, float, float, float]:
    """Return S^(1/2) w, normalised, and the length it had, which is sigma(w)."""
    # t x (w x t) + alpha (w.t) t, unlike w - (1 - alpha)(w.t) t, keeps every digit near the fibre axis.
    cx, cy, cz = wy * tz - wz * ty, wz * tx - wx * tz, wx * ty - wy * tx
    along = alpha * (wx * tx + wy * ty + wz * tz)
    x = ty * cz - tz * cy + along * tx
    y = tz * cx - tx * cz + along * ty
    z = tx * cy - ty * cx + along * tz
    length = math.sqrt(x * x + y * y + z * z)
    return x / length, y / length, z / length, length


@kernel
def _sample_cosine(dx: float, dy: float, dz: float, first: float, second: float) -> tuple[float, float, float]:
    """Return a unit n with density <n.d> / pi about unit d; n.d = sqrt(1 - first)."""
    # About the pole farther from d, then mirrored in the plane between the two: nothing cancels, no d is special.
    pole = -1.0 if dz >= 0.0 else 1.0
    radius, azimuth = math.sqrt(first), 2.0 * math.pi * second
    x, y, z = radius * math.cos(azimuth), radius * math.sin(azimuth), pole * math.sqrt(1.0 - first)
    uz = dz - pole
    share = (dx * x + dy * y + uz * z) / (1.0 + abs(dz))
    return x - share * dx, y - share * dy, z - share * uz


@kernel
def sample_flake_scatter(
    wx: float, wy: float, wz: float, tx: float, ty: float, tz: float, alpha: float, first: float, second: float
) -> tuple[float, float, float]:
    """Return a unit direction with density D(h) / (4 sigma(w)), h the half vector with w.

    w is the unit direction at hand, wi or wo, away from the surface; t the unit fibre tangent; alpha the roughness, (0,
    1]; `first` and `second` are random numbers in [0, 1).
    """
    dx, dy, dz, projected = _squeeze(wx, wy, wz, tx, ty, tz, alpha)
    nx, ny, nz = _sample_cosine(dx, dy, dz, first, second)
    mx, my, mz, length = _squeeze(nx, ny, nz, tx, ty, tz, alpha)
    # w.m, which is positive by construction: as a dot product it would cancel where flakes are seen edge-on.
    facing = projected * math.sqrt(1.0 - first) / length
    x, y, z = 2.0 * facing * mx - wx, 2.0 * facing * my - wy, 2.0 * facing * mz - wz
    scale = 1.0 / math.sqrt(x * x + y * y + z * z)
    return x * scale, y * scale, z * scale


STRAIGHT_ON: Final = 0.3  # share of the flakes' light to the far side that is left there

LEAST_COSINE: Final = 1e-6  # least |wi.n_s| of a sample: none lies in the fabric plane

_0, _1, _INVERSE_PI = np.float32(0.0), np.float32(1.0), np.float32(1.0 / math.pi)
_MIRRORED = np.float32(1.0 - STRAIGHT_ON)
_SHORTEST = np.float32(1e-14)  # least squared length of a half vector


@kernel
def draw_rows(lobes: Lobes, wo: Float32, random: Float64, wi: Float32, pdf: Float32, straight: Mask) -> None:
    """Write a unit wi for each look from three numbers in [0, 1), its density, and whether it is straight through.

    In place of a density, what goes straight through has the probability of this.
    """
    for n in range(len(wo)):
        x, y, z, through = _draw(lobes.flakes[n], lobes.rest[n], wo[n], random[n, 0], random[n, 1], random[n, 2])
        wi[n, 0], wi[n, 1], wi[n, 2] = x, y, z
        straight[n] = through
        pdf[n] = lobes.rest[n, STRAIGHT] if through else _density(lobes.flakes[n], lobes.rest[n], wi[n], wo[n])


@kernel
def density_rows(lobes: Lobes, wi: Float32, wo: Float32, pdf: Float32) -> None:
    """Write the density with which `draw_rows` finds each unit wi, (N,), in 1/sr over the whole sphere."""
    for n in range(len(wo)):
        pdf[n] = _density(lobes.flakes[n], lobes.rest[n], wi[n], wo[n])


@kernel
def _draw(
    flakes: Float32, rest: Float32, wo: Float32, pick: float, first: float, second: float
) -> tuple[float, float, float, bool]:
    """Return a unit wi, and whether it is straight through."""
    ox, oy, oz = np.float64(wo[0]), np.float64(wo[1]), np.float64(wo[2])
    near = 1.0 if oz > 0.0 else -1.0
    if pick < rest[STRAIGHT]:
        return -ox, -oy, -oz, True
    pick -= rest[STRAIGHT]
    for k in range(flakes.shape[1]):
        share = np.float64(flakes[SHARE, k])
        if pick < share:
            tx, ty, tz = np.float64(flakes[TX, k]), np.float64(flakes[TY, k]), np.float64(flakes[TZ, k])
            alpha = math.sqrt(np.float64(flakes[SQUARE, k]))
            x, y, z = sample_flake_scatter(ox, oy, oz, tx, ty, tz, alpha, first, second)
            # What is left of the first number is even in [0, 1) again.
            if z * near < 0.0 and pick >= STRAIGHT_ON * share:
                z = -z
            return x, y, math.copysign(max(abs(z), LEAST_COSINE), z), False
        pick -= share
    side = near if pick < rest[NEAR] else -near
    radius, turn = math.sqrt(first), 2.0 * math.pi * second
    z = max(math.sqrt(max(1.0 - first, 0.0)), LEAST_COSINE)
    return radius * math.cos(turn), radius * math.sin(turn), side * z, False


@inlined_fast_kernel
def _density(flakes: Float32, rest: Float32, wi: Float32, wo: Float32) -> np.float32:
    """Return the density of wi."""
    iz, oz = wi[2], wo[2]
    hx, hy, hz, mirrored_z = wi[0] + wo[0], wi[1] + wo[1], iz + oz, oz - iz
    flat = hx * hx + hy * hy
    inverse = _1 / max(flat + hz * hz, _SHORTEST)
    inverse_mirrored = _1 / max(flat + mirrored_z * mirrored_z, _SHORTEST)
    own, mirrored = _0, _0
    for k in range(flakes.shape[1]):
        level, square = hx * flakes[TX, k] + hy * flakes[TY, k], flakes[SQUARE, k]
        along, along_mirrored = level + hz * flakes[TZ, k], level + mirrored_z * flakes[TZ, k]
        q = square + (_1 - square) * along * along * inverse
        q_mirrored = square + (_1 - square) * along_mirrored * along_mirrored * inverse_mirrored
        own += flakes[HEIGHT, k] / (q * q)
        mirrored += flakes[HEIGHT, k] / (q_mirrored * q_mirrored)
    if iz * oz > _0:
        near: np.float32 = rest[NEAR] * abs(iz) * _INVERSE_PI + own + _MIRRORED * mirrored
        return near
    far: np.float32 = rest[FAR] * abs(iz) * _INVERSE_PI + (_1 - _MIRRORED) * own
    return far
