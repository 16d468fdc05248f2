"""One layer of microflakes: how much light a yarn of optical thickness T scatters once [Wang2022SpongeCake].

With Lambda = sigma / |cos|, cosines to the slab's normal:

    f_r = D (1 - exp(-T (Lambda_i + Lambda_o))) / (4 (sigma_i cos_o + sigma_o cos_i))
    f_t = D T exp(-T min(Lambda_i, Lambda_o)) phi(T |Lambda_i - Lambda_o|) / (4 cos_i cos_o), phi(x) = (1 - exp(-x)) / x
    exp(-T Lambda_i) goes straight through and is no part of f_t.
"""

from __future__ import annotations

import math

from pipeline.compiled.decorators import inlined_kernel


@inlined_kernel
def reflection(flakes: float, sigma_i: float, sigma_o: float, cos_i: float, cos_o: float, thickness: float) -> float:
    """Return f_r without the incident cosine, for unit k_s, in 1/sr.

    Parameters
    ----------
    flakes : float
        The flake density D at the half vector.
    sigma_i, sigma_o : float
        Projected flake areas towards light and viewer.
    cos_i, cos_o : float
        Cosines to the slab's normal, > 0.
    thickness : float
        Optical thickness T > 0.
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
