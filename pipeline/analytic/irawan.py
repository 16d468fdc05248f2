"""Woven cloth seen from afar by the highlights of its yarns [Irawan2012Woven], without places or footprints.

A float is a torus: w is the yarn's width, L the float's length, r = w/2, R = L/(2 sin u_max). Its fibres t(u, v)
reflect where h = i + o has no part along them. In the frame of the float (across, along, up), with the normals n:

    f_P = sum over families of k_a ((k_u + k_f exp(beta (-i . o - 1))) cos_i I + k_d cos_i)
    I   = 1/(w L) int int r (R + r cos v) delta(h . t(u, v)) A du dv,   A = (n . i)(n . o) / (n . i + n . o)

k_a is the share of the cloth that the family covers. With u_h = atan2(h_y, h_z), and ends of the float at |u| = u_max,

    h . t = sqrt(h_y^2 + h_z^2) (cos psi sin(u_h - u) + sin psi sin v cos(u_h - u)) - h_x sin psi cos v

so that one u belongs to a v; a second one, where the curve of highlights turns back, is left out.

The authors' model has places too. Here twists and widths are the fabric's; bends are steeper by the relief, and at
least 1 degree; 1/L is averaged over the cells where the yarn is on top. A fit finds beta and the k of both families
from components in footprints of many yarns. Not here: ends of filaments that are smoothed (the authors' ss), spines
that are no circle (kappa), noise.
"""

import math
from typing import Final

import numpy as np

from pipeline.analytic.far_field import FarField
from pipeline.compiled.arrays import Float32, Float64
from pipeline.compiled.decorators import kernel
from weaves.draft import cells
from weaves.fabric import Fabric

_TRIED: Final = (0.5, 1.0, 2.0, 4.0, 8.0)  # beta
_AROUND: Final = (np.arange(16) + 0.5) / 16 * math.pi - 0.5 * math.pi  # v, by the midpoint rule
_SINES, _COSINES = np.sin(_AROUND), np.cos(_AROUND)
_FLATTEST: Final = math.radians(1.0)  # a flatter bend would be a mirror
_EDGE: Final = 1e-3  # least squared cosine where the curve of highlights turns back


def irawan(fabric: Fabric) -> FarField:
    """Return the floats of a fabric; of the parameters only kind 0, beta, counts; all are 1 before a fit."""
    seen = cells(fabric.weave)
    top, lengths = seen.top.ravel(), seen.top_length.ravel()
    count = np.bincount(top, minlength=2)
    numbers = [(math.radians(y.bend), math.radians(y.twist), y.relief, y.width) for y in (fabric.warp, fabric.weft)]
    bend, twist, relief, width = np.array(numbers).T
    bend = np.maximum(np.arctan(relief * np.tan(bend)), _FLATTEST)
    above = count / len(top)
    cover = width * (above + (1.0 - width[::-1]) * (1.0 - above))
    thin = 0.5 * width * np.bincount(top, 1.0 / lengths, 2) / np.maximum(count, 1)
    return FarField(_fill, (cover, bend, twist, thin), 2, _TRIED, np.ones((2, 2)), np.ones((2, 3)))


@kernel
def _fill(
    cover: Float64,
    bend: Float64,
    twist: Float64,
    thin: Float64,
    betas: Float64,
    wi: Float32,
    wo: Float32,
    result: Float64,
) -> None:
    for row in range(len(wi)):
        iz, oz = float(wi[row, 2]), float(wo[row, 2])
        for family in range(2):
            # Across and along the yarn; a weft is a warp turned to (y, -x).
            if family == 0:
                ix, iy, ox, oy = float(wi[row, 0]), float(wi[row, 1]), float(wo[row, 0]), float(wo[row, 1])
            else:
                ix, iy, ox, oy = float(wi[row, 1]), -float(wi[row, 0]), float(wo[row, 1]), -float(wo[row, 0])
            hx, hy, hz = ix + ox, iy + oy, iz + oz
            length = math.sqrt(hy * hy + hz * hz)
            sin_h, cos_h = hy / length, hz / length
            sin_p, cos_p, cos_end = math.sin(twist[family]), math.cos(twist[family]), math.cos(bend[family])
            integral = 0.0
            for k in range(len(_SINES)):
                sin_v, cos_v = _SINES[k], _COSINES[k]
                # h . t = length q sin(a - u) - hx sin psi cos v, where a = u_h + atan2(sin psi sin v, cos psi).
                q = math.sqrt(cos_p * cos_p + sin_p * sin_v * sin_p * sin_v)
                sin_a = (sin_h * cos_p + cos_h * sin_p * sin_v) / q
                cos_a = (cos_h * cos_p - sin_h * sin_p * sin_v) / q
                sine = hx * sin_p * cos_v / (length * q)
                square = 1.0 - sine * sine
                if square <= 0.0:
                    continue
                cosine = math.sqrt(max(square, _EDGE))
                cos_u = cos_a * cosine + sin_a * sine
                if cos_u <= cos_end:
                    continue
                sin_u = sin_a * cosine - cos_a * sine
                lit = sin_v * ix + cos_v * (sin_u * iy + cos_u * iz)
                seen = sin_v * ox + cos_v * (sin_u * oy + cos_u * oz)
                if lit > 0.0 and seen > 0.0:
                    area = 0.25 / math.sin(bend[family]) + 0.5 * thin[family] * cos_v
                    integral += area * lit * seen / ((lit + seen) * length * q * cosine)
            even = cover[family] * iz * integral * math.pi / len(_SINES)
            forward = math.exp(-betas[family, 0] * (1.0 + ix * ox + iy * oy + iz * oz))
            result[row, family, 0] = even
            result[row, family, 1] = even * forward
            result[row, family, 2] = cover[family] * iz
