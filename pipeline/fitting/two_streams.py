"""Yarns as a diffusing layer of two streams [Kubelka1931Layer]: reflectance and transmittance from two numbers.

With s the scattering and a = 1 + absorption / scattering, b = sqrt(a^2 - 1):

    R = 1 / (a + b coth(b s))        T = b / (a sinh(b s) + b cosh(b s))

A dye changes the absorption alone, so two cloths of the same yarns share s. In the infrared, s is another.
"""

from __future__ import annotations

import math

from scipy.optimize import brentq

_MOST = 1e4  # a - 1


def layer(a: float, scattering: float) -> tuple[float, float]:
    """Return reflectance and transmittance of a layer."""
    b = math.sqrt(max(a * a - 1.0, 1e-12))
    if b * scattering > 300.0:
        return a - b, 0.0
    sinh, cosh = math.sinh(b * scattering), math.cosh(b * scattering)
    whole = a * sinh + b * cosh
    return sinh / whole, b / whole


def scattering_of(reflectance: float, transmittance: float) -> float:
    """Return the scattering of a layer; both shares are above 0 and below 1 together."""
    a = (1.0 + reflectance**2 - transmittance**2) / (2.0 * reflectance)
    b = math.sqrt(max(a * a - 1.0, 1e-12))
    return math.atanh(min(b * reflectance / (1.0 - a * reflectance), 1.0 - 1e-12)) / b


def transmittance_of(reflectance: float, scattering: float) -> float:
    """Return the transmittance of a layer of a reflectance; that of white yarns if these reflect less."""
    if layer(1.0, scattering)[0] <= reflectance:
        return layer(1.0, scattering)[1]
    a = brentq(lambda a: layer(a, scattering)[0] - reflectance, 1.0, _MOST)
    return layer(a, scattering)[1]
