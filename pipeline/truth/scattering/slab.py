"""One layer of fibre microflakes: how much light a yarn of optical thickness T scatters once [Wang2022SpongeCake].

A fibre of roughness alpha scatters like flakes whose normals lie near the plane across its tangent t, an SGGX
distribution with one long axis [Heitz2015SGGX]. Only t and alpha enter, never a frame or a matrix: the cross-product
forms of `sigma` and `density` stay exact near the fibre axis. Lambda = sigma / |cos|, cosines to the slab's normal:

    f_r = D (1 - exp(-T (Lambda_i + Lambda_o))) / (4 (sigma_i cos_o + sigma_o cos_i))
    f_t = D T exp(-T min(Lambda_i, Lambda_o)) phi(T |Lambda_i - Lambda_o|) / (4 cos_i cos_o), phi(x) = (1 - exp(-x)) / x
    exp(-T Lambda_i) goes straight through and is no part of f_t.
"""

import math

from pipeline.compiled.decorators import inlined_kernel


@inlined_kernel
def _across_along(wx: float, wy: float, wz: float, tx: float, ty: float, tz: float) -> tuple[float, float]:
    """Return |w x t|^2 and (w.t)^2."""
    cx, cy, cz = wy * tz - wz * ty, wz * tx - wx * tz, wx * ty - wy * tx
    along = wx * tx + wy * ty + wz * tz
    return cx * cx + cy * cy + cz * cz, along * along


@inlined_kernel
def sigma(wx: float, wy: float, wz: float, tx: float, ty: float, tz: float, alpha: float) -> float:
    """Return the projected area of the flakes towards unit w: sqrt(|w x t|^2 + alpha^2 (w.t)^2), in [alpha, 1]."""
    across, along = _across_along(wx, wy, wz, tx, ty, tz)
    return math.sqrt(across + alpha * alpha * along)


@inlined_kernel
def density(vx: float, vy: float, vz: float, tx: float, ty: float, tz: float, alpha: float) -> float:
    """Return D at the half vector of v = wi + wo, which need not be normalised, in 1/sr.

    D = alpha^3 |v|^4 / (pi (alpha^2 |v x t|^2 + (v.t)^2)^2), which is 1/(pi alpha q^2) with q = h^T S^-1 h and
    S = diag(1, 1, alpha^2). The denominator is divided by |v|^2 first, so that directions almost opposite do not
    underflow; v = 0, where no half vector exists, gives 0.
    """
    across, along = _across_along(vx, vy, vz, tx, ty, tz)
    square = vx * vx + vy * vy + vz * vz
    if square <= 0.0:
        return 0.0
    q = (alpha * alpha * across + along) / square
    return alpha * alpha * alpha / (math.pi * q * q)


@inlined_kernel
def reflection(flakes: float, sigma_i: float, sigma_o: float, cos_i: float, cos_o: float, thickness: float) -> float:
    """Return f_r without the incident cosine, for unit k_s, in 1/sr.

    `flakes` is the flake density D at the half vector, the sigmas are the projected areas of the flakes towards light
    and viewer, and the cosines, > 0, are to the slab's normal.
    """
    depth = thickness * (sigma_i / cos_i + sigma_o / cos_o)
    # expm1 keeps thin layers: 1 - exp(-depth) loses every digit at T = .001.
    return -flakes * math.expm1(-depth) / (4.0 * (sigma_i * cos_o + sigma_o * cos_i))


@inlined_kernel
def transmission(flakes: float, sigma_i: float, sigma_o: float, cos_i: float, cos_o: float, thickness: float) -> float:
    """Return f_t without the incident cosine; parameters as `reflection`, with the moduli of the cosines.

    The published difference of two exponentials over Lambda_i - Lambda_o is 0 / 0 at equal Lambda; this form is the
    same number, and smooth there.
    """
    lambda_i, lambda_o = sigma_i / cos_i, sigma_o / cos_o
    apart = thickness * abs(lambda_i - lambda_o)
    phi = -math.expm1(-apart) / apart if apart > 0.0 else 1.0
    return flakes * thickness * math.exp(-thickness * min(lambda_i, lambda_o)) * phi / (4.0 * cos_i * cos_o)


@inlined_kernel
def unscattered(sigma_o: float, cos_o: float, thickness: float) -> float:
    """Return the share of light that crosses the layer without meeting a flake, exp(-T Lambda)."""
    return math.exp(-thickness * sigma_o / cos_o)
