"""One part of a patch by Gauss-Legendre rules, its lines cut where light or view is lost.

The integrand jumps at shadow edges and bends where the yarn turns away from the light or the viewer, which it does
along its edges under any slanted direction, shadows or not. Where a grid of nodes meets such edges, its lines in the
direction that crosses more of them are cut at each, found by bisection, and every piece of a line gets a rule of its
own. The integrand of the other direction is then smooth wherever edges run across the lines.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from pipeline.compiled.arrays import Float64, Index
from pipeline.compiled.decorators import allocating_kernel, kernel
from pipeline.truth.cloth import AREA, SUMS, ClothSide
from pipeline.truth.geometry.heightfield import GAP, WEFT
from pipeline.truth.quadrature.parts import A0, A1, B0, B1, BOX_WEIGHT, HALF, KIND, MIDDLE, Axis, density
from pipeline.truth.scattering.point import Directions, point_share

_BISECTIONS: Final = 8
LEVELS: Final = 6
"""Number of rules; level l has 2^(l + 1) nodes an axis."""

_RULES: Final = [np.polynomial.legendre.leggauss(count) for count in (2, 4, 8, 16, 32, 64)]
_NODES: Final = np.concatenate([nodes for nodes, _ in _RULES])  # rule of 2^(l + 1) nodes from 2^(l + 1) - 2 on
_WEIGHTS: Final = np.concatenate([weights for _, weights in _RULES])


@kernel
def _weight_across(part: Float64, axis: Axis, a: float) -> float:
    """Return kernel times length for each unit of the coordinate across."""
    if part[KIND] == GAP:
        return density(axis, a)
    stretch: float = part[HALF] * math.cos(a)
    return stretch * density(axis, part[MIDDLE] + part[HALF] * math.sin(a))


@kernel
def _shares(cloth: ClothSide, directions: Directions, part: Float64, a: float, b: float, shares: Float64) -> int:
    """Write the shares of a point of a part in the sums; return which of viewer, light and back it sees, as bits."""
    picks, ends = cloth.front.top.shape
    across = a if part[KIND] == GAP else part[MIDDLE] + part[HALF] * math.sin(a)
    x, y = (b, across) if part[KIND] == WEFT else (across, b)
    x = x - ends if x >= ends else x
    y = y - picks if y >= picks else y
    family, area, specular, diffuse, through = point_share(cloth.front, cloth.back, x, y, directions, cloth.choices)
    shares[:] = 0.0
    if family != GAP:
        shares[family], shares[2 + family] = specular, diffuse
    shares[4] = through
    shares[AREA] = directions.viewer.z if cloth.projected else area
    state = 1 if area > 0.0 else 0
    if specular + diffuse > 0.0:
        state += 2
    if family == GAP and through > 0.0:
        state += 4
    return state


@allocating_kernel
def integrate(
    cloth: ClothSide,
    directions: Directions,
    part: Float64,
    x_axis: Axis,
    y_axis: Axis,
    level: int,
    split: int,
    grid: Float64,
    states: Index,
    sums: Float64,
) -> int:
    """Write the sums over a part with 2^(level + 1) nodes an axis; return the points used."""
    n, rule = 2 << level, (2 << level) - 2
    across, along = (y_axis, x_axis) if part[KIND] == WEFT else (x_axis, y_axis)
    half_a, half_b = 0.5 * (part[A1] - part[A0]), 0.5 * (part[B1] - part[B0])
    mid_a, mid_b = 0.5 * (part[A1] + part[A0]), 0.5 * (part[B1] + part[B0])
    for i in range(n):
        for j in range(n):
            a, b = mid_a + half_a * _NODES[rule + i], mid_b + half_b * _NODES[rule + j]
            states[i, j] = _shares(cloth, directions, part, a, b, grid[i, j])
    used = n * n

    # Lines run in the direction that crosses more edges.
    crossed_a, crossed_b = 0, 0
    for i in range(n):
        for j in range(n):
            crossed_a += i > 0 and states[i, j] != states[i - 1, j]
            crossed_b += j > 0 and states[i, j] != states[i, j - 1]
    inner_a = crossed_a >= crossed_b
    sums[:] = 0.0
    line, point = np.zeros(SUMS), np.zeros(SUMS)
    middle, half = (mid_a, half_a) if inner_a else (mid_b, half_b)
    for k in range(n):
        if inner_a:
            fixed = mid_b + half_b * _NODES[rule + k]
            outer = half_b * _WEIGHTS[rule + k] * density(along, fixed)
        else:
            fixed = mid_a + half_a * _NODES[rule + k]
            outer = half_a * _WEIGHTS[rule + k] * _weight_across(part, across, fixed)
        line[:] = 0.0
        begin, first = middle - half, 0
        for m in range(1, n + 1):
            before = states[m - 1, k] if inner_a else states[k, m - 1]
            if m < n and (level < split or (states[m, k] if inner_a else states[k, m]) == before):
                continue
            finish = middle + half
            if m < n:
                low, high = middle + half * _NODES[rule + m - 1], middle + half * _NODES[rule + m]
                for _ in range(_BISECTIONS):
                    centre = 0.5 * (low + high)
                    a, b = (centre, fixed) if inner_a else (fixed, centre)
                    if _shares(cloth, directions, part, a, b, point) == before:
                        low = centre
                    else:
                        high = centre
                used += _BISECTIONS
                finish = 0.5 * (low + high)
            if m == n and first == 0:
                # No edge: the grid's own nodes serve.
                for i in range(n):
                    t = middle + half * _NODES[rule + i]
                    weight = half * _WEIGHTS[rule + i]
                    weight *= _weight_across(part, across, t) if inner_a else density(along, t)
                    line += weight * (grid[i, k] if inner_a else grid[k, i])
            elif before != 0 or cloth.projected:
                size = 2
                while size < m - first:
                    size *= 2
                for i in range(size - 2, 2 * size - 2):
                    t = 0.5 * (begin + finish) + 0.5 * (finish - begin) * _NODES[i]
                    weight = 0.5 * (finish - begin) * _WEIGHTS[i]
                    weight *= _weight_across(part, across, t) if inner_a else density(along, t)
                    a, b = (t, fixed) if inner_a else (fixed, t)
                    _shares(cloth, directions, part, a, b, point)
                    line += weight * point
                used += size
            begin, first = finish, m
        sums += outer * line
    sums *= part[BOX_WEIGHT]
    return used
