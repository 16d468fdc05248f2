"""Levels: sums of a cloth's surface under Gaussians of growing deviation, at evenly spaced centres.

A Gaussian along the axes is a product, so that its shares of a piece's nodes are a product of two matrices; every
further level is the Gaussian blur of one before. A texel of width h, read bilinearly, widens the Gaussian by h^2 / 6 in
the mean, which the stored one lacks. Levels lie a quarter of an octave apart, so that a footprint takes the nearest.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np
from scipy.special import ndtr

from pipeline.analytic.gauss_rules import grid_edges
from pipeline.analytic.summed_area.clusters import LANES, Patch, Source
from pipeline.compiled.arrays import Float32, Float64, Index
from pipeline.truth.geometry.heightfield import GAP, WEFT

STEPS: Final = 4
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
        sigma *= 2.0 ** (1.0 / STEPS)


class Sums:
    """Sums of a quantity over clusters, at all levels.

    Parameters
    ----------
    repeat : (picks, ends)
        The repeat.
    found, patches, blocks
        See `clusters`.
    count : int
        Blocks of yarn; one more is for gaps.
    levels : list of Level
        See `plan`.
    """

    def __init__(
        self,
        repeat: tuple[int, int],
        found: list[Source],
        patches: dict[int, Patch],
        blocks: dict[int, Index],
        count: int,
        levels: list[Level],
    ) -> None:
        self.repeat, self.patches, self.blocks, self.count, self.levels = repeat, patches, blocks, count, levels
        memory: dict[tuple[int, int, tuple[float, ...]], tuple[Index, Float64]] = {}
        self._places = [(source.block, *self._shares(source, memory)) for source in found]
        self._blurs = [self._blur(number) for number in range(1, len(levels) - 1)]

    def of(self, values: dict[int, Float64]) -> list[Float32]:
        """Return the sums of the quantity `values`, (G, G) for each patch.

        The result has for each level an array (blocks, LANES, rows, columns) of texels, the last level (blocks, LANES).
        """
        images = [self._finest(values)]
        for before, (of_y, of_x) in self._blurs:
            images.append(np.matmul(of_y, np.matmul(images[before], of_x.T)))
        return [*images, images[-1].mean(axis=(2, 3))]

    def _shares(
        self, source: Source, memory: dict[tuple[int, int, tuple[float, ...]], tuple[Index, Float64]]
    ) -> tuple[Index, Float64, Index, Float64]:
        """Return columns and rows of texels near a piece, and the share of its nodes under their Gaussians."""
        piece = self.patches[source.block].piece
        grid = self.patches[source.block].u.shape[0]
        result: list[Index | Float64] = []
        for axis, cell in ((0, source.end), (1, source.pick)):
            edges = grid_edges(*piece.box[axis], grid, piece.radii[axis])
            key = (axis, cell, (edges[0], edges[1], edges[-1]))
            if key not in memory:
                memory[key] = self._gaussians(edges + cell, self.repeat[1 - axis])
            result += memory[key]
        return tuple(result)  # type: ignore[return-value]

    def _gaussians(self, edges: Float64, size: int) -> tuple[Index, Float64]:
        level = self.levels[0]
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
