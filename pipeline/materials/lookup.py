"""A material of texture maps, read over a footprint and evaluated: what a renderer without yarns does.

Maps are read at mip levels (pipeline.analytic.mip_levels); a long footprint is the mean of up to `TAPS` readings along
its longer axis, as anisotropic filters of hardware take it. What is read goes into one evaluation (the lobes and their
sources are in pipeline.materials.lobes):

    opacity [ (1 - E s) (GGX + (1 - F) base / pi) + s charlie ] cos_i      light and viewer on one side
    opacity (1 - E s) through / pi |cos_i|                                  light from behind

F is Schlick's term, s the sheen, E the reflectance of a white sheen. The normal and the cosine are those of the map.
Where the map's normal turns away from light or viewer the material is black. Maps are in unit colours, red for the
warp and green for the weft; each component has its share of F. With parallax, each reading is moved to the place of the
height map that its viewer sees (pipeline.analytic.parallax_mapping).
"""

import math
from typing import Final, NamedTuple

import numpy as np

from pipeline.analytic.gauss_rules import taps
from pipeline.analytic.mip_levels import MipLevels, add_mean, mip_levels
from pipeline.analytic.parallax_mapping import HeightMaps, displaced
from pipeline.compiled.arrays import Float32, Float64
from pipeline.compiled.decorators import allocating_kernel, kernel
from pipeline.materials.lobes import SHEEN_ROUGHNESS, sheen_reflectance
from pipeline.materials.planes import Layout, Planes
from pipeline.materials.textures import Constants, textures
from pipeline.truth.query import Queries

TAPS: Final = 16  # most readings along a footprint's longer axis

TEXEL_CHANNELS: Final = 15
"""Numbers of a texel: opacity, base (2), F0 (2), through (2), normal (3), tangent (3), alpha along and across."""

_0, _1, _HALF, _4 = np.float32(0.0), np.float32(1.0), np.float32(0.5), np.float32(4.0)
_TINY = np.float32(1e-12)
_INVERSE_PI = np.float32(1.0 / math.pi)
_LOBE = np.float32(1.0 / SHEEN_ROUGHNESS**2)
_VIEWS: Final = 64


class MaterialMaps(NamedTuple):
    """Maps of one cloth in unit colours, and the sheen."""

    maps: MipLevels  # of TEXEL_CHANNELS
    sheen: Float32  # share of the sheen of each component, in unit colours, (4,)
    specular: np.float32  # specular colour of the yarns; the F0 of the maps has it as a factor
    white: Float32  # reflectance of a white sheen, by the viewer's cosine from 0 to 1, (n,)
    taps: Float64  # in row n the places of n readings along an axis: of mean 0 and variance 1, (TAPS + 1, TAPS)
    heights: HeightMaps  # heights of the same texels


def tabulate(
    level: Planes, material: Constants, shown: Layout, sheen: Float64, specular: float, heights: HeightMaps
) -> MaterialMaps:
    """Return the maps of a cloth at all levels, down to one texel.

    The sums of the finest `level` have red for the warp and green for the weft; `sheen`, (4,), is the share of the
    sheen of each component, `specular` the specular colour of the yarns in the maps, `heights` those of `level`.
    """
    levels = []
    while True:
        maps = textures(level, material)
        colours = (maps.base_color, maps.specular_color * material.largest_f0, maps.transmission_color)
        of_families = (colour[..., :2] for colour in colours)
        planes = (maps.opacity, *of_families, maps.normal, maps.tangent, maps.alpha_along, maps.alpha_across)
        levels.append(np.dstack(planes))
        if maps.opacity.size == 1:
            break
        level = level.halved()
    cosines = (np.arange(_VIEWS) + 0.5) / _VIEWS
    views = np.stack([np.sqrt(1.0 - cosines**2), np.zeros(_VIEWS), cosines], axis=1)
    return MaterialMaps(
        maps=mip_levels(levels, (shown.ends, shown.picks)),
        sheen=sheen.astype(np.float32),
        specular=np.float32(specular),
        white=np.array([sheen_reflectance(view) for view in views], np.float32),
        taps=taps(TAPS),
        heights=heights,
    )


def answer(tables: MaterialMaps, queries: Queries) -> Float32:
    """Return the components of N queries about flat cloth seen from the front, (N, 4)."""
    return _answer(tables, Queries(*(np.ascontiguousarray(column, np.float32) for column in queries)))


@allocating_kernel
def _answer(tables: MaterialMaps, queries: Queries) -> Float32:
    result = np.zeros((len(queries.u), 4), np.float32)
    read = np.zeros(TEXEL_CHANNELS, np.float32)
    for row in range(len(result)):
        read[:] = _0
        _read(tables, queries, row, read)
        if read[0] > _0:
            _evaluate(tables, read, queries.wi[row], queries.wo[row], result[row])
    return result


