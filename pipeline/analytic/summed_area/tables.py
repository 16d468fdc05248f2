"""ClusterTables of a cloth: area, normal and horizons of each cluster within Gaussians around evenly spaced centres.

In place of a summed-area table, whose windows are boxes, there is a pyramid of Gaussian windows (levels): a footprint
is four reads of a texel. A texel keeps its clusters in blocks of LANES and leaves out blocks that it hardly sees. Of a
cluster it has the area of its surface, mean and spread of the angles v and u, and, for each azimuth, mean and spread
of the horizon: the visible area from any elevation is then a ramp (soft_horizons).

Levels are sums of the surface under Gaussians of growing deviation, at evenly spaced centres. A Gaussian along the axes
is a product, so that its shares of a piece's nodes are a product of two matrices; every further level is the Gaussian
blur of one before. A texel of width h, read bilinearly, widens the Gaussian by h^2 / 6 in the mean, which the stored
one lacks. Levels lie a quarter of an octave apart, so that a footprint takes the nearest.
"""

from __future__ import annotations

import math
from functools import cache
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.special import ndtr

from pipeline.analytic import soft_horizons
from pipeline.analytic.gauss_rules import grid_edges
from pipeline.analytic.summed_area.clusters import LANES, Patch, PlacedPatch, blocks_of, sources
from pipeline.analytic.summed_area.horizon_map import horizon_map
from pipeline.compiled.arrays import Float32, Float64, Index
from pipeline.truth.cloth import cloth_side
from pipeline.truth.geometry.heightfield import GAP, WEFT
from pipeline.truth.geometry.pieces import longest_period, orbits
from pipeline.truth.options import TruthOptions
from weaves.fabric import Fabric

OCTAVE_STEPS: Final = 4
"""Levels an octave."""

_REACH = 3.6  # deviations beyond which a piece is left out of the finest level
_BLUR = 5.0  # the same of the blur of a level
_LEAST = 1e-7
_SIXTH = 1.0 / 6.0


class Level(NamedTuple):
    """Texels a yarn spacing, deviation of the footprint, and that of the sums; 0 texels: the mean of the cloth."""

    texels: int
    sigma: float
    stored: float


def plan(finest: int, uniform: float) -> list[Level]:
    """Return the levels, from that of `finest` texels a yarn (a power of 2) to the cloth's mean beyond `uniform`."""
    found = []
    sigma = 1.0 / finest
    while True:
        texels = min(1 << max(math.ceil(-math.log2(sigma) - 1e-9), 0), finest)
        found.append(Level(texels, sigma, math.sqrt(sigma**2 - _SIXTH / texels**2)))
        if sigma >= uniform:
            return [*found, Level(0, math.inf, math.inf)]
        sigma *= 2.0 ** (1.0 / OCTAVE_STEPS)


