"""The point model once a cluster, in the loop that reads four texels of a table; without branches."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from pipeline.analytic.soft_horizons import ramp
from pipeline.analytic.soft_nodes.shade import NodeFrame, Six, YarnDirections, YarnLayer, shade_node, yarn_layer
from pipeline.analytic.summed_area.clusters import LANES
from pipeline.analytic.summed_area.layers import HeightLayer, layer_share
from pipeline.analytic.summed_area.tables import (
    AREA,
    MEAN,
    MEAN_SCALE,
    SPREAD,
    SPREAD_SCALE,
    SPREAD_U,
    SPREAD_V,
    ClusterTables,
    U,
    V,
)
from pipeline.analytic.torus_frame import Angles, Fibre, normal, tangent, turning
from pipeline.compiled.arrays import Float32
from pipeline.compiled.decorators import inlined_fast_kernel
from pipeline.truth.geometry.heightfield import BETA, COS_TWIST, SIN_TWIST

CORNERS: Final = 4
"""Texels around a centre."""

Slots = npt.NDArray[np.uint32]
Nine = tuple[
    np.float32, np.float32, np.float32, np.float32, np.float32, np.float32, np.float32, np.float32, np.float32
]  # fmt: skip
Four = tuple[np.float32, np.float32, np.float32, np.float32]

_0, _1, _HALF = np.float32(0.0), np.float32(1.0), np.float32(0.5)
_TINY = np.float32(1e-18)
_ONE_LEVEL = _1 / MEAN_SCALE
# Width of a ramp: a share of that of an even distribution, sqrt 12 standard deviations, and a least one.
_WIDTH = np.float32(0.8 * math.sqrt(12.0)) / SPREAD_SCALE
_SHARPEST = np.float32(0.02)
# A horizon's ramp has a faint tail, so that a patch hidden almost wholly still has a colour: that of its edge.
_TAIL = np.float32(0.001)
_S3, _S5, _S7 = (np.float32(c) for c in (-1 / 6, 1 / 120, -1 / 5040))
_C2, _C4, _C6, _C8 = (np.float32(c) for c in (-1 / 2, 1 / 24, -1 / 720, 1 / 40320))


class Azimuth(NamedTuple):
    """The azimuths around a direction, the nearer one, and where between them it lies."""

    low: int
    high: int
    near: int
    turn: np.float32


class Optics(NamedTuple):
    """A family of yarns: twist and relief, and the layer of flakes."""

    fibre: Fibre
    layer: YarnLayer


@inlined_fast_kernel
def optics(yarn: Float32, thickness: np.float32) -> Optics:
    """Return the optics of a family, given its row of `HeightField.yarn`."""
    return Optics(Fibre(yarn[SIN_TWIST], yarn[COS_TWIST], yarn[BETA]), yarn_layer(yarn, thickness))


@inlined_fast_kernel
def corner(
    surface: Float32, horizon: npt.NDArray[np.uint8], slot: int, k: int, weight: np.float32, i: Azimuth, o: Azimuth
) -> Nine:
    """Return a cluster's share from one texel: area, and times it v, u, spreads, horizons and spreads of both."""
    area = weight * surface[slot, AREA, k]
    low, high = np.float32(horizon[slot, i.low, MEAN, k]), np.float32(horizon[slot, i.high, MEAN, k])
    of_light = low + i.turn * (high - low)
    low, high = np.float32(horizon[slot, o.low, MEAN, k]), np.float32(horizon[slot, o.high, MEAN, k])
    of_viewer = low + o.turn * (high - low)
    return (
        area,
        area * surface[slot, V, k],
        area * surface[slot, U, k],
        area * surface[slot, SPREAD_V, k],
        area * surface[slot, SPREAD_U, k],
        area * of_light,
        area * np.float32(horizon[slot, i.near, SPREAD, k]),
        area * of_viewer,
        area * np.float32(horizon[slot, o.near, SPREAD, k]),
    )


@inlined_fast_kernel
def over_horizon(z: np.float32, low: np.float32, width: np.float32, inverse: np.float32) -> np.float32:
    """Return by how many widths of the ramp a direction clears a horizon, given the sums and 1 over their area."""
    return (z - low * inverse * _ONE_LEVEL) / (width * inverse * _WIDTH + _SHARPEST)


