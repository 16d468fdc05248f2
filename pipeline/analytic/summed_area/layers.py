"""Clusters under a footprint of view rays, which meet those of other heights at other places.

Seen along wo, a point of height h over the reference plane appears h wo_xy / wo_z away from its place. The rays of a
footprint cross layers of height one after the other: where its middle crosses a layer, tables are read as for a
footprint of the fabric plane, and a cluster counts by the share of its area in the layer. In a texel a cluster is
spread evenly over its heights, mean +- sqrt 3 standard deviations, and at least over the thickness of a layer: between
layers, weights are linear. What is hidden is behind the horizons of the tables.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from pipeline.analytic.soft_nodes.shade import Six, YarnDirections
from pipeline.analytic.summed_area.clusters import LANES
from pipeline.analytic.summed_area.shade import Azimuth, Four, Nine, Optics, Slots, corner, evaluate, optics
from pipeline.analytic.summed_area.tables import MEAN, OCTAVE_STEPS, SPREAD, ClusterTables
from pipeline.compiled.arrays import Float32, Index
from pipeline.compiled.decorators import inlined_fast_kernel

MOST_LAYERS: Final = 24
"""Most layers of height."""

_APART = 1.2  # of a footprint's deviation, from where a ray crosses a layer to where it crosses the next
_NONE = 0.1  # of its deviation, by which all heights may appear displaced and count as one
_0, _HALF = np.float32(0.0), np.float32(0.5)


class HeightLayer(NamedTuple):
    """A layer: its middle over the reference plane, and half its thickness."""

    middle: np.float32
    half: np.float32


def layers_of(tables: ClusterTables, sigma: Float32, wo: Float32) -> Index:
    """Return the number of layers for N round footprints of deviations `sigma`, and 1 where they displace nothing.

    That is where all heights appear within a tenth of a deviation, and where the cloth's mean is the answer.
    """
    deviation = np.maximum(sigma, tables.finest)
    moved = np.hypot(wo[:, 0], wo[:, 1]) / wo[:, 2] * (tables.extent[0, 1] - tables.extent[0, 0])
    layers = np.minimum(np.ceil(moved / (_APART * deviation)) + 1, MOST_LAYERS).astype(np.int64)
    octaves = np.log2(deviation.astype(np.float64) / tables.finest)
    last = (octaves * OCTAVE_STEPS + 0.5).astype(np.int64) >= len(tables.levels) - 1
    return np.where(last | (moved <= _NONE * deviation), 1, layers)


@inlined_fast_kernel
def _share(height: Float32, k: int, layer: HeightLayer) -> np.float32:
    """Return the share of a cluster of a texel, `height` (2, LANES), that lies in a layer."""
    middle, half = height[MEAN, k], max(height[SPREAD, k], layer.half)
    inside = min(middle + half, layer.middle + layer.half) - max(middle - half, layer.middle - layer.half)
    return np.float32(max(inside, _0) / (half + half))


@inlined_fast_kernel
def _part(
    tables: ClusterTables, slot: int, k: int, weight: np.float32, layer: HeightLayer, i: Azimuth, o: Azimuth
) -> Nine:
    share = _share(tables.height[slot], k, layer)
    return corner(tables.surface, tables.horizon, slot, k, weight * share, i, o)


@inlined_fast_kernel
def _cluster(
    tables: ClusterTables, slots: tuple[int, int, int, int], k: int, weights: Four, layer: HeightLayer, i: Azimuth,
    o: Azimuth, d: YarnDirections, own: Optics,
) -> Six:  # fmt: skip
    """Return the sums of what a layer has of cluster k of a block."""
    p = _part(tables, slots[0], k, weights[0], layer, i, o)
    q = _part(tables, slots[1], k, weights[1], layer, i, o)
    r = _part(tables, slots[2], k, weights[2], layer, i, o)
    s = _part(tables, slots[3], k, weights[3], layer, i, o)
    sums = (
        p[0] + q[0] + r[0] + s[0], p[1] + q[1] + r[1] + s[1], p[2] + q[2] + r[2] + s[2], p[3] + q[3] + r[3] + s[3],
        p[4] + q[4] + r[4] + s[4], p[5] + q[5] + r[5] + s[5], p[6] + q[6] + r[6] + s[6], p[7] + q[7] + r[7] + s[7],
        p[8] + q[8] + r[8] + s[8],
    )  # fmt: skip
    return evaluate(sums, d, own)


@inlined_fast_kernel
def sum_layer(
    tables: ClusterTables, slots: Slots, count: int, weights: Four, layer: HeightLayer, i: Azimuth, o: Azimuth,
    d: YarnDirections, yarn: Float32,
) -> Four:  # fmt: skip
    """Return seen area, diffuse, specular and bare area that a layer has of the first `count` blocks of `slots`."""
    own = optics(yarn, tables.thickness)
    area, diffuse, specular, bare = _0, _0, _0, _0
    for b in range(count):
        four = slots[b, 0], slots[b, 1], slots[b, 2], slots[b, 3]
        for k in range(LANES):
            part = _cluster(tables, four, k, weights, layer, i, o, d, own)
            area += part[0]
            diffuse += part[1]
            specular += part[2]
            bare += part[3]
    return area, diffuse, specular, bare
