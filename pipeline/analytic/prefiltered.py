"""MIP maps of normals and tangents: one evaluation of the point model for each family.

For each family a pyramid holds the share c of the cloth's area that it covers, and the means over this share of the
normal n, the tangent t and the products t t^T; a texel of the next level is the mean of four (mip_levels).
The answer is the ratio of sums over both families (and gaps) of c <wo.n> / (n_s.n) F, n normalised, with a roughness
widened by the variance of h.t, h the half vector, as LEAN mapping does for glossy normals [Olano2010LEAN]:

    alpha'^2 = alpha^2 + h^T (E[t t^T] - E[t] E[t]^T) h

Nothing hides anything; with parallax, a footprint is moved to the place that its middle ray sees (parallax_mapping).
"""

import math
from typing import Final, NamedTuple

import numpy as np

from pipeline.analytic.mip_levels import MipLevels, add_mean, pyramid
from pipeline.analytic.parallax_mapping import HeightMaps, displaced, height_maps
from pipeline.analytic.torus_frame import sigma, spread
from pipeline.compiled.arrays import Float32
from pipeline.compiled.decorators import allocating_kernel
from pipeline.truth.query import Queries
from pipeline.truth.scattering.slab_float32 import reflection
from weaves.fabric import Fabric
from weaves.surface import surface_at

TEXELS_PER_YARN: Final = 16  # at least, of the finest level
CHANNELS: Final = 13
"""Numbers a family and texel: coverage; times it normal, tangent, and tangent's products xx, yy, zz, xy, xz, yz."""

_0, _1, _2 = np.float32(0.0), np.float32(1.0), np.float32(2.0)
_TINY = np.float32(1e-12)
_FAINT = np.float32(1e-6)  # coverage below which a family is not there
_INVERSE_PI, _FOURTH_PI = np.float32(1.0 / math.pi), np.float32(0.25 / math.pi)


class PrefilteredMaps(NamedTuple):
    """Averaged maps of one repeat."""

    maps: MipLevels  # of 2 CHANNELS: warp, then weft
    yarn: Float32  # alpha and blend of both families, (2, 2)
    thickness: np.float32  # optical thickness
    heights: HeightMaps  # heights of the same texels; gaps have the lowest


def tabulate(fabric: Fabric, parallax: bool = True) -> PrefilteredMaps:
    """Average the maps of a fabric's surface, down to one texel; sides are powers of two."""
    ends, picks = fabric.weave.repeat
    columns, rows = (1 << math.ceil(math.log2(extent * TEXELS_PER_YARN)) for extent in (ends, picks))
    x, y = (np.arange(columns) + 0.5) * (ends / columns), (np.arange(rows) + 0.5) * (picks / rows)
    surface = surface_at(fabric, x[None, :], y[:, None])
    parts = []
    for family in range(2):
        here = (surface.yarn == family)[..., None]
        t = surface.tangent
        products = np.stack([t[..., a] * t[..., b] for a, b in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))], -1)
        parts.append(np.concatenate([np.ones_like(t[..., :1]), surface.normal, t, products], axis=-1) * here)
    yarns = (fabric.warp, fabric.weft)
    seen = np.isfinite(surface.height)
    heights = np.where(seen, surface.height, surface.height[seen].min())
    return PrefilteredMaps(
        maps=pyramid(np.concatenate(parts, axis=-1), (ends, picks)),
        yarn=np.array([(yarn.roughness, yarn.blend) for yarn in yarns], np.float32),
        thickness=np.float32(fabric.optical_thickness),
        heights=height_maps(fabric, heights, (ends, picks), parallax),
    )


def answer(tables: PrefilteredMaps, queries: Queries) -> Float32:
    """Return the components (N, 4); queries are round, flat and lit from the front."""
    return _answer(tables, Queries(*(np.ascontiguousarray(column, np.float32) for column in queries)))


@allocating_kernel
def _answer(tables: PrefilteredMaps, queries: Queries) -> Float32:
    u, v, wi, wo = queries.u, queries.v, queries.wi, queries.wo
    result = np.zeros((len(u), 4), np.float32)
    read = np.zeros(2 * CHANNELS, np.float32)
    yarn, thickness = tables.yarn, tables.thickness
    for row in range(len(u)):
        read[:] = _0
        wide = np.float64(queries.sigma[row])
        x, y = displaced(tables.heights, np.float64(u[row]), np.float64(v[row]), wide, wo[row])
        add_mean(tables.maps, x, y, wide, 1.0, read)
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
            crossed = hx * hy * read[k + 10] + hx * hz * read[k + 11] + hy * hz * read[k + 12]
            variance = hx * hx * read[k + 7] + hy * hy * read[k + 8] + hz * hz * read[k + 9] + _2 * crossed
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
        result[row] *= _1 / max(area, _TINY)
    return result
