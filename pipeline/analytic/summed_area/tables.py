"""Tables of a cloth: area, normal and horizons of each cluster within Gaussians around evenly spaced centres.

In place of a summed-area table, whose windows are boxes, there is a pyramid of Gaussian windows (levels): a footprint
is four reads of a texel. A texel keeps its clusters in blocks of LANES and leaves out blocks that it hardly sees. Of a
cluster it has the area of its surface, mean and spread of the angles v and u, and, for each azimuth, mean and spread
of the horizon: the visible area from any elevation is then a ramp (soft_horizons).
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from pipeline.analytic.horizon_points.horizon_map import horizon_map
from pipeline.analytic.soft_nodes import diamond
from pipeline.analytic.summed_area.clusters import LANES, blocks_of, sources
from pipeline.analytic.summed_area.levels import Level, Sums, plan
from pipeline.compiled.arrays import Float32, Float64, Index
from pipeline.truth.cloth import cloth_side
from pipeline.truth.geometry.symmetry import longest_period, orbits
from pipeline.truth.options import TruthOptions
from weaves.fabric import Fabric

AZIMUTHS: Final = diamond.AZIMUTHS // 2
"""Azimuths of horizons, even in the diamond angle: every other one of soft nodes."""

GRID: Final = 16
"""Nodes of the horizon map along each side of a piece; a multiple of LANES."""

LEVELS: Final = np.float32(255.0)
"""Value of a mean for a horizon straight above."""

SPREADS: Final = np.float32(512.0)
"""The same of a standard deviation, which is at most 0.5."""

# Rows of `Tables.surface`.
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


class Tables(NamedTuple):
    """Clusters of one side of a cloth.

    Attributes
    ----------
    repeat : int64 (2,)
        Ends and picks.
    cells : int64 (picks * ends,)
        Number of the texels of each cell; cells that a translation of the cloth carries into one another share theirs.
    levels : int64 (L, 3)
        First texel, texels a yarn spacing and their logarithm, of each level; the last is the cloth's mean, one texel.
    finest : float
        Deviation of the first level, in yarn spacings.
    starts : int64 (3,)
        First block of warps and of wefts, and their end; gaps have the block after it.
    slots : uint32 (T, blocks + 1)
        Where a texel's blocks are stored; 0, which has no area, if it leaves the block out.
    surface : float32 (S, 5, LANES)
        Area of the surface of each cluster over the area of the cloth; mean and standard deviation of v and u.
    horizon : uint8 (S, AZIMUTHS, 2, LANES)
        Mean and standard deviation of the sine of the horizon's elevation, times LEVELS and SPREADS.
    yarn : float32 (2, 8)
        `HeightField.yarn`.
    thickness : float32
        Optical thickness.
    """

    repeat: Index
    cells: Index
    levels: Index
    finest: float
    starts: Index
    slots: npt.NDArray[np.uint32]
    surface: Float32
    horizon: npt.NDArray[np.uint8]
    yarn: Float32
    thickness: np.float32

    @property
    def nbytes(self) -> int:
        """Bytes of all arrays."""
        return sum(array.nbytes for array in self if isinstance(array, np.ndarray))


def tabulate(fabric: Fabric, clusters: int) -> Tables:
    """Build the tables of a fabric's front, of `clusters` clusters in all."""
    model = cloth_side(fabric, TruthOptions())
    field = model.front
    picks, ends = field.top.shape
    table = horizon_map(field, model.back, GRID, 2 * diamond.AZIMUTHS)
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
    horizon = np.zeros((1 + len(own), AZIMUTHS, 2, LANES), np.uint8)
    surface[1:, AREA] = own

    def moments(of: dict[int, Float64]) -> tuple[Float32, Float32]:
        mean = read({key: area[key] * of[key] for key in area})[kept] * inverse
        square = read({key: area[key] * of[key] ** 2 for key in area})[kept] * inverse
        return mean, np.sqrt(np.maximum(square - mean**2, 0.0))

    surface[1:, V], surface[1:, SPREAD_V] = moments({key: patch.v for key, patch in patches.items()})
    surface[1:, U], surface[1:, SPREAD_U] = moments({key: patch.u for key, patch in patches.items()})
    for azimuth in range(AZIMUTHS):
        mean, spread = moments({key: patch.horizon[azimuth] for key, patch in patches.items()})
        horizon[1:, azimuth, MEAN] = np.rint(np.clip(LEVELS * mean, 0.0, 255.0))
        horizon[1:, azimuth, SPREAD] = np.rint(np.clip(SPREADS * spread, 0.0, 255.0))
    number = np.zeros(picks * ends, np.int64)
    for index, orbit in enumerate(cells):
        number[[pick * ends + end for pick, end in orbit]] = index
    return Tables(
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
    )


def _finest(cells: int) -> int:
    """Return the texels a yarn spacing of the finest level: as many as some bytes hold of so many different cells."""
    slot = LANES * (5 * 4 + 2 * AZIMUTHS) * _BLOCKS_A_TEXEL * _LEVELS_OF_FINEST
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
