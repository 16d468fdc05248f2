"""Nodes placed in a narrow footprint: in the part of every piece of yarn that it covers."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from pipeline.analytic.gauss_nodes.nodes import GaussNodes
from pipeline.analytic.horizon_points.horizon_map import HorizonMap
from pipeline.analytic.horizon_points.rows import STEP_V, STEP_Y, WEIGHT, X, Y
from pipeline.compiled.arrays import Float32
from pipeline.compiled.decorators import kernel
from pipeline.compiled.float32 import remaining
from pipeline.truth.geometry.heightfield import GAP, WARP, WEFT

REACH: Final = 3.0
"""Standard deviations at which a footprint is cut."""

BANDS: Final = 49
"""Most parts of pieces that a narrow footprint covers: seven along each axis."""

_SLIVER: Final = 0.05  # pieces of a footprint thinner than so many deviations are left out
_0, _1, _HALF = np.float32(0.0), np.float32(1.0), np.float32(0.5)
_THIRD = np.float32(1.0 / math.sqrt(3.0))


@kernel
def place_nodes(
    table: HorizonMap,
    fixed: GaussNodes,
    x: np.float32,
    y: np.float32,
    s: np.float32,
    along: int,
    line: Float32,
    points: Float32,
) -> int:
    """Place nodes in the part of every piece that a narrow footprint covers; return their number."""
    ends, picks = table.repeat[0], table.repeat[1]
    reach, least = np.float32(REACH) * s, np.float32(_SLIVER) * s
    warp_radius, weft_radius = table.yarn[0, 0], table.yarn[1, 0]
    most = fixed.own_positions.shape[1]
    across = 0
    while across < most and fixed.own_weights[0, across] > _0:
        across += 1
    total = 0
    for low_pick in range(int(np.floor(y - reach)), int(np.floor(y + reach)) + 1):
        pick = low_pick % picks
        for low_end in range(int(np.floor(x - reach)), int(np.floor(x + reach)) + 1):
            end = low_end % ends
            top = table.top[pick * ends + end]
            # Bands of the cell, in each axis: beside the yarn, on it, beside it.
            for band_y in range(3):
                y0, y1 = _band(band_y, weft_radius)
                y0, y1 = max(y0, y - reach - low_pick), min(y1, y + reach - low_pick)
                if y1 - y0 < least:
                    continue
                for band_x in range(3):
                    x0, x1 = _band(band_x, warp_radius)
                    x0, x1 = max(x0, x - reach - low_end), min(x1, x + reach - low_end)
                    if x1 - x0 < least:
                        continue
                    in_warp, in_weft = band_x == 1, band_y == 1
                    family = GAP
                    if in_warp and (top == 0 or not in_weft):
                        family = WARP
                    elif in_weft:
                        family = WEFT
                    nx = across if family == WARP else along
                    ny = across if family == WEFT else along
                    if total + nx * ny > points.shape[1]:
                        return total
                    _axis(fixed, x - low_end, s, x0, x1, warp_radius, family == WARP, nx, line[0], line[1])
                    _axis(fixed, y - low_pick, s, y0, y1, weft_radius, family == WEFT, ny, line[2], line[3])
                    half_x, half_y = _HALF * (x1 - x0), _HALF * (y1 - y0)
                    for j in range(ny):
                        for i in range(nx):
                            points[X, total] = line[0, i] + np.float32(end)
                            points[Y, total] = line[2, j] + np.float32(pick)
                            points[WEIGHT, total] = line[1, i] * line[3, j]
                            step_x, step_y = half_x * _THIRD / np.float32(nx), half_y * _THIRD / np.float32(ny)
                            points[STEP_V, total] = step_y / weft_radius if family == WEFT else step_x / warp_radius
                            points[STEP_Y, total] = step_x if family == WEFT else step_y
                            total += 1
    return total


@kernel
def _band(band: int, radius: np.float32) -> tuple[np.float32, np.float32]:
    if band == 0:
        return _0, _HALF - radius
    return (_HALF - radius, _HALF + radius) if band == 1 else (_HALF + radius, _1)


@kernel
def _axis(
    fixed: GaussNodes,
    centre: np.float32,
    s: np.float32,
    low: np.float32,
    high: np.float32,
    radius: np.float32,
    bent: bool,
    count: int,
    positions: Float32,
    weights: Float32,
) -> None:
    """Write positions and weights of one axis of a clipped piece: the rule, in v across a yarn, times the Gaussian."""
    rule = 0 if bent else 1
    if bent:
        first = np.float32(math.asin(min(max((low - _HALF) / radius, -_1), _1)))
        last = np.float32(math.asin(min(max((high - _HALF) / radius, -_1), _1)))
    else:
        first, last = low, high
    half, middle = _HALF * (last - first), _HALF * (last + first)
    inverse = _1 / s
    for k in range(count):
        place, weight = middle + half * fixed.own_positions[rule, k], half * fixed.own_weights[rule, k]
        if bent:
            weight *= radius * np.float32(math.cos(place))
            place = _HALF + radius * np.float32(math.sin(place))
        d = (place - centre) * inverse
        positions[k], weights[k] = place, weight * remaining(_HALF * d * d)
