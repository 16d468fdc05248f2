"""Shading of many points at once, in single precision and without branches.

All loops are flat and run over the points of whole queries, so that a point costs the same whether a query has two of
them or two hundred. The formulas are those of pipeline.truth.scattering.point; surface, flakes and layer are those of
torus_frame, flakes_float32 and slab_float32.
"""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from pipeline.analytic.horizon_points.horizon_map import (
    AREA,
    BOTH,
    CURVATURE,
    DIFFUSE,
    DISTANCE,
    I0,
    I1,
    IX,
    IY,
    IZ,
    LIMIT,
    NODE,
    O0,
    O1,
    OX,
    OY,
    OZ,
    SEEN,
    SINE,
    SIZE,
    SPECULAR,
    STEEPNESS,
    STEP_V,
    STEP_Y,
    TURN_I,
    TURN_O,
    WARPNESS,
    WEFTNESS,
    HorizonMap,
)
from pipeline.analytic.soft_horizons import above, ramp
from pipeline.analytic.torus_frame import Fibre, bend, normal, sigma, spread, tangent, turning
from pipeline.compiled.arrays import Float32
from pipeline.compiled.decorators import fast_kernel, kernel
from pipeline.truth.geometry.heightfield import ALPHA, BETA, BLEND, COS_TWIST, RADIUS, SIN_TWIST
from pipeline.truth.geometry.march import azimuth_rows
from pipeline.truth.scattering.slab_float32 import reflection

BATCH: Final = 2048
"""Points shaded at a time: their rows, some 200 kB, stay in the second-level cache."""

_0, _1, _HALF = np.float32(0.0), np.float32(1.0), np.float32(0.5)
_EDGE = np.float32(1e-6)  # least squared cosine across a yarn
_INVERSE_PI = np.float32(1.0 / math.pi)
_EIGHTH_PI = np.float32(1.0 / (8.0 * math.pi))  # a quarter of the density's 1 / pi, the mean of two places


@kernel
def query_rows(
    wi: Float32, wo: Float32, azimuths: int, nodes: int, values: Float32, rows: npt.NDArray[np.int32], at: int
) -> None:
    """Write the values that all points of a query share to column `at`: nine from IX on, and four from I0 on.

    `nodes` is the number of nodes a block.
    """
    i0, i1, turn_i = azimuth_rows(wi[0], wi[1], azimuths)
    o0, o1, turn_o = azimuth_rows(wo[0], wo[1], azimuths)
    hx, hy, hz = wi[0] + wo[0], wi[1] + wo[1], wi[2] + wo[2]
    for c in range(3):
        values[c, at], values[3 + c, at] = wi[c], wo[c]
    values[6, at] = _1 / (hx * hx + hy * hy + hz * hz)
    values[7, at], values[8, at] = np.float32(turn_i), np.float32(turn_o)
    rows[I0, at], rows[I1, at] = np.int32(i0 * nodes), np.int32(i1 * nodes)
    rows[O0, at], rows[O1, at] = np.int32(o0 * nodes), np.int32(o1 * nodes)


@kernel
def fill_points(
    points: Float32,
    places: npt.NDArray[np.int32],
    values: Float32,
    rows: npt.NDArray[np.int32],
    queries: int,
    count: int,
) -> None:
    """Copy the values of each query to its `count` points.

    Row by row: a slice of every row and query would cost more time than a query of few points.
    """
    for r in range(9):
        _repeat(values[r], queries, count, points[IX + r])
    for r in range(4):
        _repeat(rows[r], queries, count, places[I0 + r])


@kernel
def _repeat(source: npt.NDArray[Any], queries: int, count: int, out: npt.NDArray[Any]) -> None:
    for q in range(queries):
        out[q * count : (q + 1) * count] = source[q]


@kernel
def uncover(horizon: Float32, count: int, points: Float32, places: npt.NDArray[np.int32]) -> None:
    """Write the visibility of points to the viewer, and to viewer and light: ramps in the sine of elevation, 0 to 1.

    A loop of its own: look-ups at computed places keep a loop from the vector units.
    """
    nodes, low_i, high_i, low_o, high_o = places[NODE], places[I0], places[I1], places[O0], places[O1]
    iz, oz, turn_i, turn_o = points[IZ], points[OZ], points[TURN_I], points[TURN_O]
    steepness, seen, both = points[STEEPNESS], points[SEEN], points[BOTH]
    for k in range(count):
        at = np.uint32(nodes[k])
        first, second = horizon[at + np.uint32(low_o[k])], horizon[at + np.uint32(high_o[k])]
        viewed = ramp(above(oz[k], first, second, turn_o[k], steepness[k]))
        first, second = horizon[at + np.uint32(low_i[k])], horizon[at + np.uint32(high_i[k])]
        lit = ramp(above(iz[k], first, second, turn_i[k], steepness[k]))
        seen[k], both[k] = viewed, viewed * lit


