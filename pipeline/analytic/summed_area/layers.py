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

from pipeline.analytic.summed_area.tables import MEAN, OCTAVE_STEPS, SPREAD, ClusterTables
from pipeline.compiled.arrays import Float32, Index
from pipeline.compiled.decorators import inlined_fast_kernel

MOST_LAYERS: Final = 24
"""Most layers of height."""

_APART = 1.2  # of a footprint's deviation, from where a ray crosses a layer to where it crosses the next
_NONE = 0.1  # of its deviation, by which all heights may appear displaced and count as one
_0 = np.float32(0.0)


class HeightLayer(NamedTuple):
    """A layer: its middle over the reference plane, and half its thickness."""

    middle: np.float32
    half: np.float32


def layers_of(tables: ClusterTables, sigma: Float32, wo: Float32) -> Index:
    """Return the number of layers for N round footprints of deviations `sigma`, and 1 where they displace nothing.

    That is where all heights appear within a tenth of a deviation, where the cloth's mean is the answer, and without
    parallax everywhere.
    """
    if not len(tables.extent):
        return np.ones(len(sigma), np.int64)
    deviation = np.maximum(sigma, tables.finest)
    moved = np.hypot(wo[:, 0], wo[:, 1]) / wo[:, 2] * (tables.extent[0, 1] - tables.extent[0, 0])
    layers = np.minimum(np.ceil(moved / (_APART * deviation)) + 1, MOST_LAYERS).astype(np.int64)
    octaves = np.log2(deviation.astype(np.float64) / tables.finest)
    last = (octaves * OCTAVE_STEPS + 0.5).astype(np.int64) >= len(tables.levels) - 1
    return np.where(last | (moved <= _NONE * deviation), 1, layers)


@inlined_fast_kernel
def layer_share(height: Float32, k: int, layer: HeightLayer) -> np.float32:
    """Return the share of a cluster of a texel, `height` (2, LANES), that lies in a layer."""
    middle, half = height[MEAN, k], max(height[SPREAD, k], layer.half)
    inside = min(middle + half, layer.middle + layer.half) - max(middle - half, layer.middle - layer.half)
    return np.float32(max(inside, _0) / (half + half))
