"""Horizons: the least slope of a ray that leaves the cloth, for points and azimuths, tabulated once for many queries.

The slope of the horizon is the greatest (h(s) - z) / s over everything that a ray crosses. Within a cell h is concave
(heightfield), so that the slope rises and then falls. On a base that falls away by kappa s^2 / 2, h is less by that.
"""

import hashlib
import math
from threading import Lock
from typing import Final

import numpy as np

from pipeline.compiled.arrays import Float32, Float64, Mask, nbytes
from pipeline.compiled.decorators import allocating_kernel, kernel
from pipeline.truth.geometry import heightfield, march
from pipeline.truth.geometry.heightfield import GAP, OFFSET, TOP, UNDER, WARP, HeightField
from pipeline.truth.geometry.march import Cell, Ray

_HALVINGS, _SECANTS = 3, 4
_STRIP_POINTS = 8
_NEAREST = 1e-6
_FLATTEST = 1.5e-3  # slopes below, beyond 89.9 degrees, are treated as equal
_STEEPEST = 1e4
_FARTHEST = 1e4  # yarn spacings

# Tables of every level and kind need the same horizons, which take most of their time; most have 3 to 8 MB.
_KEPT: Final = 256 << 20  # bytes
_LAST: Final[dict[bytes, Float32]] = {}
_KEEPING: Final = Lock()


@kernel
def _slope_of_top(
    field: HeightField, x: float, y: float, z: float, towards: Ray, a: float, b: float, cell: Cell, best: float
) -> float:
    """Return the greatest slope to the top piece of a cell between distances a and b, or `best` if that is greater.

    The slope is greatest where its tangent passes through the point, at the root of (h - z) - s h', which rises with s.
    """
    # The ray in the frame of the float.
    family = int(field.top[cell.pick, cell.end])
    yarn, own = field.yarn[family], field.floats[cell.pick, cell.end, TOP]
    x, y = heightfield.local_position(family, own[OFFSET], x, y, cell.column, cell.row)
    dx, dy, curvature = towards.dx, towards.dy, towards.bend
    if family != WARP:
        dx, dy = dy, -dx

    a = max(a, _NEAREST)
    low, slope_x, slope_y = heightfield.float_height(yarn, own, TOP, x + a * dx, y + a * dy)
    rise_a = slope_x * dx + slope_y * dy - curvature * a
    low -= z + 0.5 * curvature * a * a
    fall_a = low - a * rise_a
    if fall_a >= 0.0:
        return max(best, low / a)
    high, slope_x, slope_y = heightfield.float_height(yarn, own, TOP, x + b * dx, y + b * dy)
    rise_b = slope_x * dx + slope_y * dy - curvature * b
    high -= z + 0.5 * curvature * b * b
    fall_b = high - b * rise_b
    if fall_b <= 0.0:
        return max(best, high / b)
    best = max(best, low / a, high / b)
    # Tangents at both ends bound the height; where they meet below the best ray, nothing reaches it.
    step = (high - low - rise_b * (b - a)) / (rise_a - rise_b)
    if low + rise_a * step <= best * (a + step):
        return best
    # A yarn's edge is vertical: in theta, s = middle - half cos theta, the height has no such ends. Halve, then take
    # the false position, the weight of an end that stays halved (Illinois).
    middle, half = 0.5 * (a + b), 0.5 * (b - a)
    first, last, fall_a, fall_b = 0.0, math.pi, 0.0, 0.0
    for k in range(_HALVINGS + _SECANTS):
        share = 0.5
        if k >= _HALVINGS and fall_a < fall_b:
            share = min(max(fall_a / (fall_a - fall_b), 0.02), 0.98)
        theta = first + (last - first) * share
        s = middle - half * math.cos(theta)
        height, slope_x, slope_y = heightfield.float_height(yarn, own, TOP, x + s * dx, y + s * dy)
        height -= z + 0.5 * curvature * s * s
        rise = slope_x * dx + slope_y * dy - curvature * s
        best = max(best, height / s)
        fall = (height - s * rise) * math.sin(theta)
        if fall < 0.0:
            first, fall_a, fall_b = theta, fall, 0.5 * fall_b
        else:
            last, fall_b, fall_a = theta, fall, 0.5 * fall_a
    return best


@kernel
def _slope_of_strip(
    field: HeightField, x: float, y: float, z: float, towards: Ray, a: float, b: float, cell: Cell, best: float
) -> float:
    """Return the greatest slope to points of the yarn beneath between distances a and b, or `best` if it is greater."""
    family = 1 - int(field.top[cell.pick, cell.end])
    a, b = march.span_over(field, family, x, y, towards, a, b, cell)
    if b < a:
        return best
    for k in range(_STRIP_POINTS):
        s = max(a + (b - a) * k / (_STRIP_POINTS - 1.0), _NEAREST)
        height, _ = march.height_along(field, UNDER, x, y, towards, s, cell)
        best = max(best, (height - z) / s - 0.5 * towards.bend * s)
    return best


