"""The lobes of a material in other programs: anisotropic GGX and Charlie sheen, with their reflectance.

    GGX      F D G / (4 cos_i cos_o),  D = 1 / (pi a_x a_y (h_x^2 / a_x^2 + h_y^2 / a_y^2 + h_z^2)^2)   [Heitz2015SGGX]
             G = 1 / (1 + L_i + L_o),  L = (sqrt(1 + (a_x^2 w_x^2 + a_y^2 w_y^2) / w_z^2) - 1) / 2,  Schlick's F
    Charlie  (2 + 1/a) sin(theta_h)^(1/a) / (2 pi) / (4 (cos_i + cos_o - cos_i cos_o)),  a the squared roughness
                                                                                     [Estevez2017Sheen]

A fibre of roughness alpha along x has the GGX distribution of a_x = alpha, a_y = 1: both densities are
proportional to (h_x^2 / alpha^2 + h_y^2 + h_z^2)^-2.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from pipeline.compiled.arrays import Float64
from pipeline.materials.reflectance import GRAZING, Reflectance, even_sky
from weaves.fabric import Fabric

SHEEN_ROUGHNESS: Final = 0.5
"""Roughness of the sheen, fixed."""

_DIRECTIONS: Final = 4096
_VIEWS: Final = tuple(math.radians(a) for a in (5.0, 35.0, 65.0, 95.0, 125.0, 155.0))


def ggx_density(half: Float64, along: float, across: float) -> Float64:
    """Return D at unit half vectors (N, 3), (N,), in 1/sr; parameters as for `ggx`."""
    scaled = half / (along, across, 1.0)
    return np.asarray(1.0 / (math.pi * along * across * (scaled**2).sum(axis=-1) ** 2))


def ggx(wi: Float64, wo: Float64, along: float, across: float, f0: Float64) -> Float64:
    """Return the GGX lobe without the incident cosine.

    Parameters
    ----------
    wi : float64 (N, 3)
        Directions to the light, z > 0, in the frame of fibre (x), across it (y) and normal (z).
    wo : float64 (3,)
        Direction to the viewer.
    along, across : float
        Roughness a_x and a_y.
    f0 : float64 (3,)
        Reflectance at normal incidence.

    Returns
    -------
    float64 (N, 3)
        In 1/sr.
    """
    half = wi + wo
    half /= np.linalg.norm(half, axis=-1, keepdims=True)

    def masking(w: Float64) -> Float64:
        slopes = ((along * w[..., 0]) ** 2 + (across * w[..., 1]) ** 2) / w[..., 2] ** 2
        return np.asarray(0.5 * (np.sqrt(1.0 + slopes) - 1.0))

    common = ggx_density(half, along, across) / (1.0 + masking(wi) + masking(wo)) / (4.0 * wi[:, 2] * wo[2])
    fresnel = f0 + (1.0 - f0) * ((1.0 - np.clip(half @ wo, 0.0, 1.0)) ** 5)[:, None]
    return np.asarray(fresnel * common[:, None])


def charlie(wi: Float64, wo: Float64, roughness: float) -> Float64:
    """Return the lobe of a white sheen without the incident cosine, (N,), in 1/sr; parameters as for `ggx`."""
    half = wi + wo
    half /= np.linalg.norm(half, axis=-1, keepdims=True)
    inverse = 1.0 / roughness**2
    sine = np.sqrt(np.maximum(1.0 - half[:, 2] ** 2, 0.0))
    density = (2.0 + inverse) * sine**inverse / (2.0 * math.pi)
    return np.asarray(density / (4.0 * (wi[:, 2] + wo[2] - wi[:, 2] * wo[2])))


def ggx_reflectance(along: float, across: float, f0: Float64) -> Float64:
    """Return the hemispherical reflectance of GGX at the grazing view, the mean over azimuths, (3,)."""
    wi = even_sky(_DIRECTIONS)
    return np.asarray(math.pi * np.mean([ggx(wi, wo, along, across, f0).mean(axis=0) for wo in _grazing()], axis=0))


def white_f0(fabric: Fabric, share: Reflectance) -> Float64:
    """Return F0 of white yarns by family, (2,): GGX returns the truth's specular reflectance towards the normal."""
    normal, wi = np.array([0.0, 0.0, 1.0]), even_sky(_DIRECTIONS)
    whole = [math.pi * ggx(wi, normal, y.roughness, 1.0, np.ones(3))[:, 0].mean() for y in (fabric.warp, fabric.weft)]
    return np.asarray(share.per_area(share.specular) / np.array(whole))


def sheen_reflectance(roughness: float = SHEEN_ROUGHNESS) -> float:
    """Return the hemispherical reflectance of a white sheen at the grazing view."""
    return float(math.pi * charlie(even_sky(_DIRECTIONS), _grazing()[0], roughness).mean())


def _grazing() -> list[Float64]:
    sine, cosine = math.sin(math.radians(GRAZING)), math.cos(math.radians(GRAZING))
    return [np.array([sine * math.cos(turn), sine * math.sin(turn), cosine]) for turn in _VIEWS]