@inlined_fast_kernel
def evaluate(sums: Nine, d: YarnDirections, own: Optics) -> Six:
    """Return a cluster's sums as `shade_node` does, from its sums over the texels."""
    area, v, u, spread_v, spread_u, low_i, width_i, low_o, width_o = sums
    inverse = _1 / max(area, _TINY)
    v, u = v * inverse, u * inverse
    over_i, over_o = over_horizon(d.iz, low_i, width_i, inverse), over_horizon(d.oz, low_o, width_o, inverse)
    seen, lit = ramp(over_o) + _TAIL / (_1 + over_o * over_o), ramp(over_i)
    # Sine to 2e-4 and cosine to 3e-5 on [-pi/2, pi/2].
    v2, u2 = v * v, u * u
    a = Angles(
        v * (_1 + v2 * (_S3 + v2 * (_S5 + v2 * _S7))),
        max(_1 + v2 * (_C2 + v2 * (_C4 + v2 * (_C6 + v2 * _C8))), _TINY),
        u * (_1 + u2 * (_S3 + u2 * (_S5 + u2 * _S7))),
        max(_1 + u2 * (_C2 + u2 * (_C4 + u2 * (_C6 + u2 * _C8))), _TINY),
    )
    nx, ny, nz = normal(a, own.fibre.beta)
    t = tangent(a, own.fibre)
    by_u, by_v = turning(d.ix + d.ox, d.iy + d.oy, d.iz + d.oz, t, a, own.fibre)
    # The area is that of the surface: no division by n_z.
    at = NodeFrame(nx, ny, nz, _1, t.x, t.y, t.z)
    return shade_node(d, at, spread_u * inverse * by_u, spread_v * inverse * by_v, seen, lit, area, own.layer)


@inlined_fast_kernel
def _part(
    tables: ClusterTables, slot: int, k: int, weight: np.float32, i: Azimuth, o: Azimuth, layer: HeightLayer | None
) -> Nine:
    """Return what `corner` does, of a layer or of all heights."""
    if layer is not None:
        weight *= layer_share(tables.height[slot], k, layer)
    return corner(tables.surface, tables.horizon, slot, k, weight, i, o)


@inlined_fast_kernel
def _cluster(
    tables: ClusterTables, slots: tuple[int, int, int, int], k: int, weights: Four, i: Azimuth, o: Azimuth,
    d: YarnDirections, own: Optics, layer: HeightLayer | None,
) -> Six:  # fmt: skip
    """Return the sums of cluster k of a block."""
    p = _part(tables, slots[0], k, weights[0], i, o, layer)
    q = _part(tables, slots[1], k, weights[1], i, o, layer)
    r = _part(tables, slots[2], k, weights[2], i, o, layer)
    s = _part(tables, slots[3], k, weights[3], i, o, layer)
    sums = (
        p[0] + q[0] + r[0] + s[0], p[1] + q[1] + r[1] + s[1], p[2] + q[2] + r[2] + s[2], p[3] + q[3] + r[3] + s[3],
        p[4] + q[4] + r[4] + s[4], p[5] + q[5] + r[5] + s[5], p[6] + q[6] + r[6] + s[6], p[7] + q[7] + r[7] + s[7],
        p[8] + q[8] + r[8] + s[8],
    )  # fmt: skip
    return evaluate(sums, d, own)


@inlined_fast_kernel
def sum_clusters(
    tables: ClusterTables, slots: Slots, count: int, weights: Four, i: Azimuth, o: Azimuth, d: YarnDirections,
    yarn: Float32, layer: HeightLayer | None,
) -> Four:  # fmt: skip
    """Return seen area, diffuse, specular and bare area of the first `count` blocks of `slots`, (blocks, CORNERS).

    Of a `layer`, what lies in it; None: in all heights.
    """
    own = optics(yarn, tables.thickness)
    area, diffuse, specular, bare = _0, _0, _0, _0
    for b in range(count):
        four = slots[b, 0], slots[b, 1], slots[b, 2], slots[b, 3]
        for k in range(LANES):
            part = _cluster(tables, four, k, weights, i, o, d, own, layer)
            area += part[0]
            diffuse += part[1]
            specular += part[2]
            bare += part[3]
    return area, diffuse, specular, bare
