"""Lobes of a patch: the flakes' lobes at a few points of the footprint and two cosines, to draw directions from.

    pdf(wi) = P_front <wi.n_s> / pi + P_back <-wi.n_s> / pi + sum_k P_k D_k(h) / (4 sigma_k(wo))

The points are the first of a low-discrepancy sequence in the footprint, the same at every call, so that the density of
a sample is known exactly. Each represents its surroundings: where tangents differ from point to point by s, its
roughness is widened to alpha^2 + (widening s / points)^2; and one broad lobe a family, as wide as all its tangents, has
`BROAD` of its share, so that nothing between the points is without a sample. At a small footprint all points are alike,
and the mixture is the exact sampler of a point (pipeline.analytic.importance.point) beside the cosines of the diffuse
light.

A lobe's share is its visible area, times k_s, times the light scattered once by the layer, about half of
1 - exp(-T Lambda); a cosine's is visible area times k_d, on the other side k_dt. No shadows of the light enter: they
change the variance, not the density.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np

from pipeline.analytic.importance.point import flake_scatter_pdf, sample_flake_scatter
from pipeline.compiled.arrays import Float64, Index
from pipeline.compiled.decorators import allocating_kernel, kernel
from pipeline.truth.cloth import ClothSide, Columns
from pipeline.truth.footprint.place import place_pair
from pipeline.truth.footprint.sequences import r2_pair
from pipeline.truth.geometry.heightfield import ALPHA, GAP, surface_at
from pipeline.truth.geometry.visibility import ray, visible
from pipeline.truth.scattering.microflake import sigma

_SCATTERED: Final = 0.5  # share of the light that meets a flake and leaves without meeting a second one, roughly
BROAD: Final = 0.2
"""Share of a family's lobes that its broad one has."""

_LEAST: Final = 0.02  # share of each cosine at least: no light is without a sample


class Lobes(NamedTuple):
    """Mixtures for N queries.

    Attributes
    ----------
    tangent : float64 (N, K, 3)
        Fibre tangents; the last two lobes are the broad ones of warp and weft.
    alpha : float64 (N, K)
        Roughness, widened.
    share : float64 (N, K)
        Probability of each lobe; 0 for points that the viewer does not see.
    cosine : float64 (N, 2)
        Probability of the cosine on the viewer's side and of that on the other.
    """

    tangent: Float64
    alpha: Float64
    share: Float64
    cosine: Float64


@allocating_kernel
def find_lobes(
    model: ClothSide,
    columns: Columns,
    count: int,
    widening: float,
    specular: Float64,
    diffuse: Float64,
    through: Float64,
) -> Lobes:
    """Return the mixtures of queries, whose wi does not matter, from `count` points each.

    `specular`, `diffuse` and `through` are the luminances of k_s, k_d and k_dt of warp and weft, (2,).
    """
    rows, front = len(columns.u), model.front
    picks, ends = front.top.shape
    tangent, alpha = np.zeros((rows, count + 2, 3)), np.ones((rows, count + 2))
    share, cosine = np.zeros((rows, count + 2)), np.zeros((rows, 2))
    families = np.full(count + 2, GAP)
    tangent[:, :, 2] = 1.0
    for row in range(rows):
        wo = columns.wo[row]
        towards = ray(wo[0], wo[1], wo[2], 0.0)
        for k in range(count):
            first, second = r2_pair(np.uint64(0), k)
            x, y, weight = place_pair(
                model.shape, columns.u[row], columns.v[row], columns.sigma[row], columns.sigma_minor[row],
                columns.angle[row], float(ends), float(picks), first, second,
            )  # fmt: skip
            family, side, z, nx, ny, nz, tx, ty, tz = surface_at(front, x, y, int(x), int(y))
            families[k] = family
            if family == GAP:
                continue
            cos_o = wo[0] * nx + wo[1] * ny + wo[2] * nz
            if cos_o <= 0.0 or not visible(front, x, y, z, side, towards):
                continue
            area = weight * cos_o / nz
            tangent[row, k, 0], tangent[row, k, 1], tangent[row, k, 2] = tx, ty, tz
            alpha[row, k] = front.yarn[family, ALPHA]
            depth = front.thickness * sigma(wo[0], wo[1], wo[2], tx, ty, tz, alpha[row, k]) / cos_o
            share[row, k] = area * specular[family] * _SCATTERED * (1.0 - math.exp(-depth))
            cosine[row, 0] += area * diffuse[family]
            cosine[row, 1] += area * through[family]
        _widen(tangent[row], alpha[row], share[row], families, widening)
        total = share[row].sum() + cosine[row].sum()
        flakes = 1.0 - 2.0 * _LEAST if total > 0.0 else 0.0
        share[row] *= flakes / max(total, 1e-300)
        for side in range(2):
            cosine[row, side] = cosine[row, side] * flakes / max(total, 1e-300) + (_LEAST if total > 0.0 else 0.5)
    return Lobes(tangent, alpha, share, cosine)