@kernel
def horizon(
    field: HeightField, x: float, y: float, z: float, side: int, dx: float, dy: float, curvature: float = 0.0
) -> float:  # fmt: skip
    """Return the slope above which a point is visible in the unit azimuth (dx, dy), its own float left out.

    The point is as in `visible`; the base has the `curvature` along the azimuth. Over a flat base the slope is >= 0.
    """
    towards = march.level_ray(dx, dy, curvature)
    cell = march.first_cell(x, y, towards)
    own = march.float_on_top(field, cell)
    # A ray below the first value meets the base at the cloth's lowest point.
    best = 0.0 if curvature == 0.0 else -math.sqrt(2.0 * curvature * max(z - field.lowest, 0.0))
    distance = 0.0
    while distance <= _FARTHEST:
        fallen = 0.5 * curvature * distance * distance
        least = max(best, _FLATTEST) if curvature == 0.0 else best
        # Over a curved base nothing is nearer to the best ray than where that turns.
        if field.highest - z <= least * distance + fallen and best + curvature * distance >= 0.0:
            break
        leave = min(cell.next_x, cell.next_y)
        nearest = distance if curvature == 0.0 else min(max(-best / curvature, distance), leave)
        reached = best * nearest + 0.5 * curvature * nearest * nearest
        if field.crown[cell.pick, cell.end] - z > reached and leave > distance:
            is_own = side == TOP and march.float_on_top(field, cell) == own
            enter, exit_ = march.span_on_top(field, cell, x, y, towards, distance, leave)
            if enter > distance:
                best = _slope_of_strip(field, x, y, z, towards, distance, enter, cell, best)
            if leave > exit_:
                best = _slope_of_strip(field, x, y, z, towards, exit_, leave, cell, best)
            if exit_ > enter and not is_own:
                best = _slope_of_top(field, x, y, z, towards, enter, exit_, cell, best)
        distance = leave
        cell = march.next_cell(field, cell, towards)
    return best


def horizons(
    field: HeightField, x: Float64, y: Float64, azimuths: int, own_plane: bool, curvature: float = 0.0
) -> Float32:
    """Return the horizon's slope of each point seen from above at (x, y), for evenly spaced azimuths from 0.

    Points in gaps lie at z = 0; with `own_plane`, a point's tangent plane hides too. The base has the `curvature` in
    all azimuths. Shape (azimuths, points). The last results, of `_KEPT` bytes, are shared: nobody may write to them.
    """
    arrays = (field.top, field.floats, field.crown, field.yarn, x, y)
    scalars = (*(part.shape for part in arrays), field.highest, field.lowest, azimuths, own_plane, curvature)
    asked = hashlib.sha256(b"".join(part.tobytes() for part in arrays) + repr(scalars).encode()).digest()
    slopes = _LAST.get(asked)
    if slopes is None:
        slopes = _horizons(field, x, y, azimuths, own_plane, curvature)
        with _KEEPING:
            _LAST[asked] = slopes
            while len(_LAST) > 1 and nbytes(_LAST.values()) > _KEPT:
                _LAST.pop(next(iter(_LAST)))
    return slopes


@allocating_kernel
def _horizons(field: HeightField, x: Float64, y: Float64, azimuths: int, own_plane: bool, curvature: float) -> Float32:
    """Compute `horizons`."""
    slopes = np.zeros((azimuths, len(x)), np.float32)
    for k in range(len(x)):
        family, side, z, nx, ny, nz, _, _, _ = heightfield.surface_at(field, x[k], y[k], int(x[k]), int(y[k]))
        if family == GAP:
            side, z = UNDER, 0.0
        for a in range(azimuths):
            turn = 2.0 * math.pi * a / azimuths
            dx, dy = math.cos(turn), math.sin(turn)
            slopes[a, k] = horizon(field, x[k], y[k], z, side, dx, dy, curvature)
            if own_plane and family != GAP:
                slopes[a, k] = max(slopes[a, k], min(-(nx * dx + ny * dy) / nz, _STEEPEST))
    return slopes


def horizon_sines(
    front: HeightField, back: HeightField, x: Float64, y: Float64, gap: Mask, azimuths: int, curvature: float = 0.0
) -> Float64:
    """Return the sine of the horizon's elevation of each point, (azimuths, points); `gap` says which lie in gaps.

    A view through a gap is free only if the other side of the cloth, `back` seen from -wo, does not hide it either: in
    a gap the higher of both horizons counts. `azimuths` is even. The front's base has the `curvature` in all azimuths;
    the back counts as flat.
    """
    slopes = horizons(front, x, y, azimuths, False, curvature).astype(np.float64)
    if gap.any():
        other = horizons(back, x[gap], y[gap], azimuths, True)
        slopes[:, gap] = np.maximum(slopes[:, gap], np.roll(other, azimuths // 2, axis=0))
    return np.asarray(slopes / np.sqrt(1.0 + slopes * slopes))
