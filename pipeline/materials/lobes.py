"""Reflectance of a fabric under an even sky, and lobes of a material in other programs that are to return the same.

The reflectance is the share of an even sky's light that the truth sends to a viewer, of a patch of many repeats in unit
colours; directions are an R2 sequence:

    rho(wo) = integral of f_P(wi, wo) d(wi) = mean of pi f_P / |cos theta_i| over directions drawn by the cosine

Lobes are anisotropic GGX and Charlie sheen:

    GGX      F D G / (4 cos_i cos_o),  D = 1 / (pi a_x a_y (h_x^2 / a_x^2 + h_y^2 / a_y^2 + h_z^2)^2)   [Heitz2015SGGX]
             G = 1 / (1 + L_i + L_o),  L = (sqrt(1 + (a_x^2 w_x^2 + a_y^2 w_y^2) / w_z^2) - 1) / 2,  Schlick's F
    Charlie  (2 + 1/a) sin(theta_h)^(1/a) / (2 pi) / (4 (cos_i + cos_o - cos_i cos_o)),  a the squared roughness
                                                                                     [Estevez2017Sheen]

A fibre of roughness alpha along x has the GGX distribution of a_x = alpha, a_y = 1: both densities are
proportional to (h_x^2 / alpha^2 + h_y^2 + h_z^2)^-2.
"""

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import Final, NamedTuple

import numpy as np

from pipeline.compiled.arrays import Float64
from pipeline.truth.estimator import estimate
from pipeline.truth.options import TruthOptions
from pipeline.truth.query import Queries
from weaves.fabric import Fabric
from weaves.surface import surface_maps

GRAZING_VIEW: Final = 75.0  # angle of the grazing view to the normal, degrees

SKY_DIRECTIONS: Final = 512  # directions of light: the mean is good to about 1 %

_OPTIONS: Final = TruthOptions(estimator="owen", relative_error=0.03)
_AZIMUTHS: Final = (0.4, 1.2, 2.0, 2.8)

SHEEN_ROUGHNESS: Final = 0.5  # roughness of the sheen, fixed

_LOBE_DIRECTIONS: Final = 4096
_SKY_VIEWS: Final = tuple(math.radians(a) for a in (5.0, 35.0, 65.0, 95.0, 125.0, 155.0))


