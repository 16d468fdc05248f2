"""MIP maps of normals and tangents: one evaluation of the point model for each family.

For each family a pyramid holds the share c of the cloth's area that it covers, and the means over this share of the
normal n, the tangent t and, for `lean`, the products t t^T; a texel of the next level is the mean of four. It is read
bilinearly within a level and linearly between levels: texels of width h, read so, average as a Gaussian of standard
deviation h / 2 does, so the level is log2(2 sigma / h_0). The answer is the ratio of sums over both families (and gaps)
of c <wo.n> / (n_s.n) F, n normalised, with a roughness widened by how much the tangents differ:

    toksvig   alpha'^2 = alpha^2 + (1 - |E t|^2) / 2               the mean's length tells the variance
    lean      alpha'^2 = alpha^2 + h^T (E[t t^T] - E[t] E[t]^T) h   the variance of h.t itself, h the half vector
    none      alpha'   = alpha

as Toksvig (2005) and LEAN mapping (Olano and Baker 2010) do for glossy normals. Nothing hides anything.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np

from pipeline.analytic.torus_frame import sigma, spread
from pipeline.compiled.arrays import Float32, Float64, Index
from pipeline.compiled.decorators import allocating_kernel, kernel
from pipeline.truth.query import Queries
from pipeline.truth.scattering.slab_float32 import reflection
from weaves.fabric import Fabric
from weaves.surface import surface_at

NONE, TOKSVIG, LEAN = range(3)
WIDENINGS: Final = {"none": NONE, "toksvig": TOKSVIG, "lean": LEAN}

CHANNELS: Final = 13
"""Numbers a family and texel: coverage; times it normal, tangent, and tangent's products xx, yy, zz, xy, xz, yz."""

_0, _1, _HALF = np.float32(0.0), np.float32(1.0), np.float32(0.5)
_TINY = np.float32(1e-12)
_FAINT = np.float32(1e-6)  # coverage below which a family is not there
_INVERSE_PI, _FOURTH_PI = np.float32(1.0 / math.pi), np.float32(0.25 / math.pi)


class Pyramid(NamedTuple):
    """Averaged maps of one repeat.

    Attributes
    ----------
    texels : float32 (T, 2 * CHANNELS)
        All levels, finest first, row by row; warp, then weft.
    levels : int64 (L, 3)
        First texel, columns and rows of each level.
    repeat : float64 (2,)
        Ends and picks.
    finest : float
        Width of the finest texels, in yarn spacings (the root of width times height).
    yarn : float32 (2, 2)
        Alpha and blend of both families.
    thickness : float32
        Optical thickness.
    """

    texels: Float32
    levels: Index
    repeat: Float64
    finest: float
    yarn: Float32
    thickness: np.float32


class PrefilteredMaps:
    """A fabric's pyramid, made once.

    Parameters
    ----------
    fabric : Fabric
        The cloth.
    texels_per_yarn : int
        Texels of the finest level along a yarn spacing, at least.
    """

    def __init__(self, fabric: Fabric, texels_per_yarn: int) -> None:
        self.pyramid = pyramid(fabric, texels_per_yarn)

    def answer(self, queries: Queries, widening: int) -> Float32:
        """Return the components (N, 4); queries are round, flat and lit from the front."""
        u, v, sigma, wi, wo = (np.ascontiguousarray(column, np.float32) for column in queries[:5])
        return _answer(self.pyramid, u, v, sigma, wi, wo, widening)

    @property
    def nbytes(self) -> int:
        """Bytes of all levels."""
        return self.pyramid.texels.nbytes


def pyramid(fabric: Fabric, texels_per_yarn: int) -> Pyramid:
    """Average the maps of a fabric's surface, down to one texel; sides are powers of two."""
    ends, picks = fabric.weave.repeat
    columns, rows = (1 << math.ceil(math.log2(extent * texels_per_yarn)) for extent in (ends, picks))
    x, y = (np.arange(columns) + 0.5) * (ends / columns), (np.arange(rows) + 0.5) * (picks / rows)
    surface = surface_at(fabric, x[None, :], y[:, None])
    parts = []
    for family in range(2):
        here = (surface.yarn == family)[..., None]
        t = surface.tangent
        products = np.stack([t[..., a] * t[..., b] for a, b in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))], -1)
        parts.append(np.concatenate([np.ones_like(t[..., :1]), surface.normal, t, products], axis=-1) * here)
    level = np.concatenate(parts, axis=-1)
    found, levels, first = [], [], 0
    while True:
        height, width = level.shape[:2]
        found.append(level.reshape(-1, 2 * CHANNELS))
        levels.append((first, width, height))
        first += width * height
        if height == width == 1:
            break
        if height > 1:
            level = 0.5 * (level[0::2] + level[1::2])
        if width > 1:
            level = 0.5 * (level[:, 0::2] + level[:, 1::2])
    yarns = (fabric.warp, fabric.weft)
    return Pyramid(
        texels=np.concatenate(found).astype(np.float32),
        levels=np.array(levels, np.int64),
        repeat=np.array([ends, picks], np.float64),
        finest=math.sqrt(ends / columns * picks / rows),
        yarn=np.array([(yarn.roughness, yarn.blend) for yarn in yarns], np.float32),
        thickness=np.float32(fabric.optical_thickness),
    )


