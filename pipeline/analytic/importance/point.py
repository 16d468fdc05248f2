"""Exact importance sampling of one point: the direction that a flake mirrors to [Heitz2015SGGX].

`given` is the direction at hand, wi or wo; `sampled` is the other one. Flakes met along `given` have normals m with
density D(m) <given.m> / sigma(given): seen through S^(1/2) = I - (1 - alpha) t t^T they are the visible half of a
sphere, so a cosine-distributed n about d = S^(1/2) given makes m = S^(1/2) n, and given mirrored in m is the sample:

    pdf    = D(h) / (4 sigma(given)) over the whole sphere: reflection and transmission at once
    weight = Lambda_given / (Lambda_given + Lambda_sampled) (1 - exp(-T (Lambda_given + Lambda_sampled))), reflected
           = Lambda_given T exp(-T min Lambda) phi(T |Lambda_given - Lambda_sampled|), transmitted, phi as in the slab

The weight is f |cos_sampled| / pdf: the chance that light meets a flake of the layer and leaves without a second one.
D is no part of it, so it stays exact where the half vector is lost, at sampled = -given. Light that goes straight
through, exp(-T Lambda), is not sampled here.
"""

from __future__ import annotations

import math

from pipeline.compiled.decorators import kernel
from pipeline.truth.scattering.microflake import density, sigma


@kernel
def _squeeze(
    wx: float, wy: float, wz: float, tx: float, ty: float, tz: float, alpha: float
) -> tuple[float, float, float, float]:
    """Return S^(1/2) w, normalised, and the length it had, which is sigma(w).

    t x (w x t) + alpha (w.t) t, unlike w - (1 - alpha)(w.t) t, keeps every digit near the fibre axis.
    """
    cx, cy, cz = wy * tz - wz * ty, wz * tx - wx * tz, wx * ty - wy * tx
    along = alpha * (wx * tx + wy * ty + wz * tz)
    x = ty * cz - tz * cy + along * tx
    y = tz * cx - tx * cz + along * ty
    z = tx * cy - ty * cx + along * tz
    length = math.sqrt(x * x + y * y + z * z)
    return x / length, y / length, z / length, length


@kernel
def _sample_cosine(dx: float, dy: float, dz: float, first: float, second: float) -> tuple[float, float, float]:
    """Return a unit n with density <n.d> / pi about unit d; n.d = sqrt(1 - first).

    Drawn about the pole farther from d, then mirrored in the plane between the two: nothing cancels, and no d is
    special.
    """
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

    Parameters
    ----------
    wx, wy, wz : float
        Unit direction at hand, wi or wo, away from the surface.
    tx, ty, tz : float
        Unit fibre tangent.
    alpha : float
        Roughness, (0, 1].
    first, second : float
        Random numbers in [0, 1).
    """
    dx, dy, dz, projected = _squeeze(wx, wy, wz, tx, ty, tz, alpha)
    nx, ny, nz = _sample_cosine(dx, dy, dz, first, second)
    mx, my, mz, length = _squeeze(nx, ny, nz, tx, ty, tz, alpha)
    # w.m, which is positive by construction: as a dot product it would cancel where flakes are seen edge-on.
    facing = projected * math.sqrt(1.0 - first) / length
    x, y, z = 2.0 * facing * mx - wx, 2.0 * facing * my - wy, 2.0 * facing * mz - wz
    scale = 1.0 / math.sqrt(x * x + y * y + z * z)
    return x * scale, y * scale, z * scale


@kernel
def flake_scatter_pdf(
    wx: float, wy: float, wz: float, sx: float, sy: float, sz: float, tx: float, ty: float, tz: float, alpha: float
) -> float:
    """Return the density, in 1/sr, with which `sample_flake_scatter` finds unit s when w is given.

    Its integral over the sphere is 1. At s = -w, where no half vector exists, it is 0.
    """
    return density(wx + sx, wy + sy, wz + sz, tx, ty, tz, alpha) / (4.0 * sigma(wx, wy, wz, tx, ty, tz, alpha))


@kernel
def flake_scatter_weight(
    sigma_given: float, sigma_sampled: float, cos_given: float, cos_sampled: float, thickness: float
) -> float:
    """Return f |cos_sampled| / pdf for unit k_s, in [0, 1].

    Parameters
    ----------
    sigma_given, sigma_sampled : float
        Projected flake areas towards both directions.
    cos_given, cos_sampled : float
        Their SIGNED cosines to the slab's normal, of one sign for reflection; cos_given is not 0.
    thickness : float
        Optical thickness T > 0.
    """
    given, sampled = abs(cos_given), abs(cos_sampled)
    lambda_given, lambda_sampled = sigma_given / given, sigma_sampled / sampled
    if cos_given * cos_sampled > 0.0:
        share = sigma_given * sampled / (sigma_given * sampled + sigma_sampled * given)
        return -share * math.expm1(-thickness * (lambda_given + lambda_sampled))
    apart = thickness * abs(lambda_given - lambda_sampled)
    phi = -math.expm1(-apart) / apart if apart > 0.0 else 1.0
    return min(1.0, lambda_given * thickness * math.exp(-thickness * min(lambda_given, lambda_sampled)) * phi)