class Sums:
    """Sums of a quantity over clusters, at all levels.

    `repeat` is (picks, ends); `found`, `patches` and `blocks` are those of `clusters`, `levels` those of `plan`; there
    are `count` blocks of yarn, and one more for gaps.
    """

    def __init__(
        self,
        repeat: tuple[int, int],
        found: list[PlacedPatch],
        patches: dict[int, Patch],
        blocks: dict[int, Index],
        count: int,
        levels: list[Level],
    ) -> None:
        self.repeat, self.patches, self.blocks, self.count, self.levels = repeat, patches, blocks, count, levels
        self._near = cache(self._gaussians)
        self._places = [(source.block, *self._shares(source)) for source in found]
        self._blurs = [self._blur(number) for number in range(1, len(levels) - 1)]

    def of(self, values: dict[int, Float64]) -> list[Float32]:
        """Return the sums of the quantity `values`, (G, G) for each patch.

        The result has for each level an array (blocks, LANES, rows, columns) of texels, the last level (blocks, LANES).
        """
        images = [self._finest(values)]
        for before, (of_y, of_x) in self._blurs:
            images.append(np.matmul(of_y, np.matmul(images[before], of_x.T)))
        return [*images, images[-1].mean(axis=(2, 3))]

    def _shares(self, source: PlacedPatch) -> tuple[Index, Float64, Index, Float64]:
        """Return columns and rows of texels near a piece, and the share of its nodes under their Gaussians."""
        patch = self.patches[source.block]
        of_x, of_y = (
            self._near(tuple(cell + grid_edges(*extent, len(patch.u), radius)), size)
            for cell, extent, radius, size in zip(
                (source.end, source.pick), patch.piece.box, patch.piece.radii, self.repeat[::-1], strict=True
            )
        )
        return *of_x, *of_y

    def _gaussians(self, borders: tuple[float, ...], size: int) -> tuple[Index, Float64]:
        level, edges = self.levels[0], np.array(borders)
        centres = (np.arange(size * level.texels) + 0.5) / level.texels
        images = math.ceil(_REACH * level.stored / size) + 1
        share = np.zeros((len(centres), len(edges) - 1))
        for image in range(-images, images + 1):
            share += np.diff(ndtr((edges + image * size - centres[:, None]) / level.stored), axis=1)
        near = np.flatnonzero(share.sum(axis=1) > _LEAST)
        return near, share[near]

    def _blur(self, number: int) -> tuple[int, tuple[Float32, Float32]]:
        """Return the level that a level is a blur of, and the matrices of the blur along y and x."""
        level = self.levels[number]
        before = max(n for n in range(number) if self.levels[n].stored < level.stored * 0.99 or n == 0)
        source = self.levels[before]
        variance = level.stored**2 - source.stored**2
        matrices = []
        for size in self.repeat:
            to, of = ((np.arange(size * n) + 0.5) / n for n in (level.texels, source.texels))
            images = math.ceil(_BLUR * math.sqrt(variance) / size) + 1
            shifts = size * np.arange(-images, images + 1)
            weight = np.exp(-0.5 * (to[:, None, None] - of[:, None] - shifts) ** 2 / variance).sum(axis=2)
            matrices.append((weight / weight.sum(axis=1, keepdims=True)).astype(np.float32))
        return before, (matrices[0], matrices[1])

    def _finest(self, values: dict[int, Float64]) -> Float32:
        picks, ends = self.repeat
        texels = self.levels[0].texels
        image = np.zeros((self.count + 1, LANES, picks * texels, ends * texels), np.float32)
        for block, columns, of_x, rows, of_y in self._places:
            piece = self.patches[block].piece
            own = values[block]
            place = rows[:, None], columns
            if piece.family == GAP:
                image[(self.count, 0, *place)] += of_y @ own @ of_x.T
                continue
            across, along = (of_x, of_y) if piece.family != WEFT else (of_y, of_x)
            by_lane = across.reshape(len(across), LANES, -1)
            for cluster in np.unique(self.blocks[block]):
                slices = self.blocks[block] == cluster
                lines = (along[:, slices] @ own[slices]).reshape(len(along), LANES, -1)
                found = np.einsum("lkp,akp->kla", lines, by_lane, optimize=True)
                target = image[cluster]
                target[(slice(None), *place)] += found if piece.family != WEFT else found.transpose(0, 2, 1)
        return image


TEXEL_AZIMUTHS: Final = soft_horizons.AZIMUTHS // 2
"""Azimuths of horizons, even in the diamond angle: every other one of soft nodes."""

GRID: Final = 16
"""Nodes of the horizon map along each side of a piece; a multiple of LANES."""

MEAN_SCALE: Final = np.float32(255.0)
"""Value of a mean for a horizon straight above."""

SPREAD_SCALE: Final = np.float32(512.0)
"""The same of a standard deviation, which is at most 0.5."""

# Rows of `ClusterTables.surface`.
AREA, V, U, SPREAD_V, SPREAD_U = range(5)
MEAN, SPREAD = range(2)

