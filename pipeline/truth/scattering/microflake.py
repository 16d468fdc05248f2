"""Fibre microflakes: an SGGX distribution with one long axis.

A fibre of roughness alpha scatters like flakes whose normals lie near the plane across its tangent t. Only t and alpha
enter, never a frame or a matrix: the cross-product forms below stay exact near the fibre axis. [Heitz2015SGGX],
[Wang2022SpongeCake]
"""

from __future__ import annotations

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
