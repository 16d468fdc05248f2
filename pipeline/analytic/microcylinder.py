"""Cloth of thin cylinders seen from afar [Sadeghi2013Microcylinder]: a BRDF without places or footprints.

A family of threads covers the share a of the cloth. Its tangents t are tilted within the plane of the thread and the
macro normal. theta is the angle of a direction to the plane across t; phi and psi are its angles to the normal of the
thread, around t and along t. theta_h = (theta_i + theta_o)/2, theta_d = (theta_i - theta_o)/2, phi_d = phi_i - phi_o:

    f_P = sum over families of a E_t[f_s M P cos theta_i] / Q
    Q   = sum over families of a E_t[max(cos psi_o, 0)] + (1 - sum of all a) cos_o
    f_s = (k_s cos(phi_d/2) g(gamma_s, theta_h) + (k_n g(gamma_v, theta_h) + k_e)/(cos theta_i + cos theta_o))
          / cos^2 theta_d
    M   = (1 - u) m_i m_o + u min(m_i, m_o),   m = max(cos phi, 0),   u = exp(-phi_d^2 / (2 (20 degrees)^2))

P is M with psi in place of phi, and g the normal density. The authors measured threads. Here a fit finds the k and
gamma of both families from a fabric's components in footprints of many yarns, and tangents are quantiles of the slopes
of the visible surface. There is no Fresnel factor, since yarns here have no interface.
"""

import math
from typing import Final

import numpy as np

from pipeline.analytic.far_field import FarField
from pipeline.compiled.arrays import Float32, Float64
from pipeline.compiled.decorators import inlined_kernel, kernel
from weaves.fabric import Fabric
from weaves.surface import surface_at

_LOBES: Final = 3  # of a family: surface, narrow volume, even volume
_TANGENTS: Final = 3  # of a family
_TRIED: Final = tuple(np.radians(np.geomspace(2.0, 60.0, 24)))  # standard deviations of lobes
_POINTS: Final = 32  # of the surface along a yarn spacing
_CORRELATED: Final = math.radians(20.0)
_TINY: Final = 1e-12


def microcylinder(fabric: Fabric) -> FarField:
    """Return the cylinders of a fabric; parameters are gamma of surface and volume, radians, and 1 before a fit."""
    x, y = ((np.arange(n * _POINTS) + 0.5) / _POINTS for n in fabric.weave.repeat)
    surface = surface_at(fabric, x[None, :], y[:, None])
    here = [surface.yarn == family for family in range(2)]
    levels = (np.arange(_TANGENTS) + 0.5) / _TANGENTS
    tilts = []
    for family, axis in enumerate((1, 0)):
        normal = surface.normal[here[family]]
        tilts.append(np.quantile(np.arctan2(normal[:, axis], normal[:, 2]), levels) if len(normal) else 0.0 * levels)
    cover = np.array([seen.mean() for seen in here])
    return FarField(_fill, (cover, np.array(tilts)), 1, _TRIED, np.ones((2, 2)), np.ones((2, _LOBES)))


@kernel
def _fill(cover: Float64, tilts: Float64, widths: Float64, wi: Float32, wo: Float32, result: Float64) -> None:
    for row in range(len(wi)):
        area = max(1.0 - cover[0] - cover[1], 0.0) * wo[row, 2]
        for family in range(2):
            share = cover[family] / tilts.shape[1]
            for k in range(tilts.shape[1]):
                cosine, sine = math.cos(tilts[family, k]), math.sin(tilts[family, k])
                # Components along the thread and along its normal; those across it are of the macro frame.
                ti, ni = (
                    wi[row, 1 - family] * cosine - wi[row, 2] * sine,
                    wi[row, 1 - family] * sine + wi[row, 2] * cosine,
                )
                to, no = (
                    wo[row, 1 - family] * cosine - wo[row, 2] * sine,
                    wo[row, 1 - family] * sine + wo[row, 2] * cosine,
                )
                xi, xo = wi[row, family], wo[row, family]
                seen_o = math.sqrt(to * to + no * no)
                area += share * max(no, 0.0) / max(seen_o, _TINY)
                if ni <= 0.0 or no <= 0.0:
                    continue
                cos_i, cos_o, seen_i = (
                    math.sqrt(xi * xi + ni * ni),
                    math.sqrt(xo * xo + no * no),
                    math.sqrt(ti * ti + ni * ni),
                )
                around = min((ni * no + xi * xo) / (cos_i * cos_o), 1.0)  # cosine of phi_d
                weight = share * _both(ni / cos_i, no / cos_o, around)
                weight *= _both(ni / seen_i, no / seen_o, (ni * no + ti * to) / (seen_i * seen_o))
                weight *= cos_i / (0.5 + 0.5 * (cos_i * cos_o + ti * to))
                theta_h = 0.5 * math.atan2(ti * cos_o + to * cos_i, cos_i * cos_o - ti * to)
                narrow, broad = widths[family, 0], widths[family, 1]
                result[row, family, 0] += weight * math.sqrt(0.5 + 0.5 * around) * _density(theta_h, narrow)
                weight /= cos_i + cos_o
                result[row, family, 1] += weight * _density(theta_h, broad)
                result[row, family, 2] += weight
        inverse = 1.0 / max(area, _TINY)
        for family in range(2):
            for lobe in range(_LOBES):
                result[row, family, lobe] *= inverse


@inlined_kernel
def _both(first: float, second: float, between: float) -> float:
    """Return the share of a thread that both directions reach, from the cosines to its normal and between them."""
    apart = math.acos(min(max(between, -1.0), 1.0)) / _CORRELATED
    together = math.exp(-0.5 * apart * apart)
    return (1.0 - together) * first * second + together * min(first, second)


@inlined_kernel
def _density(angle: float, width: float) -> float:
    return math.exp(-0.5 * (angle / width) ** 2) / (width * math.sqrt(2.0 * math.pi))
