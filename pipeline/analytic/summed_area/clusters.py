"""Clusters of a cloth's surface: parts that have alike normals, fibre directions and horizons.

Across a yarn the surface falls into LANES parts, even in the angle v. Along it, each piece falls into slices, which
k-means joins to blocks: slices of a family are alike if their inclination and their horizons are. A cluster is a part
of a block. Blocks are split one by one, that of most variance first, so that both families get as many as they need.
"""

from __future__ import annotations

import math
from collections import Counter
from typing import Final, NamedTuple

import numpy as np

from pipeline.analytic import soft_horizons
from pipeline.analytic.gauss_rules import grid_edges, grid_middles
from pipeline.analytic.summed_area.horizon_map import HorizonMap, slot_of
from pipeline.compiled.arrays import Float64, Index
from pipeline.truth.geometry.heightfield import BETA, GAP, RADIUS, WARP, HeightField
from pipeline.truth.geometry.pieces import CellPiece, cell_pieces

LANES: Final = 8
"""Clusters of a block: parts across a yarn."""

_QUARTERS: Final = 4  # parts across a yarn whose horizons k-means compares
_ROUNDS: Final = 20
_INCLINATION: Final = 0.7  # weight of the sine of the inclination beside the root mean square of horizons
_STEEPEST: Final = 0.99999


class Patch(NamedTuple):
    """A piece of yarn, or a gap, on the nodes of a horizon map: (along, across) each."""

    piece: CellPiece
    """Its place within a cell."""
    surface: Float64
    """Area of the surface over that of the plane, (G, G)."""
    v: Float64
    u: Float64
    """Angles across and along the yarn, (G, G)."""
    horizon: Float64
    """Sine of the horizon's elevation, at every other azimuth of soft nodes, (azimuths, G, G)."""
    height: Float64
    """Height over the fabric plane, (G, G)."""


class PlacedPatch(NamedTuple):
    """A patch at a cell (pick, end) of the repeat; `block` is its number in the horizon map."""

    pick: int
    end: int
    block: int


def sources(field: HeightField, table: HorizonMap) -> tuple[list[PlacedPatch], dict[int, Patch]]:
    """Return all pieces of the repeat, and the patch of each block of the horizon map."""
    picks, ends = field.top.shape
    size = table.azimuths * table.grid**2
    blocks = table.blocks.reshape(picks, ends, -1) // size
    found, patches = [], {}
    for pick, end in np.ndindex(picks, ends):
        for piece in cell_pieces(field, pick, end):
            block = int(blocks[pick, end, slot_of(piece)])
            # All gaps of a cell have one block, but each has its own place.
            key = block if piece.family != GAP else -1 - 4 * block - 2 * (piece.across[0] > 0) - (piece.along[0] > 0)
            if key not in patches:
                patches[key] = _patch(field, table, piece, block)
            found.append(PlacedPatch(pick, end, key))
    return found, patches


def _patch(field: HeightField, table: HorizonMap, piece: CellPiece, block: int) -> Patch:
    """Return the surface at the nodes of a block."""
    grid, azimuths = table.grid, table.azimuths
    size = azimuths * grid * grid
    evenly = table.horizon[block * size : (block + 1) * size].reshape(azimuths, -1).astype(np.float64)
    horizon = soft_horizons.from_even(evenly)[::2].reshape(-1, grid, grid)
    if piece.family == GAP:
        none = np.zeros((grid, grid))
        return Patch(piece, none + 1.0, none, none, np.broadcast_to(horizon[:, :1, :1], horizon.shape), none)
    yarn = field.yarn[piece.family]
    edges = math.pi * (np.linspace(0.0, 1.0, grid + 1) - 0.5)
    v = 0.5 * (edges[1:] + edges[:-1])[None, :]
    # A weft is measured along -x.
    along = (grid_middles(*piece.along, grid, 0.0) - 0.5 + piece.offset) * (1.0 if piece.family == WARP else -1.0)
    bend = piece.sign * piece.curve
    limit = min(piece.steepest, _STEEPEST)
    sine = along[:, None] * bend / (1.0 + yarn[RADIUS] * bend * np.cos(v))
    sine = np.clip(sine, -limit, limit)
    cosine, beta = np.sqrt(1.0 - sine**2), yarn[BETA]
    length = np.sqrt((beta * np.sin(v)) ** 2 + (beta * sine * np.cos(v)) ** 2 + (cosine * np.cos(v)) ** 2)
    # 1 / n_z = length / (cosine cos v), whose cos v is that of dx = r cos v dv.
    surface = length / cosine * np.diff(edges) / np.diff(np.sin(edges))
    height = beta * _height(piece, along[:, None], yarn[RADIUS] * np.cos(v), sine, cosine)
    return Patch(piece, surface, np.broadcast_to(v, sine.shape), np.arcsin(sine), horizon, height)