@allocating_kernel
def _answer(
    maps: Pyramid, u: Float32, v: Float32, deviation: Float32, wi: Float32, wo: Float32, widening: int
) -> Float32:
    result = np.zeros((len(u), 4), np.float32)
    read = np.zeros(2 * CHANNELS, np.float32)
    texels, levels, repeat, yarn, thickness = maps.texels, maps.levels, maps.repeat, maps.yarn, maps.thickness
    last = len(levels) - 1
    for row in range(len(u)):
        x, y = np.float64(u[row]) / repeat[0], np.float64(v[row]) / repeat[1]
        x, y = x - math.floor(x), y - math.floor(y)
        level = min(max(math.log2(2.0 * deviation[row] / maps.finest), 0.0), float(last))
        below = min(int(level), max(last - 1, 0))
        share = level - below
        read[:] = _0
        _add(texels, levels, below, x, y, np.float32(1.0 - share), read)
        if share > 0.0:
            _add(texels, levels, below + 1, x, y, np.float32(share), read)
        ix, iy, iz = wi[row, 0], wi[row, 1], wi[row, 2]
        ox, oy, oz = wo[row, 0], wo[row, 1], wo[row, 2]
        hx, hy, hz = ix + ox, iy + oy, iz + oz
        size = _1 / max(hx * hx + hy * hy + hz * hz, _TINY)
        area = max(_1 - read[0] - read[CHANNELS], _0) * oz
        for family in range(2):
            k = family * CHANNELS
            covered = read[k]
            if covered <= _FAINT:
                continue
            nx, ny, nz = read[k + 1], read[k + 2], read[k + 3]
            n = _1 / np.sqrt(nx * nx + ny * ny + nz * nz)
            inverse = _1 / covered
            tx, ty, tz = read[k + 4] * inverse, read[k + 5] * inverse, read[k + 6] * inverse
            square = yarn[family, 0] * yarn[family, 0]
            along = hx * tx + hy * ty + hz * tz
            length = tx * tx + ty * ty + tz * tz
            if widening == TOKSVIG:
                square = min(square + _HALF * max(_1 - length, _0), _1)
            elif widening == LEAN:
                variance = (
                    hx * hx * read[k + 7]
                    + hy * hy * read[k + 8]
                    + hz * hz * read[k + 9]
                    + np.float32(2.0) * (hx * hy * read[k + 10] + hx * hz * read[k + 11] + hy * hz * read[k + 12])
                )
                square = min(square + size * max(variance * inverse - along * along, _0), _1)
            t = _1 / np.sqrt(max(length, _TINY))
            cos_o, cos_i = (ox * nx + oy * ny + oz * nz) * n, (ix * nx + iy * ny + iz * nz) * n
            if cos_o <= _0:
                continue
            projected = covered * cos_o / (nz * n)
            area += projected
            if cos_i <= _0:
                continue
            along_i, along_o = (ix * tx + iy * ty + iz * tz) * t, (ox * tx + oy * ty + oz * tz) * t
            scattered = reflection(
                square * np.sqrt(square) * _FOURTH_PI, spread(along_i + along_o, size, square),
                sigma(along_i, square), sigma(along_o, square), cos_i, cos_o, thickness,
            )  # fmt: skip
            blend = yarn[family, 1]
            result[row, family] = covered * scattered / (nz * n)
            result[row, 2 + family] = projected * _INVERSE_PI * (blend * cos_i + (_1 - blend) * iz)
        inverse = _1 / max(area, _TINY)
        for c in range(4):
            result[row, c] *= inverse
    return result


@kernel
def _add(texels: Float32, levels: Index, level: int, x: float, y: float, share: np.float32, read: Float32) -> None:
    """Add one level, read bilinearly around shares x and y of the repeat."""
    first, width, height = levels[level, 0], levels[level, 1], levels[level, 2]
    x, y = x * width - 0.5, y * height - 0.5
    column, line = math.floor(x), math.floor(y)
    right, up = np.float32(x - column), np.float32(y - line)
    for dy in range(2):
        weight_y = up if dy == 1 else _1 - up
        for dx in range(2):
            weight = share * weight_y * (right if dx == 1 else _1 - right)
            texel = first + ((line + dy + height) % height) * width + (column + dx + width) % width
            for c in range(2 * CHANNELS):
                read[c] += weight * texels[texel, c]
