"""The point model in single precision and without branches: what vector units run.

The formulas are those of microflake and slab. What differs is the exponential: libm's is a call, this one is
arithmetic. All constants are typed, because numba computes float32 times a literal in float64.

    exp(-x) = 2^-n (1 - q),  n = x / ln 2 rounded,  q = 1 - exp(-r),  r = x - n ln 2, |r| <= ln 2 / 2

1 - exp(-x) = (1 - 2^-n) + 2^-n q keeps every digit of a thin layer, where n = 0.
"""

import math

import numpy as np

from pipeline.compiled.decorators import fast_kernel, fused_kernel

_0, _1, _HALF = np.float32(0.0), np.float32(1.0), np.float32(0.5)
_DEEPEST = np.float32(87.0)  # exp(-87) is the least that single precision holds with all its digits
_HALVINGS = np.float32(1.4426950408889634)  # 1 / ln 2
# ln 2 in two parts: the first has so few digits that its products with n are exact.
_LN2, _LN2_REST = np.float32(0.693359375), np.float32(-2.1219444e-4)
_BIAS, _MANTISSA = np.int32(127), np.int32(23)  # of the format: (127 + exponent) << 23 are the bits of 2^exponent
_RIGHT = np.float32(0.5 * math.pi)
_AS0, _AS1, _AS2, _AS3 = (np.float32(c) for c in (1.5707288, -0.2121144, 0.0742610, -0.0187293))
_C2, _C3, _C4, _C5, _C6, _C7 = (np.float32(c) for c in (-1 / 2, 1 / 6, -1 / 24, 1 / 120, -1 / 720, 1 / 5040))


# Not a fast kernel: what it subtracts must not be regrouped.
@fused_kernel
def _halved(depth: np.float32) -> tuple[np.float32, np.float32]:
    """Return 2^-n and q, of which exp(-depth) = 2^-n (1 - q) is made."""
    x = min(depth, _DEEPEST)
    n = np.int32(x * _HALVINGS + _HALF)
    turns = np.float32(n)
    r = (x - turns * _LN2) - turns * _LN2_REST
    q = r * (_1 + r * (_C2 + r * (_C3 + r * (_C4 + r * (_C5 + r * (_C6 + r * _C7))))))
    power = np.int32((_BIAS - n) << _MANTISSA)
    return power.view(np.float32), q


@fused_kernel
def _absorbed(depth: np.float32) -> np.float32:
    power, q = _halved(depth)
    return (_1 - power) + power * q


@fast_kernel
def absorbed(depth: np.float32) -> np.float32:
    """Return 1 - exp(-depth) for depth >= 0, to 2e-7 relative."""
    return _absorbed(depth)


@fast_kernel
def remaining(depth: np.float32) -> np.float32:
    """Return exp(-depth) for depth from 0 to 87, to 3e-7 relative; 1.6e-38 beyond."""
    power, q = _halved(depth)
    return power * (_1 - q)


@fast_kernel
def arcsine(x: np.float32) -> np.float32:
    """Return asin x to 7e-5 [Abramowitz1964Handbook, 4.4.45]."""
    size = min(abs(x), _1)
    angle = _RIGHT - np.sqrt(_1 - size) * (_AS0 + size * (_AS1 + size * (_AS2 + size * _AS3)))
    signed: np.float32 = angle if x >= _0 else -angle
    return signed