def _height(piece: CellPiece, along: Float64, rise: Float64, sine: Float64, cosine: Float64) -> Float64:
    """Return the height over the fabric plane before relief, by the inclination; `rise` is r cos v (heightfield)."""
    if not piece.curve:
        return rise + 0.0 * along
    bend = 1.0 / piece.curve
    drop = math.sqrt(bend**2 - piece.half**2)
    if piece.sign > 0.0:
        return (bend + rise) * cosine - drop
    inner = bend - rise
    return drop - inner * cosine + (np.abs(along) - inner * np.abs(sine)) * piece.half / drop


def blocks_of(
    found: list[PlacedPatch], patches: dict[int, Patch], count: int
) -> tuple[dict[int, Index], tuple[int, int, int]]:
    """Return the block of each slice of each patch, (G,), and where warps and wefts begin and end among the blocks.

    `found` and `patches` are those of `sources`; `count` is the number of blocks of both families, at least 2.
    """
    times = Counter(source.block for source in found)
    yarns = {block: patch for block, patch in patches.items() if patch.piece.family != GAP}
    features, weights, families = [], [], []
    for block, patch in yarns.items():
        piece, grid = patch.piece, len(patch.u)
        width = np.diff(grid_edges(*piece.across, grid, piece.radius)) * (piece.along[1] - piece.along[0]) / grid
        horizons = patch.horizon.reshape(-1, grid, _QUARTERS, grid // _QUARTERS).mean(axis=3).transpose(1, 0, 2)
        horizons = horizons.reshape(grid, -1)
        inclination = _INCLINATION * np.sin(patch.u.mean(axis=1))[:, None]
        features.append(np.concatenate([inclination, horizons / math.sqrt(horizons.shape[1])], axis=1))
        weights.append((patch.surface * width).sum(axis=1) * times[block])
        families.append(np.full(grid, piece.family))
    labels, of_family = _split(np.concatenate(features), np.concatenate(weights), np.concatenate(families), count)
    stops = np.cumsum([len(patch.u) for patch in yarns.values()])
    return dict(zip(yarns, np.split(labels, stops[:-1]), strict=True)), (
        0,
        int((of_family == WARP).sum()),
        len(of_family),
    )


def _split(features: Float64, weights: Float64, families: Index, count: int) -> tuple[Index, Index]:
    """Return the cluster of each row and the family of each cluster, warps first: bisecting k-means, then k-means."""
    present = np.unique(families)
    labels, of_family = np.searchsorted(present, families), list(present)
    while len(of_family) < count:
        variances = [_variance(features[labels == one], weights[labels == one]) for one in range(len(of_family))]
        widest = int(np.argmax(variances))
        if variances[widest] <= 0.0:
            break
        rows = np.flatnonzero(labels == widest)
        labels[rows[_halves(features[rows], weights[rows])]] = len(of_family)
        of_family.append(of_family[widest])
    kinds = np.array(of_family)
    for _ in range(_ROUNDS):
        middles = np.stack([_middle(features[labels == one], weights[labels == one]) for one in range(len(kinds))])
        distance = ((features[:, None] - middles) ** 2).sum(axis=2)
        distance[families[:, None] != kinds] = np.inf
        new = distance.argmin(axis=1)
        if len(np.unique(new)) < len(kinds) or np.array_equal(new, labels):
            break
        labels = new
    order = np.argsort(kinds, kind="stable")
    return np.argsort(order)[labels], kinds[order]


def _middle(features: Float64, weights: Float64) -> Float64:
    return np.asarray(np.average(features, axis=0, weights=weights))


def _variance(features: Float64, weights: Float64) -> float:
    return float((weights[:, None] * (features - _middle(features, weights)) ** 2).sum()) if len(features) > 1 else 0.0


def _halves(features: Float64, weights: Float64) -> Index:
    """Return the rows of one half: 2-means, begun at the sides of the longest axis."""
    spread = features - _middle(features, weights)
    _, _, axes = np.linalg.svd(spread * np.sqrt(weights)[:, None], full_matrices=False)
    side = spread @ axes[0] > 0.0
    for _ in range(_ROUNDS):
        one, other = _middle(features[side], weights[side]), _middle(features[~side], weights[~side])
        new = ((features - one) ** 2).sum(axis=1) < ((features - other) ** 2).sum(axis=1)
        if not new.any() or new.all() or np.array_equal(new, side):
            break
        side = new
    return np.flatnonzero(side)
