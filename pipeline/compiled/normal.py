"""The standard normal distribution: its quantile in double precision, its distribution function in single."""

import math

import numpy as np

from pipeline.compiled.decorators import fast_kernel, inlined_kernel
from pipeline.compiled.float32 import remaining

# Acklam's rational approximation of the normal quantile [Acklam2003Quantile].
_A = (-39.69683028665376, 220.9460984245205, -275.9285104469687,
    138.3577518672690, -30.66479806614716, 2.506628277459239)  # fmt: skip
_B = (-54.47609879822406, 161.5858368580409, -155.6989798598866, 66.80131188771972, -13.28068155288572)
_C = (-0.007784894002430293, -0.3223964580411365, -2.400758277161838,
    -2.549732539343734, 4.374664141464968, 2.938163982698783)  # fmt: skip
_D = (0.007784695709041462, 0.3224671290700398, 2.445134137142996, 3.754408661907416)
_TAIL = 0.02425


@inlined_kernel
def _rational(t: float) -> float:
    return (((((_C[0] * t + _C[1]) * t + _C[2]) * t + _C[3]) * t + _C[4]) * t + _C[5]) / (
        (((_D[0] * t + _D[1]) * t + _D[2]) * t + _D[3]) * t + 1.0
    )


@inlined_kernel
def normal_quantile(p: float) -> float:
    """Return the standard normal quantile of p, 0 < p < 1, to 1.2e-9 relative; centres of footprints are float32."""
    if p < _TAIL:
        return _rational(math.sqrt(-2.0 * math.log(p)))
    if p > 1.0 - _TAIL:
        return -_rational(math.sqrt(-2.0 * math.log1p(-p)))
    q = p - 0.5
    r = q * q
    return (
        (((((_A[0] * r + _A[1]) * r + _A[2]) * r + _A[3]) * r + _A[4]) * r + _A[5])
        * q
        / (((((_B[0] * r + _B[1]) * r + _B[2]) * r + _B[3]) * r + _B[4]) * r + 1.0)
    )


_NORMAL = tuple(np.float32(c) for c in (0.2316419, 0.319381530, -0.356563782, 1.781477937, -1.821255978, 1.330274429))
_ROOT = np.float32(1.0 / math.sqrt(2.0 * math.pi))


@fast_kernel
def normal_distribution(x: np.float32) -> np.float32:
    """Return the mass of the standard normal distribution below x, to 2e-7 [Abramowitz1964Handbook, 26.2.17]."""
    size = abs(x)
    t = np.float32(1.0) / (np.float32(1.0) + _NORMAL[0] * size)
    series = t * (_NORMAL[1] + t * (_NORMAL[2] + t * (_NORMAL[3] + t * (_NORMAL[4] + t * _NORMAL[5]))))
    tail = _ROOT * remaining(np.float32(0.5) * size * size) * series
    return tail if x < np.float32(0.0) else np.float32(1.0) - tail
