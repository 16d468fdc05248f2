"""Hemispherical reflectance of a fabric: the share of an even sky's light that it sends to a viewer.

    rho(wo) = integral of f_P(wi, wo) d(wi) = mean of pi f_P / |cos theta_i| over directions drawn by the cosine

f_P is the ground truth of a patch of many repeats, for unit colours. Directions are an R2 sequence.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Final, NamedTuple

import numpy as np

from pipeline.compiled.arrays import Float64
from pipeline.truth.estimator import estimate
from pipeline.truth.options import TruthOptions
from pipeline.truth.query import Queries
from weaves.fabric import Fabric
from weaves.surface import surface_maps

GRAZING: Final = 75.0
"""Angle of the grazing view to the normal, degrees."""

DIRECTIONS: Final = 512
"""Directions of light: the mean is good to about 1 %."""

_OPTIONS: Final = TruthOptions(estimator="owen", relative_error=0.03)
_AZIMUTHS: Final = (0.4, 1.2, 2.0, 2.8)


class Reflectance(NamedTuple):
    """Reflectance by family (warp, weft), unit colours, float64 (2,).

    Attributes
    ----------
    coverage : float64 (2,)
        Share of the area in which the family is seen from above.
    diffuse, specular, transmitted : float64 (2,)
        Diffuse and specular reflectance, and diffuse transmittance, towards a viewer on the normal; sums over the
        cloth, so that a family of little coverage has little.
    grazing_diffuse, grazing_specular : float64 (2,)
        Diffuse and specular reflectance towards a viewer at `GRAZING`, the mean over azimuths.
    """

    coverage: Float64
    diffuse: Float64
    specular: Float64
    transmitted: Float64
    grazing_diffuse: Float64
    grazing_specular: Float64

    def per_area(self, values: Float64) -> Float64:
        """Return sums over the cloth as values of the area in which a family is seen."""
        return np.asarray(np.divide(values, self.coverage, out=np.zeros(2), where=self.coverage > 0.0))


def even_sky(count: int) -> Float64:
    """Return directions of the upper hemisphere, drawn in proportion to their cosine, float64 (count, 3)."""
    steps = np.arange(1, count + 1)[:, None] * (0.7548776662466927, 0.5698402909980532)
    square, turn = ((0.5 + steps) % 1.0).T
    z, turn = np.sqrt(np.maximum(square, 1e-6)), 2.0 * math.pi * turn
    sine = np.sqrt(1.0 - z * z)
    return np.stack([sine * np.cos(turn), sine * np.sin(turn), z], axis=-1)


@lru_cache(maxsize=64)
def reflectance(fabric: Fabric) -> Reflectance:
    """Integrate the ground truth of a fabric; colours do not matter."""
    wi = even_sky(DIRECTIONS)
    sine, cosine = math.sin(math.radians(GRAZING)), math.cos(math.radians(GRAZING))
    above = _components(fabric, wi, (0.0, 0.0, 1.0))
    through = _components(fabric, wi * (1.0, 1.0, -1.0), (0.0, 0.0, 1.0))
    grazing = np.mean(
        [_components(fabric, wi, (sine * math.cos(a), sine * math.sin(a), cosine)) for a in _AZIMUTHS], axis=0
    )
    return Reflectance(_coverage(fabric), above[2:], above[:2], through[2:], grazing[2:], grazing[:2])


def _components(fabric: Fabric, wi: Float64, viewer: tuple[float, float, float]) -> Float64:
    """Return the reflectance of the four components."""
    # A Gaussian of a standard deviation of one repeat or more averages over the repeat.
    sigma = 2.0 * max(fabric.weave.repeat)
    none = np.zeros(len(wi))
    queries = Queries.round(none, none, np.full(len(wi), sigma), wi, np.tile(viewer, (len(wi), 1)))
    mean = estimate(fabric, queries, _OPTIONS, seed=0).mean.astype(np.float64)
    return np.asarray((mean * (math.pi / np.abs(wi[:, 2:]))).mean(axis=0))


def _coverage(fabric: Fabric) -> Float64:
    """Return the share of the area in which each family is seen from above."""
    yarn = surface_maps(fabric, max(8, min(64, 1024 // max(fabric.weave.repeat)))).yarn
    return np.array([float((yarn == family).mean()) for family in range(2)])
