"""Whole yarns of a cloth: tubes that go on from float to float beneath their neighbours, met by rays.

A yarn is a circle swept along a centre line of arcs: that of a float on top, and beneath the same turned over. They
meet at height 0 with one slope. Rays meet tubes by sphere tracing, whose steps are exact distances: nothing is shared
with the marches of the package but the table of floats. The relief is taken to be 1. Seen from above alone, whole
yarns are the `envelope`: at every place the higher of two, without what a ray sees under a yarn's side.

Compiled callers in other files of the tests do not notice a change of this one: empty the cache of kernels after it.
"""

from __future__ import annotations

import math

from pipeline.compiled.arrays import Float64
from pipeline.compiled.decorators import kernel
from pipeline.truth.geometry.heightfield import (
    AXIS_DROP,
    BEND_RADIUS,
    COS_TWIST,
    GAP,
    HALF_LENGTH,
    OFFSET,
    RADIUS,
    SIN_TWIST,
    TOP,
    UNDER,
    WARP,
    HeightField,
)

_CLOSE = 1e-5  # distance that counts as met
_EXACT = 0.5  # distances to all tubes are exact below this


@kernel
def float_at(field: HeightField, family: int, column: int, k: int) -> tuple[int, int, int, float]:
    """Return pick, end, side and centre of the float of a yarn in its k-th cell."""
    picks, ends = field.top.shape
    pick, end = (k % picks, column % ends) if family == WARP else (column % picks, k % ends)
    side = TOP if field.top[pick, end] == family else UNDER
    return pick, end, side, k + 0.5 - field.floats[pick, end, side, OFFSET]


@kernel
def foot_on(side: int, own: Float64, y: float, z: float) -> tuple[float, float, float]:
    """Return the point of a float's centre line nearest to (y, z), and the sine of its inclination."""
    bend, half, drop = own[BEND_RADIUS], own[HALF_LENGTH], own[AXIS_DROP]
    if bend == 0.0:
        return min(max(y, -half), half), 0.0, 0.0
    sign = 1.0 if side == TOP else -1.0
    up = sign * z + drop
    if up <= 0.0 or abs(y) * drop > half * up:
        return math.copysign(half, y), 0.0, sign * math.copysign(half / bend, y)
    norm = math.hypot(y, up)
    return bend * y / norm, sign * (bend * up / norm - drop), sign * y / norm


@kernel
def nearest(field: HeightField, family: int, column: int, along: float, z: float) -> tuple[float, float, float, float]:
    """Return the distance from a yarn's centre line in its own plane, the nearest point, and its inclination."""
    pick, end, side, centre = float_at(field, family, column, math.floor(along))
    half = field.floats[pick, end, side, HALF_LENGTH]
    y, foot_z, slope = foot_on(side, field.floats[pick, end, side], along - centre, z)
    foot = centre + y
    best = math.hypot(along - foot, z - foot_z)
    for way in (-1.0, 1.0):
        if half - way * (along - centre) < best:
            pick, end, side, other = float_at(field, family, column, math.floor(centre + way * (half + 0.5)))
            y, at_z, at_slope = foot_on(side, field.floats[pick, end, side], along - other, z)
            distance = math.hypot(along - other - y, z - at_z)
            if distance < best:
                best, foot, foot_z, slope = distance, other + y, at_z, at_slope
    return best, foot, foot_z, slope


@kernel
def tube_distance(field: HeightField, family: int, column: int, x: float, y: float, z: float) -> float:
    """Return the signed distance to the tube of a yarn."""
    across, along = (x, y) if family == WARP else (y, x)
    distance, _, _, _ = nearest(field, family, column, along, z)
    return math.hypot(across - column - 0.5, distance) - field.yarn[family, RADIUS]


