"""Shading of many points at once, in single precision and without branches: surface, horizons, both slabs.

A point is a lane: all loops are flat, over as many lanes as whole queries fill, so that two points a query and two
hundred cost the same each. The formulas are those of heightfield, patch, microflake and slab; the flakes need cosines
with the tangent only, since |w x t|^2 = 1 - (w.t)^2.
"""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from pipeline.analytic.horizon_points.horizon_map import HorizonMap
from pipeline.analytic.soft_horizons import above, ramp
from pipeline.compiled.arrays import Float32 as Single
from pipeline.compiled.decorators import fast_kernel, kernel
from pipeline.compiled.float32 import absorbed
from pipeline.truth.geometry.azimuths import azimuth_rows
from pipeline.truth.geometry.heightfield import ALPHA, BETA, BLEND, COS_TWIST, RADIUS, SIN_TWIST

LANES: Final = 2048
"""Points shaded at a time: their rows, some 200 kB, stay in the second-level cache."""

ROWS: Final = 26
"""Rows of the scratch that points are passed in; named below."""

# Written by who places the points: position in the repeat and weight; directions of the query, squared half vector's
# inverse, where between two azimuths they lie. Then what `locate` finds, and the shares that `shade` writes.
(X, Y, WEIGHT, IX, IY, IZ, OX, OY, OZ, SIZE, TURN_I, TURN_O, SINE, DISTANCE, CURVATURE, LIMIT, WARPNESS, WEFTNESS,
 SEEN, BOTH, STEP_V, STEP_Y, STEEPNESS, AREA, DIFFUSE, SPECULAR) = range(ROWS)  # fmt: skip

# Rows of the scratch of integers: the azimuths' rows around wi and wo, and the node.
I0, I1, O0, O1, NODE = range(5)
INTEGERS: Final = 5

_0, _1, _HALF = np.float32(0.0), np.float32(1.0), np.float32(0.5)
_TINY = np.float32(1e-20)
_INVERSE_PI = np.float32(1.0 / math.pi)
_FOURTH_PI = np.float32(1.0 / (4.0 * math.pi))