@fast_kernel
def shade(table: HorizonMap, count: int, weight: Float32, points: Float32) -> None:
    """Write each point's shares of area, diffuse and specular sums: rows AREA to SPECULAR of the scratch (`points`).

    Reads all other rows but X, Y, TURN_I, TURN_O and STEEPNESS; `weight` takes the place of the row WEIGHT.
    """
    ix, iy, iz, ox, oy, oz = points[IX], points[IY], points[IZ], points[OX], points[OY], points[OZ]
    size, step_v, step_y = points[SIZE], points[STEP_V], points[STEP_Y]
    sine, distance, curvature, limit = points[SINE], points[DISTANCE], points[CURVATURE], points[LIMIT]
    warpness, weftness, seen, both = points[WARPNESS], points[WEFTNESS], points[SEEN], points[BOTH]
    area, diffuse, specular = points[AREA], points[DIFFUSE], points[SPECULAR]
    warp, weft, thickness = table.yarn[0], table.yarn[1], table.thickness
    # Read once: a load under a condition would keep the loop from vector units.
    radius_a, alpha_a, beta_a, blend_a = warp[RADIUS], warp[ALPHA], warp[BETA], warp[BLEND]
    radius_b, alpha_b, beta_b, blend_b = weft[RADIUS], weft[ALPHA], weft[BETA], weft[BLEND]
    sin_a, cos_a, sin_b, cos_b = warp[SIN_TWIST], warp[COS_TWIST], weft[SIN_TWIST], weft[COS_TWIST]
    for k in range(count):
        viewed, lit = seen[k], both[k]
        is_warp = warpness[k] > _0
        yarns = warpness[k] + weftness[k]
        radius = radius_a if is_warp else radius_b
        alpha = alpha_a if is_warp else alpha_b
        blend = blend_a if is_warp else blend_b
        fibre = Fibre(
            sin_a if is_warp else sin_b, cos_a if is_warp else cos_b, beta_a if is_warp else beta_b
        )  # fmt: skip
        # The yarn's frame.
        ix_k, iy_k, iz_k, ox_k, oy_k, oz_k = ix[k], iy[k], iz[k], ox[k], oy[k], oz[k]
        lix, liy = (ix_k if is_warp else iy_k), (iy_k if is_warp else -ix_k)
        lox, loy = (ox_k if is_warp else oy_k), (oy_k if is_warp else -ox_k)
        sv = sine[k]
        cv = np.sqrt(max((_1 - sv) * (_1 + sv), _EDGE))
        angles, inner = bend(sv, cv, radius, distance[k], curvature[k], limit[k])
        nx, ny, nz = normal(angles, fibre.beta)
        t = tangent(angles, fibre)
        cos_o, cos_i = max(lox * nx + loy * ny + oz_k * nz, _0), max(lix * nx + liy * ny + iz_k * nz, _0)
        along_i, along_o = lix * t.x + liy * t.y + iz_k * t.z, lox * t.x + loy * t.y + oz_k * t.z
        square = alpha * alpha
        # The half vector's cosine changes along and across the yarn, over a box around the point: two places of it.
        by_u, by_v = turning(lix + lox, liy + loy, iz_k + oz_k, t, angles, fibre)
        du, dv = step_y[k] * inner / angles.cos_u * by_u, step_v[k] * by_v
        h, apart = along_i + along_o, np.sqrt(du * du + dv * dv)
        q0, q1 = spread(h - apart, size[k], square), spread(h + apart, size[k], square)
        scattered = reflection(
            _EIGHTH_PI * alpha * square * (q0 + q1), q0 * q1, sigma(along_i, square), sigma(along_o, square),
            cos_i, cos_o, thickness,
        )  # fmt: skip
        wide = weight[k] / nz
        a = wide * cos_o
        bare = weight[k] * oz_k
        area[k] = (a if yarns > _0 else bare) * viewed
        lit = lit * yarns
        faces = _1 if cos_i > _0 else _0
        diffuse[k] = a * lit * faces * _INVERSE_PI * (blend * cos_i + (_1 - blend) * iz_k)
        specular[k] = wide * lit * scattered


@fast_kernel
def gather(
    count: int, first: int, area: Float32, diffuse: Float32, specular: Float32, warpness: Float32, weftness: Float32
) -> tuple[np.float32, np.float32, np.float32, np.float32, np.float32]:
    """Return the sums of area and of the four components over `count` points from `first` on."""
    a, s_warp, s_weft, c_warp, c_weft = _0, _0, _0, _0, _0
    last = first + count
    area, diffuse, specular = area[first:last], diffuse[first:last], specular[first:last]
    warpness, weftness = warpness[first:last], weftness[first:last]
    for k in range(count):
        a += area[k]
        s_warp += specular[k] * warpness[k]
        s_weft += specular[k] * weftness[k]
        c_warp += diffuse[k] * warpness[k]
        c_weft += diffuse[k] * weftness[k]
    return a, s_warp, s_weft, c_warp, c_weft
