"""Point sampling in single precision, with shadows from a horizon map.

Points are independent random ones or the R2 sequence with one random shift a query [Roberts2018R2]. An axis of the
footprint narrower than `EVENLY` repeats is drawn from the Gaussian; wider, it is taken evenly over the repeat, whose
density is then constant to 0.2 %. The random numbers are 23 bits of an integer hash of 32: enough to place points.

A point is seen and lit, or not. With `soft` horizons both are ramps (pipeline.analytic.soft_horizons), as wide as the
share of the footprint that a point stands for: biased, and with less variance.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from pipeline.analytic.horizon_points.horizon_map import (
    AREA,
    DIFFUSE,
    INTEGERS,
    SCRATCH_ROWS,
    SPECULAR,
    STEEPNESS,
    WARPNESS,
    WEFTNESS,
    WEIGHT,
    HorizonMap,
    X,
    Y,
    horizon_map,
    locate,
)
from pipeline.analytic.horizon_points.shading import BATCH, fill_points, gather, query_rows, shade, uncover
from pipeline.compiled.arrays import Float32
from pipeline.compiled.decorators import allocating_kernel, fast_kernel, inlined_fast_kernel, kernel
from pipeline.truth.cloth import cloth_side
from pipeline.truth.footprint.mixture import Footprints, footprints
from pipeline.truth.footprint.place import EVENLY
from pipeline.truth.footprint.sequences import derive
from pipeline.truth.options import TruthOptions
from pipeline.truth.query import Queries
from weaves.fabric import Fabric

_0, _1, _HALF = np.float32(0.0), np.float32(1.0), np.float32(0.5)
_STEP = np.float32(1e9)  # points are seen or not
_POINT = np.float32(0.02)  # width of the ramp of a point that stands for nothing around it
_BOX = np.float32(3.5)  # side of a point's share of the footprint: times the root of its axes' product over k
_WIDEST = np.float32(0.5)  # yarn spacings: beyond, what a point stands for is another part of the yarn
_RAMP = np.float32(0.8)  # width of the ramp, over the side
_MASK = np.uint64(0xFFFFFFFF)
_R2_FIRST, _R2_SECOND = np.uint32(3242174889), np.uint32(2447445414)  # 2^32 over the plastic number and its square
_WEYL = np.uint32(0x9E3779B9)
_MIX_1, _MIX_2 = np.uint32(0x7FEB352D), np.uint32(0x846CA68B)
_S15, _S16, _S9 = np.uint32(15), np.uint32(16), np.uint32(9)
_UNIT = np.float32(2.0**-23)


def tabulate(fabric: Fabric, grid: int, azimuths: int) -> HorizonMap:
    """Return the horizon map of a fabric's front: `grid` nodes a piece of yarn and side, `azimuths` directions."""
    model = cloth_side(fabric, TruthOptions())
    return horizon_map(model.front, model.back, grid, azimuths)


def sample_horizons(
    table: HorizonMap, queries: Queries, count: int, r2: bool, seed: int, soft: bool = False
) -> Float32:
    """Return the components from `count` points a query, (N, 4); queries are flat and lit from the front."""
    wi, wo = (np.ascontiguousarray(column, np.float32) for column in (queries.wi, queries.wo))
    return _sample(table, footprints(queries), wi, wo, count, r2, soft, np.uint64(seed))


class _Batch(NamedTuple):
    """Scratch memory of the points of some queries at once: see `query_rows`, `fill_points` and `locate`."""

    points: Float32
    places: npt.NDArray[np.int32]
    values: Float32
    shared: npt.NDArray[np.int32]