@kernel
def query_rows(
    wi: Single, wo: Single, azimuths: int, nodes: int, values: Single, rows: npt.NDArray[np.int32], at: int
) -> None:
    """Write what a query's lanes share to column `at`: nine numbers from IX on, and four rows from I0 on.

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
def fill_lanes(
    lanes: Single, places: npt.NDArray[np.int32], values: Single, rows: npt.NDArray[np.int32], queries: int, count: int
) -> None:
    """Copy what queries share to their `count` lanes each.

    Row by row, for a slice of every row and query would cost more than a query of few points.
    """
    for r in range(9):
        _repeat(values[r], queries, count, lanes[IX + r])
    for r in range(4):
        _repeat(rows[r], queries, count, places[I0 + r])


@kernel
def _repeat(source: npt.NDArray[Any], queries: int, count: int, out: npt.NDArray[Any]) -> None:
    for q in range(queries):
        out[q * count : (q + 1) * count] = source[q]


@kernel
def uncover(
    count: int,
    places: npt.NDArray[np.int32],
    horizon: Single,
    iz: Single,
    oz: Single,
    turn_i: Single,
    turn_o: Single,
    steepness: Single,
    seen: Single,
    both: Single,
) -> None:
    """Write how far points are seen, and seen and lit: ramps of a given steepness, in sines of elevation, from 0 to 1.

    A loop of its own: no vector unit may store while it looks up places that it does not know beforehand.
    """
    nodes, low_i, high_i, low_o, high_o = places[NODE], places[I0], places[I1], places[O0], places[O1]
    for k in range(count):
        at = np.uint32(nodes[k])
        first, second = horizon[at + np.uint32(low_o[k])], horizon[at + np.uint32(high_o[k])]
        viewed = ramp(above(oz[k], first, second, turn_o[k], steepness[k]))
        first, second = horizon[at + np.uint32(low_i[k])], horizon[at + np.uint32(high_i[k])]
        lit = ramp(above(iz[k], first, second, turn_i[k], steepness[k]))
        seen[k], both[k] = viewed, viewed * lit


@fast_kernel
def shade(
    count: int,
    weight: Single,
    ix: Single,
    iy: Single,
    iz: Single,
    ox: Single,
    oy: Single,
    oz: Single,
    size: Single,
    sine: Single,
    distance: Single,
    curvature: Single,
    limit: Single,
    warpness: Single,
    weftness: Single,
    seen: Single,
    both: Single,
    step_v: Single,
    step_y: Single,
    warp: Single,
    weft: Single,
    thickness: np.float32,
    area: Single,
    diffuse: Single,
    specular: Single,
) -> None:
    """Write each point's shares of area, diffuse and specular sums."""
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
        beta = beta_a if is_warp else beta_b
        blend = blend_a if is_warp else blend_b
        sin_t = sin_a if is_warp else sin_b
        cos_t = cos_a if is_warp else cos_b
        # The yarn's frame.
        ix_k, iy_k, iz_k, ox_k, oy_k, oz_k = ix[k], iy[k], iz[k], ox[k], oy[k], oz[k]
        lix, liy = (ix_k if is_warp else iy_k), (iy_k if is_warp else -ix_k)
        lox, loy = (ox_k if is_warp else oy_k), (oy_k if is_warp else -ox_k)
        sv = sine[k]
        cv = np.sqrt(max((_1 - sv) * (_1 + sv), np.float32(1e-6)))
        su = distance[k] * curvature[k] / (_1 + radius * curvature[k] * cv)
        su = min(max(su, -limit[k]), limit[k])
        cu = np.sqrt((_1 - su) * (_1 + su))
        nx, ny, nz = beta * sv, beta * su * cv, cu * cv
        n = _1 / np.sqrt(nx * nx + ny * ny + nz * nz)
        tx, ty, tz = -cv * sin_t, cu * cos_t + su * sv * sin_t, beta * (cu * sv * sin_t - su * cos_t)
        t = _1 / np.sqrt(tx * tx + ty * ty + tz * tz)
        cos_o = max((lox * nx + loy * ny + oz_k * nz) * n, _0)
        cos_i = max((lix * nx + liy * ny + iz_k * nz) * n, _0)
        along_i = (lix * tx + liy * ty + iz_k * tz) * t
        along_o = (lox * tx + loy * ty + oz_k * tz) * t
        square = alpha * alpha
        rest = _1 - square
        h = along_i + along_o
        sigma_i = np.sqrt(max(_1 - rest * along_i * along_i, square))
        sigma_o = np.sqrt(max(_1 - rest * along_o * along_o, square))
        crossed = sigma_i * cos_o + sigma_o * cos_i + _TINY
        # Changes of the half vector's cosine along and across the yarn, over a box around the point, as two places.
        inner = curvature[k] / (_1 + radius * curvature[k] * cv)
        hx, hy, hz = lix + lox, liy + loy, iz_k + oz_k
        uy, uz = cu * sv * sin_t - su * cos_t, -beta * (cu * cos_t + su * sv * sin_t)
        vx, vy, vz = sv * sin_t, su * cv * sin_t, beta * cu * cv * sin_t
        du = step_y[k] * inner / cu * t * (hy * uy + hz * uz - h * t * (uy * ty + uz * tz))
        dv = step_v[k] * t * (hx * vx + hy * vy + hz * vz - h * t * (vx * tx + vy * ty + vz * tz))
        spread = np.sqrt(du * du + dv * dv)
        q0, q1 = (
            square + rest * size[k] * (h - spread) * (h - spread),
            square + rest * size[k] * (h + spread) * (h + spread),
        )
        q0, q1 = q0 * q0, q1 * q1
        flakes = _HALF * (q0 + q1) / (q0 * q1 * crossed)
        cosines = cos_i * cos_o
        depth = thickness * crossed / (cosines + _TINY)
        wide = weight[k] / (nz * n)
        a = wide * cos_o
        bare = weight[k] * oz_k
        area[k] = (a if yarns > _0 else bare) * viewed
        lit = lit * yarns
        faces = _1 if cos_i > _0 else _0
        diffuse[k] = a * lit * faces * _INVERSE_PI * (blend * cos_i + (_1 - blend) * iz_k)
        specular[k] = wide * lit * alpha * square * _FOURTH_PI * cosines * absorbed(depth) * flakes


@kernel
def shade_all(table: HorizonMap, count: int, lanes: Single, places: npt.NDArray[np.int32], shadows: bool) -> None:
    """Write the shares of `count` located lanes; without `shadows` nothing hides them."""
    if shadows:
        uncover(
            count, places, table.horizon, lanes[IZ], lanes[OZ], lanes[TURN_I], lanes[TURN_O], lanes[STEEPNESS],
            lanes[SEEN], lanes[BOTH],
        )  # fmt: skip
    else:
        lanes[SEEN, :count], lanes[BOTH, :count] = _1, _1
    shade(
        count, lanes[WEIGHT], lanes[IX], lanes[IY], lanes[IZ], lanes[OX], lanes[OY], lanes[OZ], lanes[SIZE],
        lanes[SINE], lanes[DISTANCE], lanes[CURVATURE], lanes[LIMIT], lanes[WARPNESS], lanes[WEFTNESS], lanes[SEEN],
        lanes[BOTH], lanes[STEP_V], lanes[STEP_Y], table.yarn[0], table.yarn[1], table.thickness,
        lanes[AREA], lanes[DIFFUSE], lanes[SPECULAR],
    )  # fmt: skip


@fast_kernel
def gather(
    count: int,
    first: int,
    area: Single,
    diffuse: Single,
    specular: Single,
    warpness: Single,
    weftness: Single,
) -> tuple[np.float32, np.float32, np.float32, np.float32, np.float32]:
    """Return the sums of area and of the four components over `count` lanes from `first` on."""
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


@fast_kernel
def plain_sum(values: Single, count: int) -> np.float32:
    """Return the sum of the first `count` values."""
    total = _0
    for k in range(count):
        total += values[k]
    return total
