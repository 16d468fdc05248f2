"""Maps of a repeat at mip levels, and their mean over a round Gaussian.

Maps are read bilinearly within a level and linearly between levels: texels of width h, read so, average as a Gaussian
of standard deviation h / 2 does, so the level is log2(2 sigma / h_0).
"""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple, TypeVar

import numpy as np
import numpy.typing as npt

from pipeline.compiled.arrays import Float32, Float64, Index
from pipeline.compiled.decorators import kernel

_Plane = TypeVar("_Plane", bound=npt.NDArray[Any])
_1 = np.float32(1.0)


class MipLevels(NamedTuple):
    """Maps at all levels, down to one texel."""

    texels: Float32  # all levels, finest first, row by row, (T, channels)
    levels: Index  # first texel, columns and rows of each level, (L, 3)
    extent: Float64  # ends and picks that the maps show, (2,)
    finest: float  # width of the finest texels, in yarn spacings (the root of width times height)


def mip_levels(maps: Sequence[npt.NDArray[Any]], extent: tuple[int, int]) -> MipLevels:
    """Return levels (rows, columns, channels), finest first, that show so many ends and picks, as one."""
    shapes = [level.shape[:2] for level in maps]
    firsts = np.cumsum([0, *(rows * columns for rows, columns in shapes)])
    (rows, columns), (ends, picks) = shapes[0], extent
    return MipLevels(
        texels=np.concatenate([level.reshape(-1, level.shape[2]) for level in maps]).astype(np.float32),
        levels=np.array([(first, *shape[::-1]) for first, shape in zip(firsts, shapes, strict=False)], np.int64),
        extent=np.array([ends, picks], np.float64),
        finest=math.sqrt(ends / columns * picks / rows),
    )


def pyramid(finest: npt.NDArray[Any], extent: tuple[int, int]) -> MipLevels:
    """Return maps (rows, columns, channels), whose sides are powers of two, with their means down to one texel."""
    levels = [finest]
    while levels[-1].shape[:2] != (1, 1):
        levels.append(halved(levels[-1]))
    return mip_levels(levels, extent)


def halved(plane: _Plane) -> _Plane:
    """Return the means of two by two texels, along each side that is longer than one."""
    if plane.shape[0] > 1:
        plane = 0.5 * (plane[0::2] + plane[1::2])
    if plane.shape[1] > 1:
        plane = 0.5 * (plane[:, 0::2] + plane[:, 1::2])
    return plane


@kernel
def add_mean(maps: MipLevels, u: float, v: float, sigma: float, weight: float, read: Float32) -> None:
    """Add the mean of the maps over a round Gaussian, times a weight, to `read` (channels,)."""
    last = len(maps.levels) - 1
    level = min(max(math.log2(2.0 * sigma / maps.finest), 0.0), float(last))
    below = min(int(level), max(last - 1, 0))
    share = level - below
    x, y = u / maps.extent[0], v / maps.extent[1]
    x, y = x - math.floor(x), y - math.floor(y)
    _add_level(maps.texels, maps.levels[below], x, y, np.float32(weight * (1.0 - share)), read)
    if share > 0.0:
        _add_level(maps.texels, maps.levels[below + 1], x, y, np.float32(weight * share), read)


@kernel
def _add_level(texels: Float32, level: Index, x: float, y: float, share: np.float32, read: Float32) -> None:
    """Add one level, read bilinearly around shares x and y of the maps' extent."""
    first, width, height = level[0], level[1], level[2]
    x, y = x * width - 0.5, y * height - 0.5
    column, line = math.floor(x), math.floor(y)
    right, up = np.float32(x - column), np.float32(y - line)
    for dy in range(2):
        weight_y = up if dy == 1 else _1 - up
        for dx in range(2):
            weight = share * weight_y * (right if dx == 1 else _1 - right)
            texel = first + ((line + dy + height) % height) * width + (column + dx + width) % width
            for c in range(len(read)):
                read[c] += weight * texels[texel, c]