@allocating_kernel
def _sample(
    table: HorizonMap, patches: Footprints, wi: Float32, wo: Float32, count: int, r2: bool, soft: bool,
    seed: np.uint64,
) -> Float32:  # fmt: skip
    """Answer every row."""
    result, at_once = np.zeros((len(wi), 4), np.float32), max(1, BATCH // count)
    batch = _Batch(
        np.zeros((SCRATCH_ROWS, at_once * count), np.float32),
        np.zeros((INTEGERS, at_once * count), np.int32),
        np.zeros((9, at_once), np.float32),
        np.zeros((4, at_once), np.int32),
    )
    batch.points[WEIGHT], batch.points[STEEPNESS] = _1, _STEP
    _sample_rows(table, patches, wi, wo, count, r2, soft, seed, batch, result)
    return result


# Not in `_sample`: what allocates counts references to every slice.
@kernel
def _sample_rows(
    table: HorizonMap,
    patches: Footprints,
    wi: Float32,
    wo: Float32,
    count: int,
    r2: bool,
    soft: bool,
    seed: np.uint64,
    batch: _Batch,
    result: Float32,
) -> None:
    """Write the components of every row."""
    u, v, deviation_x, deviation_y, correlation = patches
    points, places, values, shared = batch
    rows, at_once = len(u), values.shape[1]
    ends, picks, nodes = table.repeat[0], table.repeat[1], table.grid * table.grid
    at_x, at_y, area, diffuse, specular = points[X], points[Y], points[AREA], points[DIFFUSE], points[SPECULAR]
    warpness, weftness, azimuths = points[WARPNESS], points[WEFTNESS], table.azimuths
    for begin in range(0, rows, at_once):
        end = min(begin + at_once, rows)
        for row in range(begin, end):
            first = (row - begin) * count
            key = derive(seed, row)
            x = np.float32(u[row] - ends * np.floor(np.float64(u[row]) / ends))
            y = np.float32(v[row] - picks * np.floor(np.float64(v[row]) / picks))
            seeds = np.uint32(key & _MASK), np.uint32(key >> np.uint64(32))
            dx, dy, rho = deviation_x[row], deviation_y[row], correlation[row]
            here_x, here_y = at_x[first : first + count], at_y[first : first + count]
            if rho == _0:
                _place(here_x, x, dx, np.float32(ends), seeds[0], _R2_FIRST, r2)
                _place(here_y, y, dy, np.float32(picks), seeds[1], _R2_SECOND, r2)
            else:
                _place_rotated(here_x, here_y, x, y, dx, dy, rho, np.float32(ends), np.float32(picks), seeds, r2)
            query_rows(wi[row], wo[row], azimuths, nodes, values, shared, row - begin)
            if soft:
                side = min(_BOX * np.sqrt(dx * dy * np.sqrt(_1 - rho * rho) / np.float32(count)), _WIDEST)
                points[STEEPNESS, first : first + count] = _1 / (_POINT + _RAMP * side)
        fill_points(points, places, values, shared, end - begin, count)
        total = (end - begin) * count
        locate(table, total, points, places)
        uncover(table.horizon, total, points, places)
        shade(table, total, points[WEIGHT], points)
        for row in range(begin, end):
            a, s_warp, s_weft, c_warp, c_weft = gather(
                count, (row - begin) * count, area, diffuse, specular, warpness, weftness
            )
            if a > _0:
                inverse = _1 / a
                result[row, 0], result[row, 1] = s_warp * inverse, s_weft * inverse
                result[row, 2], result[row, 3] = c_warp * inverse, c_weft * inverse


@fast_kernel
def _place(
    out: Float32, centre: np.float32, sigma: np.float32, repeat: np.float32, seed: np.uint32, step: np.uint32, r2: bool
) -> None:
    """Write the positions of the points of a query on one axis, in [0, repeat]."""
    even = sigma >= np.float32(EVENLY) * repeat
    for k in range(len(out)):
        number = _number(seed, np.uint32(k), step, r2)
        out[k] = _wrapped(number * repeat if even else centre + sigma * _normal(number), repeat)


@fast_kernel
def _place_rotated(
    out_x: Float32,
    out_y: Float32,
    x: np.float32,
    y: np.float32,
    deviation_x: np.float32,
    deviation_y: np.float32,
    correlation: np.float32,
    ends: np.float32,
    picks: np.float32,
    seeds: tuple[np.uint32, np.uint32],
    r2: bool,
) -> None:
    """Write the positions of the points of a query whose footprint lies at an angle to the axes."""
    own = np.sqrt(_1 - correlation * correlation)
    for k in range(len(out_x)):
        a = _normal(_number(seeds[0], np.uint32(k), _R2_FIRST, r2))
        b = _normal(_number(seeds[1], np.uint32(k), _R2_SECOND, r2))
        out_x[k] = _wrapped(x + deviation_x * a, ends)
        out_y[k] = _wrapped(y + deviation_y * (correlation * a + own * b), picks)


@inlined_fast_kernel
def _number(seed: np.uint32, index: np.uint32, step: np.uint32, r2: bool) -> np.float32:
    """Return the number of a point on one axis, in (0, 1)."""
    bits = np.uint32(seed + index * (step if r2 else _WEYL))
    if not r2:
        bits = np.uint32((bits ^ (bits >> _S16)) * _MIX_1)
        bits = np.uint32((bits ^ (bits >> _S15)) * _MIX_2)
        bits = np.uint32(bits ^ (bits >> _S16))
    return (np.float32(np.int32(bits >> _S9)) + _HALF) * _UNIT


@inlined_fast_kernel
def _wrapped(x: np.float32, repeat: np.float32) -> np.float32:
    """Return a position in [0, repeat]."""
    x = x - repeat * np.floor(x * (_1 / repeat))
    return min(max(x, _0), repeat)


_LN2 = np.float32(0.6931471805599453)
_ROOT_HALF = np.int32(0x3F3504F3)  # bits of the root of 1/2
_23 = np.int32(23)
_L3, _L5, _L7, _L9, _2 = (np.float32(c) for c in (2 / 3, 2 / 5, 2 / 7, 2 / 9, 2.0))
_NEAR = tuple(np.float32(c) for c in (2.81022636e-08, 3.43273939e-07, -3.5233877e-06, -4.39150654e-06, 0.00021858087,
                                      -0.00125372503, -0.00417768164, 0.246640727, 1.50140941))  # fmt: skip
_FAR = tuple(np.float32(c) for c in (-0.000200214257, 0.000100950558, 0.00134934322, -0.00367342844, 0.00573950773,
                                     -0.0076224613, 0.00943887047, 1.00167406, 2.83297682))  # fmt: skip
_ROOT_2 = np.float32(1.4142135623730951)


@kernel
def _split(x: np.float32) -> tuple[np.float32, np.float32]:
    """Return e and m of x = 2^e m, m between the roots of 1/2 and 2."""
    bits = np.float32(x).view(np.int32)
    exponent = np.int32((bits - _ROOT_HALF) >> _23)
    mantissa = np.int32(bits - np.int32(exponent << _23))
    return np.float32(exponent), mantissa.view(np.float32)


@fast_kernel
def _normal(p: np.float32) -> np.float32:
    """Return the x below which the standard normal distribution has mass p, to 3e-7, by Giles's polynomials (2010)."""
    z = p + p - _1
    e, m = _split((_1 - z) * (_1 + z))
    s = (m - _1) / (m + _1)
    s2 = s * s
    w = -(e * _LN2 + s * (_2 + s2 * (_L3 + s2 * (_L5 + s2 * (_L7 + s2 * _L9)))))
    near, far = w - np.float32(2.5), np.sqrt(max(w, _0)) - np.float32(3.0)
    a, b = _NEAR[0], _FAR[0]
    for k in range(1, 9):
        a = a * near + _NEAR[k]
        b = b * far + _FAR[k]
    return _ROOT_2 * z * (a if w < np.float32(5.0) else b)
