"""The reference plane of footprints: the mean height of the surface that is seen from straight above.

A view ray belongs to the point at which it crosses this plane. Gaps have no height and do not count. The mean is an
integral over pieces of tori, by Gauss-Legendre along a yarn, and across it in the angle v, x = r sin v.
"""

from __future__ import annotations

import math

import numpy as np

from pipeline.compiled.arrays import Float64
from pipeline.compiled.decorators import kernel
from pipeline.truth.geometry.heightfield import OFFSET, RADIUS, TOP, UNDER, HeightField, height_beneath, torus_height

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(24)


def reference_plane(field: HeightField) -> float:
    """Return the mean height of one side of a cloth, in yarn spacings above the yarns' axes at the ends of floats."""
    height, area = _sums(field, _NODES, _WEIGHTS)
    return float(height / area)


@kernel
def _sums(field: HeightField, nodes: Float64, weights: Float64) -> tuple[float, float]:
    """Return the integrals of the height and of 1 over everything that is seen from straight above."""
    height, area = 0.0, 0.0
    picks, ends = field.top.shape
    for pick in range(picks):
        for end in range(ends):
            top = int(field.top[pick, end])
            radius = field.yarn[top, RADIUS]
            h, a = _piece(field, top, TOP, pick, end, -0.5, 0.5, nodes, weights)
            height, area = height + h, area + a
            if radius < 0.5:
                for sign in (-1.0, 1.0):
                    low, high = min(sign * radius, sign * 0.5), max(sign * radius, sign * 0.5)
                    h, a = _piece(field, 1 - top, UNDER, pick, end, low, high, nodes, weights)
                    height, area = height + h, area + a
    return height, area


@kernel
def _piece(
    field: HeightField, family: int, side: int, pick: int, end: int, low: float, high: float, nodes: Float64,
    weights: Float64,
) -> tuple[float, float]:  # fmt: skip
    """Return the same for one piece, from `low` to `high` along its yarn, from the middle of the cell."""
    yarn, own = field.yarn[family], field.floats[pick, end, side]
    radius, middle, half = yarn[RADIUS], own[OFFSET] + 0.5 * (low + high), 0.5 * (high - low)
    height, area = 0.0, 0.0
    for i in range(len(nodes)):
        v = 0.5 * math.pi * nodes[i]
        share = 0.5 * math.pi * weights[i] * radius * math.cos(v) * half
        for k in range(len(nodes)):
            y = middle + half * nodes[k]
            if side == TOP:
                h, _, _ = torus_height(yarn, own, radius * math.sin(v), y)
            else:
                h, _, _ = height_beneath(yarn, own, radius * math.sin(v), y)
            height += share * weights[k] * h
            area += share * weights[k]
    return height, area