class Reflectance(NamedTuple):
    """Reflectance by family (warp, weft), unit colours, float64 (2,)."""

    coverage: Float64  # share of the area in which the family is seen from above, (2,)
    diffuse: Float64
    specular: Float64
    transmitted: Float64
    """Diffuse and specular reflectance, and diffuse transmittance, towards a viewer on the normal; sums over the cloth,
    so that a family of little coverage has little, (2,)."""
    grazing_diffuse: Float64
    grazing_specular: Float64
    """Diffuse and specular reflectance towards a viewer at `GRAZING_VIEW`, the mean over azimuths, (2,)."""

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
    wi = even_sky(SKY_DIRECTIONS)
    normal = np.array([0.0, 0.0, 1.0])
    above = _components(fabric, wi, normal)
    through = _components(fabric, wi * (1.0, 1.0, -1.0), normal)
    grazing = np.mean([_components(fabric, wi, viewer) for viewer in grazing_views(_AZIMUTHS)], axis=0)
    yarn = surface_maps(fabric, max(8, min(64, 1024 // max(fabric.weave.repeat)))).yarn
    coverage = np.array([float((yarn == family).mean()) for family in range(2)])
    return Reflectance(coverage, above[2:], above[:2], through[2:], grazing[2:], grazing[:2])


def _components(fabric: Fabric, wi: Float64, viewer: Float64) -> Float64:
    """Return the reflectance of the four components."""
    # A Gaussian of a standard deviation of one repeat or more averages over the repeat.
    sigma = 2.0 * max(fabric.weave.repeat)
    none = np.zeros(len(wi))
    queries = Queries.round(none, none, np.full(len(wi), sigma), wi, np.tile(viewer, (len(wi), 1)))
    mean = estimate(fabric, queries, _OPTIONS, seed=0).mean.astype(np.float64)
    return np.asarray((mean * (math.pi / np.abs(wi[:, 2:]))).mean(axis=0))


def ggx_density(half: Float64, along: float, across: float) -> Float64:
    """Return D at unit half vectors (N, 3), (N,), in 1/sr; parameters as for `ggx`."""
    scaled = half / (along, across, 1.0)
    return np.asarray(1.0 / (math.pi * along * across * (scaled**2).sum(axis=-1) ** 2))


def ggx(wi: Float64, wo: Float64, along: float, across: float, f0: Float64) -> Float64:
    """Return the GGX lobe without the incident cosine, float64 (N, 3), 1/sr.

    `wi` (N, 3) and `wo` (3,) lie in the frame of fibre (x), across it (y) and normal (z), wi.z > 0; roughness is a_x
    `along` and a_y `across`, `f0` (3,) the reflectance at normal incidence.
    """
    half = wi + wo
    half /= np.linalg.norm(half, axis=-1, keepdims=True)

    def masking(w: Float64) -> Float64:
        slopes = ((along * w[..., 0]) ** 2 + (across * w[..., 1]) ** 2) / w[..., 2] ** 2
        return np.asarray(0.5 * (np.sqrt(1.0 + slopes) - 1.0))

    common = ggx_density(half, along, across) / (1.0 + masking(wi) + masking(wo)) / (4.0 * wi[:, 2] * wo[2])
    fresnel = f0 + (1.0 - f0) * ((1.0 - np.clip(half @ wo, 0.0, 1.0)) ** 5)[:, None]
    return np.asarray(fresnel * common[:, None])


def charlie(wi: Float64, wo: Float64) -> Float64:
    """Return the lobe of a white sheen without the incident cosine, (N,), in 1/sr; parameters as for `ggx`."""
    half = wi + wo
    half /= np.linalg.norm(half, axis=-1, keepdims=True)
    inverse = 1.0 / SHEEN_ROUGHNESS**2
    sine = np.sqrt(np.maximum(1.0 - half[:, 2] ** 2, 0.0))
    density = (2.0 + inverse) * sine**inverse / (2.0 * math.pi)
    return np.asarray(density / (4.0 * (wi[:, 2] + wo[2] - wi[:, 2] * wo[2])))


def ggx_reflectance(along: float, across: float, f0: Float64) -> Float64:
    """Return the hemispherical reflectance of GGX at the grazing view, the mean over azimuths, (3,)."""
    wi = even_sky(_LOBE_DIRECTIONS)
    shares = [ggx(wi, wo, along, across, f0).mean(axis=0) for wo in grazing_views()]
    return np.asarray(math.pi * np.mean(shares, axis=0))


def white_f0(fabric: Fabric, share: Reflectance) -> Float64:
    """Return F0 of white yarns by family, (2,): GGX returns the truth's specular reflectance towards the normal."""
    normal, wi = np.array([0.0, 0.0, 1.0]), even_sky(_LOBE_DIRECTIONS)
    whole = [math.pi * ggx(wi, normal, y.roughness, 1.0, np.ones(3))[:, 0].mean() for y in (fabric.warp, fabric.weft)]
    return np.asarray(share.per_area(share.specular) / np.array(whole))


def sheen_reflectance(wo: Float64) -> float:
    """Return the hemispherical reflectance of a white sheen towards a viewer (3,)."""
    return float(math.pi * charlie(even_sky(_LOBE_DIRECTIONS), wo).mean())


def grazing_views(azimuths: Sequence[float] = _SKY_VIEWS) -> list[Float64]:
    """Return viewers at `GRAZING_VIEW` and at azimuths in radians."""
    sine, cosine = math.sin(math.radians(GRAZING_VIEW)), math.cos(math.radians(GRAZING_VIEW))
    return [np.array([sine * math.cos(turn), sine * math.sin(turn), cosine]) for turn in azimuths]