_FINEST = (16, 8, 4, 2)  # texels a yarn spacing of the finest level
_MOST_BYTES = 24 << 20
_EVEN = 0.42  # of the longest period: deviation from which on a Gaussian covers the cloth evenly, to 3 %
_LEAST_EVEN = 0.4  # yarn spacings
_FAINT = 3e-4  # share of a texel's area below which it leaves a block out
_ABSENT = 1e-7
_BLOCKS_A_TEXEL = 2.7  # on the finest levels, for the estimate of bytes
_LEVELS_OF_FINEST = 5.3  # texels of all levels, over those of the finest


class ClusterTables(NamedTuple):
    """Clusters of one side of a cloth."""

    repeat: Index
    """Ends and picks, (2,)."""
    cells: Index
    """Number of the texels of each cell; cells that a translation of the cloth carries into one another share theirs,
    (picks * ends,)."""
    levels: Index
    """First texel, texels a yarn spacing and their logarithm, of each level; the last is the cloth's mean, one texel,
    (L, 3)."""
    finest: float
    """Deviation of the first level, in yarn spacings."""
    starts: Index
    """First block of warps and of wefts, and their end; gaps have the block after it, (3,)."""
    slots: npt.NDArray[np.uint32]
    """Where a texel's blocks are stored; 0, which has no area, if it leaves the block out, uint32 (T, blocks + 1)."""
    surface: Float32
    """Area of the surface of each cluster over the area of the cloth; mean and standard deviation of v and u,
    (S, 5, LANES)."""
    horizon: npt.NDArray[np.uint8]
    """Mean and standard deviation of the sine of the horizon's elevation, times MEAN_SCALE and SPREAD_SCALE, uint8
    (S, TEXEL_AZIMUTHS, 2, LANES)."""
    yarn: Float32
    """`HeightField.yarn`, (2, 8)."""
    thickness: np.float32
    """Optical thickness."""
    plane: float
    """Height of the reference plane."""
    height: Float32
    """Mean height of each cluster over the reference plane, and half the range of an even distribution of heights with
    its standard deviation; no row without parallax, (S, 2, LANES)."""
    extent: Float32
    """Lowest and highest height of all clusters of a slot; in row 0 of the cloth; no row without parallax, (S, 2)."""