@kernel
def _read(tables: MaterialMaps, queries: Queries, row: int, read: Float32) -> None:
    """Add the mean of the maps over a footprint to `read`."""
    major, minor, angle = queries.sigma[row], queries.sigma_minor[row], queries.angle[row]
    narrow = max(minor, major / TAPS)
    count = min(max(math.ceil(major / narrow - 0.01), 1), TAPS)
    spread = math.sqrt(max(major * major - narrow * narrow, 0.0)) if count > 1 else 0.0
    for tap in range(count):
        along = spread * tables.taps[count, tap]
        x = np.float64(queries.u[row]) + along * math.cos(angle)
        y = np.float64(queries.v[row]) + along * math.sin(angle)
        x, y = displaced(tables.heights, x, y, np.float64(narrow), queries.wo[row])
        add_mean(tables.maps, x, y, narrow, 1.0 / count, read)


@kernel
def _evaluate(tables: MaterialMaps, read: Float32, wi: Float32, wo: Float32, result: Float32) -> None:
    """Write the four components of a material, with the incident cosine."""
    size = _1 / np.sqrt(max(read[7] * read[7] + read[8] * read[8] + read[9] * read[9], _TINY))
    nx, ny, nz = read[7] * size, read[8] * size, read[9] * size
    cos_i, cos_o = wi[0] * nx + wi[1] * ny + wi[2] * nz, wo[0] * nx + wo[1] * ny + wo[2] * nz
    if cos_o <= _0:
        return
    specular, lost = _1 / tables.specular, tables.sheen[0] + tables.sheen[1] + tables.sheen[2] + tables.sheen[3]
    under = _1 - lost * tables.white[min(int(cos_o * np.float32(_VIEWS)), _VIEWS - 1)]
    if wi[2] < _0:
        for family in range(2):
            result[2 + family] = read[0] * under * read[5 + family] * _INVERSE_PI * max(-cos_i, _0)
        return
    if cos_i <= _0:
        return
    # The fibres' frame: the tangent, laid across the normal.
    along = read[10] * nx + read[11] * ny + read[12] * nz
    tx, ty, tz = read[10] - along * nx, read[11] - along * ny, read[12] - along * nz
    size = _1 / np.sqrt(max(tx * tx + ty * ty + tz * tz, _TINY))
    tx, ty, tz = tx * size, ty * size, tz * size
    bx, by, bz = ny * tz - nz * ty, nz * tx - nx * tz, nx * ty - ny * tx
    hx, hy, hz = wi[0] + wo[0], wi[1] + wo[1], wi[2] + wo[2]
    size = _1 / np.sqrt(max(hx * hx + hy * hy + hz * hz, _TINY))
    hx, hy, hz = hx * size, hy * size, hz * size
    h_n, edge = hx * nx + hy * ny + hz * nz, _1 - min(hx * wo[0] + hy * wo[1] + hz * wo[2], _1)
    a, b = read[13], read[14]
    slopes = ((hx * tx + hy * ty + hz * tz) / a) ** 2 + ((hx * bx + hy * by + hz * bz) / b) ** 2 + h_n * h_n
    masking_i = _masking(wi[0] * tx + wi[1] * ty + wi[2] * tz, wi[0] * bx + wi[1] * by + wi[2] * bz, cos_i, a, b)
    masking_o = _masking(wo[0] * tx + wo[1] * ty + wo[2] * tz, wo[0] * bx + wo[1] * by + wo[2] * bz, cos_o, a, b)
    ggx = _INVERSE_PI / (a * b * slopes * slopes * (_1 + masking_i + masking_o) * _4 * cos_o)
    sine = np.sqrt(max(_1 - h_n * h_n, _TINY))
    charlie = (np.float32(2.0) + _LOBE) * sine**_LOBE * _HALF * _INVERSE_PI
    charlie *= cos_i / (_4 * (cos_i + cos_o - cos_i * cos_o))
    f0 = read[3] + read[4]
    edge = edge * edge * edge * edge * edge
    fresnel = f0 + (_1 - f0) * edge
    for family in range(2):
        own = read[3 + family] / max(f0, _TINY) * fresnel
        base = (_1 - fresnel) * read[1 + family] * _INVERSE_PI * cos_i
        result[family] = read[0] * specular * (under * own * ggx + tables.sheen[family] * charlie)
        result[2 + family] = read[0] * (under * base + tables.sheen[2 + family] * charlie)


@kernel
def _masking(along: np.float32, across: np.float32, cosine: np.float32, a: np.float32, b: np.float32) -> np.float32:
    """Return Smith's Lambda of a direction."""
    slopes = ((a * along) ** 2 + (b * across) ** 2) / (cosine * cosine)
    return np.float32(_HALF * (np.sqrt(_1 + slopes) - _1))
