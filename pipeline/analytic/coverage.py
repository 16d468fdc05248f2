"""Coverage of curved cloth: the share of a footprint's view rays that do not leave the boundary again.

The truth (pipeline.truth.geometry.opacity) traces hundreds of rays. Here a footprint narrower than the repeat takes
`RAYS` of them, the same points of every footprint, so that pictures do not flicker. One that covers the repeat evenly
reads a table over curvature, azimuth and depth: how deep a ray sinks that meets nothing, as a share of what the yarns'
heights differ by,

    depth = tan^2 / (2 kappa (highest - lowest)),   tan the slope of the ray to the tangent plane.

A ray of depth 1 or more sinks below every yarn and has met one. At a point, coverage is a step in the root of the
depth, found by bisection. The path of a ray is the same in both directions, so half of the azimuths are enough.
Gaps count as filled.
"""

import math
from functools import lru_cache
from typing import Final

import numpy as np

from pipeline.compiled.arrays import Float32, Float64
from pipeline.compiled.decorators import allocating_kernel, kernel
from pipeline.compiled.normal import normal_quantile
from pipeline.truth.cloth import WideQueries, cloth_side, columns_of
from pipeline.truth.footprint.place import EVENLY, GAUSSIAN
from pipeline.truth.footprint.sequences import owen_pair
from pipeline.truth.geometry.heightfield import UNDER, HeightField
from pipeline.truth.geometry.march import Ray, ray
from pipeline.truth.geometry.visibility import visible
from pipeline.truth.monte_carlo import place_in
from pipeline.truth.options import TruthOptions
from pipeline.truth.query import Queries
from weaves.fabric import Fabric

RAYS: Final = 32  # rays of a footprint, a power of two

_KEY: Final = np.uint64(0x5EED)
_DEPTHS: Final = 24
_AZIMUTHS: Final = 24
_CURVATURES: Final = 6  # in powers of 4 down from 1: flatter cloth is as the flattest of them
_POINTS: Final = 256
_BISECTIONS: Final = 10


@lru_cache(maxsize=64)
def _table(fabric: Fabric) -> Float32:
    """Tabulate a fabric's front; it takes a quarter of a second."""
    return _shares(cloth_side(fabric, TruthOptions()).front)


def quick_coverage(fabric: Fabric, looks: Queries) -> Float32:
    """Return the coverage of N footprints, float32 (N,): 1 for flat cloth, 0 for a viewer below the tangent plane."""
    result = np.ones(len(looks.u), np.float32)
    curved = np.flatnonzero(looks.curvature > 0.0)
    if curved.size:
        field = cloth_side(fabric, TruthOptions()).front
        result[curved] = _coverage_rows(field, _table(fabric), columns_of(looks.take(curved)))
    return result


@allocating_kernel
def ray_points() -> Float32:
    """Return the places of the rays, in deviations along both axes of a narrow footprint, float32 (RAYS, 2)."""
    result = np.empty((RAYS, 2), np.float32)
    for k in range(RAYS):
        first, second = owen_pair(_KEY, k)
        result[k, 0], result[k, 1] = normal_quantile(first), normal_quantile(second)
    return result


@allocating_kernel
def _shares(field: HeightField) -> Float32:
    """Return the coverage of a repeat at roots of the depth from 0 to 1, (curvatures, azimuths, depths + 1)."""
    picks, ends = field.top.shape
    shares = np.zeros((_CURVATURES, _AZIMUTHS, _DEPTHS + 1))
    for row in range(_CURVATURES):
        bend = 4.0**-row
        steepest = math.sqrt(2.0 * bend * (field.highest - field.lowest))
        for column in range(_AZIMUTHS):
            azimuth = math.pi * column / _AZIMUTHS
            dx, dy = math.cos(azimuth), math.sin(azimuth)
            for k in range(_POINTS):
                first, second = owen_pair(_KEY, k)
                x, y = first * ends, second * picks
                low, high = 0.0, 1.0
                for _ in range(_BISECTIONS):
                    middle = 0.5 * (low + high)
                    # A ray that enters the boundary above the point, and leaves it again.
                    slope = middle * steepest
                    flat = 1.0 / math.sqrt(1.0 + slope * slope)
                    towards = ray(dx * flat, dy * flat, -slope * flat, bend)
                    if visible(field, x, y, field.highest, UNDER, towards):
                        low = middle
                    else:
                        high = middle
                # Those deeper than where it touches are met; between two of the table's it does so evenly.
                place = 0.5 * (low + high) * _DEPTHS
                for depth in range(_DEPTHS + 1):
                    shares[row, column, depth] += min(max(depth + 0.5 - place, 0.0), 1.0) / _POINTS
            shares[row, column, 0], shares[row, column, _DEPTHS] = 0.0, 1.0
    return shares.astype(np.float32)


@allocating_kernel
def _coverage_rows(field: HeightField, shares: Float32, columns: WideQueries) -> Float64:
    picks, ends = field.top.shape
    result = np.zeros(len(columns.u))
    even = EVENLY * max(picks, ends)
    for row in range(len(result)):
        wo, bend = columns.wo[row], columns.curvature[row]
        if wo[2] <= 0.0:
            continue  # leaves the boundary where it enters
        towards = ray(-wo[0], -wo[1], -wo[2], bend)
        depth = 1.0
        if towards.bend > 0.0:
            depth = towards.rise * towards.rise / (2.0 * bend * (field.highest - field.lowest))
        if depth >= 1.0:
            result[row] = 1.0
        elif min(columns.sigma[row], columns.sigma_minor[row]) >= even:
            result[row] = _read(shares, bend, towards, math.sqrt(depth))
        else:
            total = 0.0
            for k in range(RAYS):
                first, second = owen_pair(_KEY, k)
                x, y, weight = place_in(float(ends), float(picks), columns, row, GAUSSIAN, first, second)
                total += weight
                if not visible(field, x, y, field.highest, UNDER, towards):
                    result[row] += weight
            result[row] = result[row] / total if total > 0.0 else 0.0
    return result


@kernel
def _read(shares: Float32, bend: float, towards: Ray, root: float) -> float:
    """Return the table's coverage, linear in the logarithm of the curvature, in azimuth and root of the depth."""
    row = min(max(-0.5 * math.log2(bend), 0.0), _CURVATURES - 1.0)
    column = math.atan2(towards.dy, towards.dx) / math.pi * _AZIMUTHS
    depth = root * _DEPTHS
    first, left, low = min(int(row), _CURVATURES - 2), math.floor(column), min(int(depth), _DEPTHS - 1)
    value = 0.0
    for i in range(2):
        a = row - first if i else 1.0 - (row - first)
        for j in range(2):
            b = column - left if j else 1.0 - (column - left)
            for k in range(2):
                c = depth - low if k else 1.0 - (depth - low)
                value += a * b * c * shares[first + i, int(left + j) % _AZIMUTHS, low + k]
    return value