@kernel
def _widen(tangent: Float64, alpha: Float64, share: Float64, families: Index, widening: float) -> None:
    """Widen the roughness of each family's lobes by how much its tangents differ, and add its broad lobe."""
    count = len(share) - 2
    for family in range(2):
        seen, x, y, z, whole, rough = 0, 0.0, 0.0, 0.0, 0.0, 1.0
        for k in range(count):
            if families[k] == family and share[k] > 0.0:
                # A tangent and its opposite are the same fibre.
                t = tangent[k]
                turn = 1.0 if t[0] * x + t[1] * y + t[2] * z >= 0.0 else -1.0
                x, y, z = x + turn * t[0], y + turn * t[1], z + turn * t[2]
                seen, whole, rough = seen + 1, whole + share[k], alpha[k]
        if seen < 2:
            continue
        length = math.sqrt(x * x + y * y + z * z)
        apart = max(1.0 - (length / seen) ** 2, 0.0)
        for k in range(count):
            if families[k] == family and share[k] > 0.0:
                alpha[k] = min(math.sqrt(alpha[k] ** 2 + apart * (widening / seen) ** 2), 1.0)
                share[k] *= 1.0 - BROAD
        broad = count + family
        tangent[broad] = x / length, y / length, z / length
        alpha[broad], share[broad] = min(math.sqrt(rough * rough + apart), 1.0), BROAD * whole


@allocating_kernel
def draw(lobes: Lobes, wo: Float64, random: Float64) -> Float64:
    """Return a unit wi for each query, (N, 3), from three numbers in [0, 1), (N, 3)."""
    found = np.zeros((len(wo), 3))
    for row in range(len(wo)):
        pick, first, second = random[row, 0], random[row, 1], random[row, 2]
        drawn = False
        for k in range(lobes.share.shape[1]):
            if pick < lobes.share[row, k]:
                t, w = lobes.tangent[row, k], wo[row]
                found[row] = sample_flake_scatter(
                    w[0], w[1], w[2], t[0], t[1], t[2], lobes.alpha[row, k], first, second
                )
                drawn = True
                break
            pick -= lobes.share[row, k]
        if not drawn:
            side = 1.0 if pick < lobes.cosine[row, 0] else -1.0
            radius, turn = math.sqrt(first), 2.0 * math.pi * second
            found[row, 0], found[row, 1] = radius * math.cos(turn), radius * math.sin(turn)
            found[row, 2] = side * math.sqrt(max(1.0 - first, 1e-30))
    return found


@allocating_kernel
def densities(lobes: Lobes, wi: Float64, wo: Float64) -> Float64:
    """Return the density with which `draw` finds each unit wi, (N,), in 1/sr over the whole sphere."""
    found = np.zeros(len(wo))
    for row in range(len(wo)):
        i, w = wi[row], wo[row]
        density = (lobes.cosine[row, 0] if i[2] > 0.0 else lobes.cosine[row, 1]) * abs(i[2]) / math.pi
        for k in range(lobes.share.shape[1]):
            if lobes.share[row, k] > 0.0:
                t = lobes.tangent[row, k]
                density += lobes.share[row, k] * flake_scatter_pdf(
                    w[0], w[1], w[2], i[0], i[1], i[2], t[0], t[1], t[2], lobes.alpha[row, k]
                )
        found[row] = density
    return found
