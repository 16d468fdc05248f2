"""Formulas in use for light straight through shades, with the openness as their only number: rivals of a fit.

Angles are in degrees. `theta` is to the normal; profile angles are those of the direction's projections onto the planes
across warp and weft.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Final

import numpy as np

from pipeline.compiled.arrays import Float64

Formula = Callable[[float, Float64, Float64], Float64]
"""Function of the openness and of theta and azimuth, (N,)."""


def cosine(openness: float, theta: Float64, azimuth: Float64) -> Float64:
    """Return the openness times the cosine."""
    return np.asarray(openness * np.cos(np.radians(theta)))


def roller_blind(openness: float, theta: Float64, azimuth: Float64) -> Float64:
    """Return the form of EnergyPlus for roller blinds, with a cut-off angle that the openness sets."""
    c = math.cos(0.5 * math.pi * openness)
    turn = np.minimum(theta / (90.0 - 25.0 * c), 1.0)
    return np.where(turn < 1.0, openness * np.abs(np.cos(0.5 * math.pi * turn)) ** (0.6 * c**0.3), 0.0)


def woven_shade(openness: float, theta: Float64, azimuth: Float64) -> Float64:
    """Return the form of LBNL WINDOW: round threads of one diameter, evenly spaced in one plane."""
    covered = 1.0 - math.sqrt(openness)
    slope, turn = np.tan(np.radians(theta)), np.radians(azimuth)
    profiles = (np.hypot(1.0, slope * np.cos(turn)), np.hypot(1.0, slope * np.sin(turn)))
    return np.asarray(np.prod([np.maximum(1.0 - covered * secant, 0.0) for secant in profiles], axis=0))


RIVALS: Final[Mapping[str, Formula]] = MappingProxyType(
    {"cosine": cosine, "EnergyPlus roller blind": roller_blind, "LBNL WINDOW woven shade": woven_shade}
)
"""Formulas by what they are called."""
