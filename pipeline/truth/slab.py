"""One layer of microflakes: how much light a yarn of optical thickness T scatters once [Wang2022SpongeCake].

With Lambda = sigma / |cos|, cosines to the ply normal: f_r = D (1 - exp(-T (Lambda_i + Lambda_o))) / (4 (sigma_i cos_o
+ sigma_o cos_i)).
"""

from __future__ import annotations

import math

from pipeline.truth.kernel import kernel


@kernel
def reflection(flakes: float, sigma_i: float, sigma_o: float, cos_i: float, cos_o: float, thickness: float) -> float:
    """Return f_r without the incident cosine, for unit k_s, in 1/sr.

    Parameters
    ----------
    flakes : float
        The flake density D at the half vector.
    sigma_i, sigma_o : float
        Projected flake areas towards light and viewer.
    cos_i, cos_o : float
        Cosines to the ply normal, > 0.
    thickness : float
        Optical thickness T > 0.
    """
    depth = thickness * (sigma_i / cos_i + sigma_o / cos_o)
    # expm1 keeps thin layers: 1 - exp(-depth) loses every digit at T = .001.
    return -flakes * math.expm1(-depth) / (4.0 * (sigma_i * cos_o + sigma_o * cos_i))
