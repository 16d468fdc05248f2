"""The place of a height map that a viewer sees at a place of the reference plane: parallax occlusion mapping.

A view ray that crosses the reference plane at q is above q + h wo_xy / wo_z at height h. It sinks from the highest
texel in even steps until it is below the map, and ends linearly between the last two places [Tatarchuk2006Parallax].
The map is read at the mip level whose texels are as wide as a footprint's deviation. A footprint keeps its size and
moves as a whole: what its rays see besides, and how it is stretched on a slope, is left out.
"""

import math
from typing import Final, NamedTuple

import numpy as np

from pipeline.analytic.mip_levels import MipLevels, mip_levels, pyramid
from pipeline.compiled.arrays import Float32, Float64
from pipeline.compiled.decorators import kernel
from pipeline.truth.geometry.heightfield import height_field
from pipeline.truth.geometry.pieces import reference_plane
from weaves.fabric import Fabric

MOST_STEPS: Final = 64  # most steps of a ray

_STEP = 0.1  # least yarn spacings that a ray runs in a step
_FEWEST = 2
_FINER = 0.5  # deviation of the footprint by which heights are read, over its own


class HeightMaps(NamedTuple):
    """Heights over the reference plane at all mip levels, the lowest and the highest; one texel without parallax."""

    maps: MipLevels
    lowest: float
    highest: float


def height_maps(fabric: Fabric, heights: Float64, extent: tuple[int, int], parallax: bool) -> HeightMaps:
    """Return the levels of a map (rows, columns) of heights over the fabric plane; its sides are powers of two.

    The map shows `extent` ends and picks. Without `parallax` all heights are those of the reference plane.
    """
    if not parallax:
        return HeightMaps(mip_levels([np.zeros((1, 1, 1))], extent), 0.0, 0.0)
    finest = heights[..., None] - reference_plane(height_field(fabric))
    return HeightMaps(pyramid(finest, extent), float(finest.min()), float(finest.max()))


@kernel
def displaced(heights: HeightMaps, u: float, v: float, sigma: float, wo: Float32) -> tuple[float, float]:
    """Return the place that a footprint of view rays around (u, v) of the reference plane sees, in yarn spacings."""
    maps, run_x, run_y = heights.maps, np.float64(wo[0]) / wo[2], np.float64(wo[1]) / wo[2]
    # Texels of width h average as a deviation of h / 2 does.
    level = min(max(math.log2(2.0 * _FINER * sigma / maps.finest) + 0.5, 0.0), len(maps.levels) - 1.0)
    span = heights.highest - heights.lowest
    run = math.hypot(run_x, run_y) * span
    if run == 0.0:
        return u, v
    steps = min(max(math.ceil(run / max(_STEP, sigma)), _FEWEST), MOST_STEPS)
    height, above = heights.highest, 0.0
    for step in range(steps + 1):
        height = heights.highest - step * span / steps
        below = _height(maps, int(level), u + height * run_x, v + height * run_y) - height
        if below >= 0.0:
            if below + above > 0.0:
                height += span / steps * below / (below + above)
            break
        above = -below
    return u + height * run_x, v + height * run_y


@kernel
def _height(maps: MipLevels, level: int, u: float, v: float) -> float:
    """Return the height at a place, bilinear within a level."""
    first, width, rows = maps.levels[level, 0], maps.levels[level, 1], maps.levels[level, 2]
    x, y = u / maps.extent[0], v / maps.extent[1]
    x, y = (x - math.floor(x)) * width - 0.5, (y - math.floor(y)) * rows - 0.5
    left, low = math.floor(x), math.floor(y)
    total = 0.0
    for dy in range(2):
        for dx in range(2):
            weight = (x - left if dx == 1 else 1.0 - (x - left)) * (y - low if dy == 1 else 1.0 - (y - low))
            texel = first + ((low + dy + rows) % rows) * width + (left + dx + width) % width
            total += weight * np.float64(maps.texels[texel, 0])
    return total