@kernel
def nearest_tube(field: HeightField, x: float, y: float, z: float) -> tuple[float, int, int]:
    """Return the signed distance to all tubes, and family and column of the nearest."""
    best, nearest_family, nearest_column = _EXACT, 0, 0
    for family in range(2):
        across = x if family == WARP else y
        own = math.floor(across)
        for column in (own, own + (1 if across - own > 0.5 else -1)):
            distance = tube_distance(field, family, column, x, y, z)
            if distance < best:
                best, nearest_family, nearest_column = distance, family, column
    return best, nearest_family, nearest_column


@kernel
def tubes_met(field: HeightField, x: float, y: float, z: float, wx: float, wy: float, wz: float) -> float:
    """Return the distance at which a ray meets a tube; infinity if it leaves the cloth before."""
    t, bottom = 0.0, field.lowest - max(field.yarn[0, RADIUS], field.yarn[1, RADIUS])
    while bottom <= z + t * wz <= field.highest + 1e-9:
        distance, _, _ = nearest_tube(field, x + t * wx, y + t * wy, z + t * wz)
        if distance < _CLOSE:
            return t
        t += distance
    return math.inf


@kernel
def tube_surface(
    field: HeightField, family: int, column: int, x: float, y: float, z: float
) -> tuple[float, float, float, float, float, float]:
    """Return unit ply normal and fibre tangent of a yarn's tube at a point on it (formulas of `surface_at`)."""
    across, along = (x, y) if family == WARP else (y, x)
    _, foot, foot_z, sin_u = nearest(field, family, column, along, z)
    cos_u = math.sqrt(1.0 - sin_u * sin_u)
    sin_v, cos_v = across - column - 0.5, (along - foot) * sin_u + (z - foot_z) * cos_u
    radius = math.hypot(sin_v, cos_v)
    sin_v, cos_v = sin_v / radius, cos_v / radius
    if family != WARP:
        sin_u = -sin_u  # a weft's frame looks along -x
    sin_t, cos_t = field.yarn[family, SIN_TWIST], field.yarn[family, COS_TWIST]
    nx, ny, nz = sin_v, sin_u * cos_v, cos_u * cos_v
    tx, ty = -cos_v * sin_t, cos_u * cos_t + sin_u * sin_v * sin_t
    tz = -sin_u * cos_t + cos_u * sin_v * sin_t
    return (nx, ny, nz, tx, ty, tz) if family == WARP else (-ny, nx, nz, -ty, tx, tz)


@kernel
def top_of(field: HeightField, family: int, column: int, across: float, along: float) -> float:
    """Return the height of a yarn seen from above, which goes on along its tori from float to float."""
    rho = math.sqrt(max(field.yarn[family, RADIUS] ** 2 - across * across, 0.0))
    pick, end, side, centre = float_at(field, family, column, math.floor(along))
    y, half = along - centre, field.floats[pick, end, side, HALF_LENGTH]
    inner = field.floats[pick, end, side, BEND_RADIUS] - rho
    if side == UNDER and inner > 0.0:
        if abs(y) * (inner + rho) <= inner * half:
            return field.floats[pick, end, side, AXIS_DROP] - math.sqrt(inner * inner - y * y)
        pick, end, side, centre = float_at(field, family, column, math.floor(centre + math.copysign(half + 0.5, y)))
        y = along - centre
    bend = field.floats[pick, end, side, BEND_RADIUS]
    if bend == 0.0:
        return rho
    return math.sqrt((bend + rho) ** 2 - y * y) - field.floats[pick, end, side, AXIS_DROP]


@kernel
def envelope(field: HeightField, x: float, y: float) -> tuple[float, int]:
    """Return the height of the higher yarn at a place, and its family or GAP."""
    best, which = -math.inf, GAP
    for family in range(2):
        across, along = (x, y) if family == WARP else (y, x)
        column = math.floor(across)
        if abs(across - column - 0.5) <= field.yarn[family, RADIUS]:
            height = top_of(field, family, column, across - column - 0.5, along)
            if height > best:
                best, which = height, family
    return best, which
