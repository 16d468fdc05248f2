"""The slab in single precision and without branches, for loops over many points.

The formulas are those of `slab`, multiplied by both cosines, so that grazing directions need no division by a cosine
near 0. The flake density D comes as a quotient, D / 4 = flakes / spread: one division then serves all. The exponentials
are those of pipeline.compiled.float32. All constants are typed, because numba computes float32 times a literal in
float64. Array elements, not arrays, are passed in: the functions are inlined into the caller's loop.
"""

import numpy as np

from pipeline.compiled.decorators import inlined_fast_kernel
from pipeline.compiled.float32 import absorbed, remaining

_0, _1 = np.float32(0.0), np.float32(1.0)
_TINY = np.float32(1e-30)  # keeps 1 / 0 finite; far below what it is added to, flakes of roughness 0.01 included
_ALIKE = np.float32(1e-8)  # difference of optical depths below which (1 - exp(-x)) / x is 1 to all digits
_GRAZING = np.float32(1e-6)  # least cosine in an optical depth


@inlined_fast_kernel
def reflection(
    flakes: np.float32, spread: np.float32, sigma_i: np.float32, sigma_o: np.float32, cos_i: np.float32,
    cos_o: np.float32, thickness: np.float32,
) -> np.float32:  # fmt: skip
    """Return f_r cos_i cos_o for unit k_s, in 1/sr; 0 where a cosine, >= 0, is 0.

    `flakes` and `spread` are numerator and denominator of a quarter of the flake density at the half vector.
    """
    crossed = sigma_i * cos_o + sigma_o * cos_i
    # One division serves 1 / (cos_i cos_o) and 1 / (spread crossed).
    cosines, divisor = cos_i * cos_o, spread * crossed
    both = _1 / (cosines * divisor + _TINY)
    depth = thickness * crossed * divisor * both
    return flakes * cosines * cosines * both * absorbed(depth)


@inlined_fast_kernel
def transmission(
    flakes: np.float32, spread: np.float32, sigma_i: np.float32, sigma_o: np.float32, cos_i: np.float32,
    cos_o: np.float32, thickness: np.float32,
) -> np.float32:  # fmt: skip
    """Return f_t cos_i cos_o for unit k_s, in 1/sr; parameters as `reflection`, with the moduli of the cosines."""
    lambda_i, lambda_o = sigma_i / max(cos_i, _GRAZING), sigma_o / max(cos_o, _GRAZING)
    apart = max(thickness * abs(lambda_i - lambda_o), _ALIKE)
    through = remaining(thickness * min(lambda_i, lambda_o)) * absorbed(apart) / apart
    value = flakes * thickness * through / (spread + _TINY)
    return value if cos_i > _0 and cos_o > _0 else _0


@inlined_fast_kernel
def unscattered(sigma_o: np.float32, cos_o: np.float32, thickness: np.float32) -> np.float32:
    """Return the share of light that crosses the layer without meeting a flake, exp(-T Lambda)."""
    return remaining(thickness * sigma_o / max(cos_o, _GRAZING))
