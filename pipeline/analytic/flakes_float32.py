"""Fibre microflakes in single precision, by cosines with the tangent alone.

For unit vectors |w x t|^2 = 1 - (w.t)^2. Against the cross products of pipeline.truth.scattering.microflake this loses
digits near the fibre axis, which approximations can spare, and saves a third of the arithmetic.
"""

from __future__ import annotations

import numpy as np

from pipeline.compiled.decorators import inlined_fast_kernel

_1 = np.float32(1.0)


@inlined_fast_kernel
def sigma(along: np.float32, square: np.float32) -> np.float32:
    """Return the projected area of flakes of roughness alpha towards w; `along` is w.t, `square` alpha^2."""
    area: np.float32 = np.sqrt(max(_1 - (_1 - square) * along * along, square))
    return area


@inlined_fast_kernel
def spread(along: np.float32, size: np.float32, square: np.float32) -> np.float32:
    """Return q^2, of which D = alpha^3 / (pi q^2); `along` is (wi + wo).t, `size` 1 / |wi + wo|^2."""
    q = square + (_1 - square) * size * along * along
    return q * q
