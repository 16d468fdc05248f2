"""Light straight through the gaps of a cloth, exactly by its geometry: no colour and no layer of fibres plays a part.

A ray passes if it crosses the fabric plane in a gap and neither face of the cloth hides that point from the direction
it comes from or goes to (pipeline.truth). The share of a patch is that of its middle, where a goniophotometer's lamp
stands, and the mean over places of all gaps. The places are a Sobol sequence, the same for all cloths, so that shares
change little where a cloth changes little. A cloth and its mirror image count as one, because measurements of shades
do: half of the rays are mirrored.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.stats import qmc

from pipeline.bsdf.klems import Basis
from pipeline.compiled.arrays import Float64, Index, Mask
from pipeline.compiled.decorators import kernel
from pipeline.truth.geometry.heightfield import UNDER, HeightField, height_field
from pipeline.truth.geometry.march import ray
from pipeline.truth.geometry.visibility import visible
from weaves.fabric import Fabric


class GapRays(NamedTuple):
    """Rays of Q patches, K each: directions (Q K, 3); place within a gap and number of the gap, (Q K, 3) in [0, 1)."""

    directions: Float64
    places: Float64


def middles(patches: Index) -> Float64:
    """Return the places of the middles of patches, (2, N), as `Basis.directions` takes them; 0 is the normal."""
    return np.where(patches == 0, 0.0, np.full((2, len(patches)), 0.5))


def gap_rays(basis: Basis, patches: Index, points: int) -> GapRays:
    """Return rays through the middles of patches, a power of two `points` each."""
    numbers = np.tile(qmc.Sobol(4, seed=0).random(points), (len(patches), 1))
    directions = np.repeat(basis.directions(patches, *middles(patches)), points, axis=0)
    directions[:, 1] *= np.where(numbers[:, 3] < 0.5, -1.0, 1.0)
    return GapRays(directions, np.ascontiguousarray(numbers[:, :3]))


def straight_share(fabric: Fabric, rays: GapRays, patches: int) -> Float64:
    """Return the share of light that goes straight through, for the rays of so many patches, (patches,)."""
    front, back = height_field(fabric), height_field(fabric.back())
    picks, ends = front.top.shape
    cell = (rays.places[:, 2] * (picks * ends)).astype(np.int64)
    # Gaps lie around the corners of cells.
    x = (cell % ends + (rays.places[:, 0] - 0.5) * (1.0 - fabric.warp.width)) % ends
    y = (cell // ends + (rays.places[:, 1] - 0.5) * (1.0 - fabric.weft.width)) % picks
    passed = np.empty(len(x), np.bool_)
    _pass(front, back, x, y, rays.directions, passed)
    share = passed.reshape(patches, -1).mean(axis=1)
    return np.asarray((1.0 - fabric.warp.width) * (1.0 - fabric.weft.width) * share)


@kernel
def _pass(front: HeightField, back: HeightField, x: Float64, y: Float64, directions: Float64, passed: Mask) -> None:
    """Write which rays through points of gaps neither face hides."""
    for n in range(len(x)):
        dx, dy, dz = directions[n, 0], directions[n, 1], directions[n, 2]
        passed[n] = visible(front, x[n], y[n], 0.0, UNDER, ray(dx, dy, dz, 0.0)) and visible(
            back, x[n], y[n], 0.0, UNDER, ray(-dx, -dy, dz, 0.0)
        )
