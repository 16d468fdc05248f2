"""One table of a cloth: light of the second bounce and of all further ones, whatever the colours.

With diffuse colours k_w, k_f on the diagonal of k, the light that is seen on family a after two bounces and more is
k_a g_a, for each channel

    g_a(wi, wo) = sum_b k_b (C2_ab(wi, wo)
                  + sum_c R_abc(wo) k_c (s(wi, wo) e_bc(wi) + m(wo) sum_d M_bcd [k (1 - M' k)^-1 e'(wi)]_d))

The second bounce is exact, up to the noise of walks (`walks`). In the third the factor s is about 1; it makes the sum
over the families right, and so does m in the fourth. All later ones are a geometric series in the cloth's own
transfers. Each C2_ab is a sum of RANK products of a function of the viewer and one of the light, and s of
`RANK_OF_THIRD`, the largest of a singular value decomposition. All functions are known on a grid of directions and
linear between.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np

from pipeline.analytic.bounces.walks import transport
from pipeline.compiled.arrays import Float32, Float64
from pipeline.compiled.decorators import inlined_kernel, kernel
from pipeline.truth.geometry.heightfield import height_field
from weaves.fabric import Fabric

RANK: Final = 10
"""Products that make up the light of second bounces: more are its noise."""
RANK_OF_THIRD: Final = 4
"""Products that make up the factor of third bounces."""
WALKS: Final = 1 << 16
"""Walks of a table."""
_ANGLES: Final = 16
_AZIMUTHS: Final = 24
_STEEPEST: Final = math.radians(89.0)
"""Angle to the normal of the last directions of the grid; beyond, functions are those of these."""
_PRODUCTS: Final = 4 * RANK + RANK_OF_THIRD
_LEAST: Final = 1e-12
"""Least divisor: where nothing is seen or lit, the quotients are 0."""
_PASSES: Final = 3


class BounceTable(NamedTuple):
    """Light that the yarns of one side of a cloth give to each other.

    Attributes
    ----------
    viewer : float32 (G, 4 RANK + RANK_OF_THIRD + 9)
        On the grid: the viewer's factors of C2 and of s, R, and m; families in the order of the indices, warp first.
    light : float32 (G, 4 RANK + RANK_OF_THIRD + 6)
        The light's factors, e and e'; all but the factors of s are over the cosine of the light.
    transfers : float64 (6, 2)
        M in four rows, and M': the share of what a family sends on that has its light from each family.
    """

    viewer: Float32
    light: Float32
    transfers: Float64


def bounce_table(fabric: Fabric, walks: int = WALKS) -> BounceTable:
    """Tabulate the side of a fabric that is seen from z > 0; its colours play no part. It takes some seconds."""
    grid = _grid()
    sums = transport(height_field(fabric), walks, grid, grid)
    count, seen, whole = len(grid), np.maximum(sums.seen, _LEAST)[:, None], np.maximum(sums.later[..., -1:], _LEAST)
    reached, later = sums.reached.reshape(count, 8) / seen, sums.later[..., :count] / whole / grid[:, 2]
    factors = []
    for k in range(4):
        second = sums.second.reshape(count, 4, count)[:, k] / seen / grid[:, 2]
        # In units of each viewer's and each light's own mean, so that grazing ones count as much.
        of_viewer, of_light = (np.maximum(second.mean(axis=axis), _LEAST) for axis in (1, 0))
        viewers, lights = _products(second / of_viewer[:, None] / of_light, RANK)
        factors.append((viewers * of_viewer[:, None], lights * of_light[:, None]))
    transfers = sums.transfers / whole
    going_on = np.maximum(reached.reshape(count, 2, 4).sum(axis=1) @ transfers[:4].sum(axis=1), _LEAST)
    series = np.maximum(reached.reshape(count, 2, 4).sum(axis=1) @ later[:4], _LEAST)
    factors.append(_products(sums.third / seen / grid[:, 2] / series, RANK_OF_THIRD))
    return BounceTable(
        np.concatenate(
            [*(viewers for viewers, _ in factors), reached, sums.further[:, None] / seen / going_on[:, None]], axis=1
        ).astype(np.float32),
        np.concatenate([*(lights for _, lights in factors), later.T], axis=1).astype(np.float32),
        transfers,
    )


def _products(matrix: Float64, rank: int) -> tuple[Float64, Float64]:
    """Return columns (rows, rank) and columns (columns, rank): the matrix is about the sum of their products.

    The first singular vectors by a few passes of a block of twice as many [Halko2011Randomized].
    """
    block = np.random.default_rng(0).standard_normal((matrix.shape[1], 2 * rank))
    for _ in range(_PASSES):
        block = matrix.T @ np.linalg.qr(matrix @ block)[0]
        block = np.linalg.qr(block)[0]
    left, size, right = np.linalg.svd(matrix @ block, full_matrices=False)
    return left[:, :rank] * size[:rank], block @ right[:rank].T


def _grid() -> Float64:
    """Return the directions of the grid, (_ANGLES * _AZIMUTHS, 3), azimuths in the inner order."""
    angle = _STEEPEST * np.arange(_ANGLES) / (_ANGLES - 1.0)
    azimuth = 2.0 * np.pi * np.arange(_AZIMUTHS) / _AZIMUTHS
    sine, z = np.sin(angle)[:, None], np.broadcast_to(np.cos(angle)[:, None], (_ANGLES, _AZIMUTHS))
    return np.stack([sine * np.cos(azimuth), sine * np.sin(azimuth), z], axis=-1).reshape(-1, 3)


def bounced(table: BounceTable, wi: Float32, wo: Float32, diffuse: Float64) -> Float64:
    """Return g of N pairs of directions, both with z > 0, for diffuse colours of warp and weft, (2, 3): (N, 2, 3)."""
    rows = len(wi)
    second, reached, later = np.empty((rows, 2, 2)), np.empty((rows, 2, 2, 2)), np.empty((rows, 6))
    _read(table, wi, wo, second, reached, later, np.empty(_PRODUCTS + 9), np.empty(_PRODUCTS + 6))
    result = np.einsum("nab,bx->nax", second, diffuse)
    for channel in range(diffuse.shape[1]):
        k = diffuse[:, channel]
        series = table.transfers[:4] * k @ np.linalg.inv(np.eye(2) - table.transfers[4:] * k)
        lit = (later[:, :4] + later[:, 4:] @ series.T).reshape(rows, 2, 2)
        result[:, :, channel] += np.einsum("nabc,b,c,nbc->na", reached, k, k, lit)
    return np.asarray(np.maximum(result, 0.0))


@kernel
def _read(
    table: BounceTable,
    wi: Float32,
    wo: Float32,
    second: Float64,
    reached: Float64,
    later: Float64,
    viewer: Float64,
    light: Float64,
) -> None:
    """Write C2, R, s e and m e' of pairs of directions; `viewer` and `light` are scratch."""
    for row in range(len(wi)):
        _interpolate(table.viewer, wo[row, 0], wo[row, 1], wo[row, 2], viewer)
        _interpolate(table.light, wi[row, 0], wi[row, 1], wi[row, 2], light)
        cosine = wi[row, 2]
        for k in range(4):
            second[row, k // 2, k % 2] = cosine * _product(viewer, light, k * RANK, (k + 1) * RANK)
        factor = max(_product(viewer, light, 4 * RANK, _PRODUCTS), 0.0)
        for k in range(8):
            reached[row, k // 4, k // 2 % 2, k % 2] = viewer[_PRODUCTS + k]
        for k in range(6):
            later[row, k] = (factor if k < 4 else viewer[_PRODUCTS + 8]) * cosine * light[_PRODUCTS + k]


@inlined_kernel
def _product(viewer: Float64, light: Float64, first: int, last: int) -> float:
    total = 0.0
    for r in range(first, last):
        total += viewer[r] * light[r]
    return total


@kernel
def _interpolate(values: Float32, x: float, y: float, z: float, result: Float64) -> None:
    """Write the values of a grid of directions at one of them."""
    angle = math.acos(min(z, 1.0)) / _STEEPEST * (_ANGLES - 1.0)
    ring = min(int(angle), _ANGLES - 2)
    outer = min(angle - ring, 1.0)
    turn = math.atan2(y, x) / (2.0 * math.pi) * _AZIMUTHS
    before = math.floor(turn)
    place, column = turn - before, int(before) % _AZIMUTHS
    following = (column + 1) % _AZIMUTHS
    for c in range(len(result)):
        inside = values[ring * _AZIMUTHS + column, c] * (1.0 - place) + values[ring * _AZIMUTHS + following, c] * place
        ring_out = (ring + 1) * _AZIMUTHS
        outside = values[ring_out + column, c] * (1.0 - place) + values[ring_out + following, c] * place
        result[c] = inside * (1.0 - outer) + outside * outer