def tabulate(fabric: Fabric, clusters: int, parallax: bool = True) -> ClusterTables:
    """Build the tables of a fabric's front, of `clusters` clusters in all."""
    model = cloth_side(fabric, TruthOptions())
    field = model.front
    picks, ends = field.top.shape
    table = horizon_map(field, model.back, GRID, 2 * soft_horizons.AZIMUTHS)
    found, patches = sources(field, table)
    blocks, starts = blocks_of(found, patches, clusters // LANES)
    count = starts[2]
    cells = orbits(field)
    levels = plan(_finest(len(cells)), max(_EVEN * longest_period(field), _LEAST_EVEN))
    sums = Sums((picks, ends), found, patches, blocks, count, levels)
    firsts = [orbit[0] for orbit in cells]

    def read(values: dict[int, Float64]) -> Float32:
        return _texels(sums.of(values), levels, firsts, (picks, ends))

    area = {key: patch.surface for key, patch in patches.items()}
    whole = read(area)
    kept = whole.sum(axis=2) > _FAINT * whole.sum(axis=(1, 2))[:, None]
    slots = np.zeros(kept.shape, np.uint32)
    slots[kept] = 1 + np.arange(kept.sum())
    own = whole[kept]
    inverse = np.where(own > _ABSENT, 1.0 / np.maximum(own, _ABSENT), 0.0)
    surface = np.zeros((1 + len(own), 5, LANES), np.float32)
    horizon = np.zeros((1 + len(own), TEXEL_AZIMUTHS, 2, LANES), np.uint8)
    surface[1:, AREA] = own

    def moments(of: dict[int, Float64]) -> tuple[Float32, Float32]:
        mean = read({key: area[key] * of[key] for key in area})[kept] * inverse
        square = read({key: area[key] * of[key] ** 2 for key in area})[kept] * inverse
        return mean, np.sqrt(np.maximum(square - mean**2, 0.0))

    surface[1:, V], surface[1:, SPREAD_V] = moments({key: patch.v for key, patch in patches.items()})
    surface[1:, U], surface[1:, SPREAD_U] = moments({key: patch.u for key, patch in patches.items()})
    for azimuth in range(TEXEL_AZIMUTHS):
        mean, spread = moments({key: patch.horizon[azimuth] for key, patch in patches.items()})
        horizon[1:, azimuth, MEAN] = np.rint(np.clip(MEAN_SCALE * mean, 0.0, 255.0))
        horizon[1:, azimuth, SPREAD] = np.rint(np.clip(SPREAD_SCALE * spread, 0.0, 255.0))
    height, extent = np.zeros((0, 2, LANES), np.float32), np.zeros((0, 2), np.float32)
    if parallax:
        mean, spread = moments({key: patch.height - model.plane for key, patch in patches.items()})
        height = np.zeros((1 + len(own), 2, LANES), np.float32)
        height[1:, MEAN], height[1:, SPREAD] = mean, math.sqrt(3.0) * spread
        extent = _extents(height, own)
    number = np.zeros(picks * ends, np.int64)
    for index, orbit in enumerate(cells):
        number[[pick * ends + end for pick, end in orbit]] = index
    return ClusterTables(
        repeat=np.array([ends, picks], np.int64),
        cells=number,
        levels=_first_texels(levels, len(cells)),
        finest=levels[0].sigma,
        starts=np.array(starts, np.int64),
        slots=slots,
        surface=surface,
        horizon=horizon,
        yarn=field.yarn.astype(np.float32),
        thickness=np.float32(field.thickness),
        plane=model.plane,
        height=height,
        extent=extent,
    )


def _extents(height: Float32, area: Float32) -> Float32:
    """Return the lowest and the highest height of each slot, (S, 2), and in the first, which has no area, of all."""
    middle, half = height[1:, MEAN], height[1:, SPREAD]
    low = np.where(area > _ABSENT, middle - half, math.inf).min(axis=1)
    high = np.where(area > _ABSENT, middle + half, -math.inf).max(axis=1)
    return np.concatenate([[[low.min(), high.max()]], np.stack([low, high], axis=1)]).astype(np.float32)


def _finest(cells: int) -> int:
    """Return the texels a yarn spacing of the finest level: as many as some bytes hold of so many different cells."""
    slot = LANES * (5 * 4 + 2 * TEXEL_AZIMUTHS) * _BLOCKS_A_TEXEL * _LEVELS_OF_FINEST
    return next((n for n in _FINEST if cells * n * n * slot <= _MOST_BYTES), _FINEST[-1])


def _first_texels(levels: list[Level], cells: int) -> Index:
    counts = [max(cells * level.texels**2, 1) for level in levels]
    texels = [level.texels for level in levels]
    return np.stack([np.cumsum([0, *counts[:-1]]), texels, [max(n, 1).bit_length() - 1 for n in texels]], axis=1)


def _texels(
    images: list[Float32], levels: list[Level], firsts: list[tuple[int, int]], repeat: tuple[int, int]
) -> Float32:
    """Return the texels of all levels, (T, blocks, LANES): cell by cell, row by row."""
    parts = []
    for image, level in zip(images[:-1], levels, strict=False):
        n, blocks = level.texels, image.shape[0]
        by_cell = image.reshape(blocks, LANES, repeat[0], n, repeat[1], n)
        different = np.stack([by_cell[:, :, pick, :, end, :] for pick, end in firsts])
        parts.append(different.transpose(0, 3, 4, 1, 2).reshape(-1, blocks, LANES))
    return np.concatenate([*parts, images[-1][None]])
