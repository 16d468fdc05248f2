"""Layout of tiling maps, the sums of a fabric's surface over their texels, and mip levels of these.

A map shows whole repeats of weave and colours, so that it tiles. Its sides are powers of two, so that mip levels are
exact. Among these layouts the texels are square within 1 % where that is possible, else as square as possible; then a
yarn has as many texels as possible; then the map is as small as possible.

A texel holds sums over its points, weighted by the coverage c (1 on a yarn, 0 in a gap). They are linear, so a texel
of the next mip level is the mean of four texels, and nothing that differs below a texel is lost:

    normals    c n
    fibres     c (1 - alpha^2) t t^T,    by which the mean flake matrix is S = I - (1 - alpha^2) E[t t^T]
    colours    c k, for each of k_d, k_s and k_dt times a factor of its family (pipeline.materials.textures)

S is the matrix of SGGX microflakes of fibres along t with roughness alpha. Its mean over a texel is the flake matrix
of the texel [Heitz2015SGGX, section 5]: it holds the variance of the fibres' directions, as LEAN mapping holds that of
normals [Olano2010LEAN].
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from pipeline.analytic.mip_levels import halved
from pipeline.compiled.arrays import Float32, Float64
from pipeline.materials.lobes import Reflectance, white_f0
from weaves.errors import BadInput
from weaves.fabric import Fabric
from weaves.surface import GAP, WARP, ClothSurface, surface_at, surface_maps

SMALLEST_MAP: Final = 64  # shortest longer side, in texels

LARGEST_MAP: Final = 4096  # longest side, in texels: the sums of such a map take 1.5 GB

LEAST_TEXELS_PER_YARN: Final = 4  # fewest texels along a yarn spacing

SAMPLES_PER_YARN: Final = 16  # fewest points along a yarn spacing: maps with fewer texels take several points a texel

PAIRS: Final = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))  # axes of the six stored entries of a symmetric matrix

_SQUARE: Final = 0.01  # difference of the sides of a texel that counts as none
_COPIES: Final = 16  # most repeats along the shorter side
_BAND: Final = 1 << 18  # points evaluated at once

YarnColours = list[tuple[Float64, Float64, Float64]]
"""Base colours, F0 and transmitted colours of the ends and of the picks, linear RGB, each (threads, 3)."""


class Layout(NamedTuple):
    """Ends and picks that a map shows, in whole repeats, and its texels along x and y, which are powers of two."""

    ends: int
    picks: int
    width: int
    height: int

    @property
    def texels_per_yarn(self) -> float:
        """Texels along a yarn spacing, in the direction that has fewer."""
        return min(self.width / self.ends, self.height / self.picks)


class Planes(NamedTuple):
    """Means over the texels of one level, float32 (H, W) and (H, W, n), pick 0 in row 0."""

    coverage: Float32  # share of the texel that is covered, (H, W)
    height: Float32  # height in yarn spacings; gaps count as the lowest point of the cloth, (H, W)
    normal: Float32  # c n, (H, W, 3)
    fibres: Float32  # c (1 - alpha^2) t t^T, entries in the order of `PAIRS`, (H, W, 6)
    base: Float32
    specular: Float32
    through: Float32
    """c times the diffuse, the specular and the transmitted colour, linear RGB, (H, W, 3)."""

    def halved(self) -> Planes:
        """Return the next mip level: half of each side that is longer than one texel."""
        return Planes(*(halved(plane) for plane in self))


def layout(fabric: Fabric, size: int) -> Layout:
    """Return the layout of a fabric's maps, `size` texels along the longer side.

    BadInput if the size is no power of two from `SMALLEST_MAP` to `LARGEST_MAP`, or too small for the repeat.
    """
    if not SMALLEST_MAP <= size <= LARGEST_MAP or size & (size - 1):
        raise BadInput("export", "size", size, f"must be a power of two from {SMALLEST_MAP} to {LARGEST_MAP}")
    best = best_layout(fabric, size)
    if best.texels_per_yarn < LEAST_TEXELS_PER_YARN:
        needed = size << math.ceil(math.log2(LEAST_TEXELS_PER_YARN / best.texels_per_yarn))
        ends, picks = fabric.repeat
        allowed = f"the repeat of {ends} ends and {picks} picks needs {needed}"
        if needed > LARGEST_MAP:
            allowed += f", and at most {LARGEST_MAP} are possible"
        raise BadInput("export", "size", size, allowed)
    return best


def best_layout(fabric: Fabric, size: int) -> Layout:
    """Return the same, whether or not its texels are too large for the yarns."""
    repeat, layouts = fabric.repeat, []
    for halvings in range(4):
        for width, height in ((size, size >> halvings), (size >> halvings, size)):
            for copies in range(1, _COPIES + 1):
                # As many repeats along the other side as make texels nearly square.
                rows = max(1, round(copies * repeat[0] * height / (width * repeat[1])))
                columns = max(1, round(copies * repeat[1] * width / (height * repeat[0])))
                layouts.append(Layout(copies * repeat[0], rows * repeat[1], width, height))
                layouts.append(Layout(columns * repeat[0], copies * repeat[1], width, height))
    return min(layouts, key=_order)


def _order(candidate: Layout) -> tuple[float, float, int]:
    """Return the key by which the best layout is the least."""
    aspect = abs(math.log(candidate.width * candidate.picks / (candidate.height * candidate.ends)))
    return max(aspect, _SQUARE), -candidate.texels_per_yarn, candidate.width * candidate.height


def planes(fabric: Fabric, shown: Layout, share: Reflectance) -> Planes:
    """Sum a fabric's surface over the texels of the finest level."""
    per_texel = samples(shown)
    lowest, colours = lowest_height(fabric), material_colours(fabric, share)
    bands = []
    for surface, x, y in _surface_bands(fabric, shown, per_texel):
        sums = _sums(fabric, surface, x, y, colours, lowest)
        for _ in range(per_texel.bit_length() - 1):
            sums = sums.halved()
        bands.append(sums)
    return Planes(*(np.concatenate(parts) for parts in zip(*bands, strict=True)))


def material_colours(fabric: Fabric, share: Reflectance) -> YarnColours:
    """Return the colours of a material's threads, by which it reflects what the truth does (`textures`)."""
    base, f0, through = share.per_area(share.diffuse), white_f0(fabric, share), share.per_area(share.transmitted)
    return [
        (dyed.diffuse * base[family], dyed.specular * f0[family], dyed.diffuse_transmission * through[family])
        for family, dyed in enumerate(fabric.thread_colours())
    ]


def yarn_ids(fabric: Fabric, shown: Layout) -> npt.NDArray[np.int32]:
    """Return the number of the yarn at each texel centre, (H, W): 0 in gaps, then the ends, then the picks."""
    bands = []
    for surface, x, y in _surface_bands(fabric, shown, 1):
        end, pick = 1 + x.astype(np.int32), 1 + shown.ends + y.astype(np.int32)
        on_yarn = np.where(surface.yarn == WARP, end[None, :], pick[:, None])
        bands.append(np.where(surface.yarn == GAP, 0, on_yarn).astype(np.int32))
    return np.concatenate(bands)


def _surface_bands(fabric: Fabric, shown: Layout, per_texel: int) -> Iterator[tuple[ClothSurface, Float64, Float64]]:
    """Yield the surface, x and y of some rows of points at a time, in whole texels of `per_texel` points a side."""
    width, height = shown.width * per_texel, shown.height * per_texel
    x: Float64 = (np.arange(width, dtype=np.float64) + 0.5) * (shown.ends / width)
    y: Float64 = (np.arange(height, dtype=np.float64) + 0.5) * (shown.picks / height)
    rows = max(1, _BAND // width // per_texel) * per_texel
    for first in range(0, height, rows):
        part = y[first : first + rows]
        yield surface_at(fabric, x[None, :], part[:, None]), x, part


def samples(shown: Layout) -> int:
    """Return the points of a texel along each side, a power of two."""
    return 1 << max(0, math.ceil(math.log2(SAMPLES_PER_YARN / shown.texels_per_yarn)))


def lowest_height(fabric: Fabric) -> float:
    """Return the lowest height of the yarns."""
    height = surface_maps(fabric, max(8, min(64, 1024 // max(fabric.weave.repeat)))).height
    return float(height[np.isfinite(height)].min())


def _sums(fabric: Fabric, surface: ClothSurface, x: Float64, y: Float64, dyed: YarnColours, lowest: float) -> Planes:
    """Return the sums of single points."""
    yarn, covered = surface.yarn, (surface.yarn != GAP)[..., None]
    tangent = surface.tangent
    smooth = np.array([1.0 - f.roughness**2 for f in (fabric.warp, fabric.weft)] + [0.0])[yarn]
    fibres = np.stack([smooth * tangent[..., a] * tangent[..., b] for a, b in PAIRS], axis=-1)
    height = np.where(np.isfinite(surface.height), surface.height, lowest)
    colours = []
    for ends, picks in zip(*dyed, strict=True):
        of_end, of_pick = ends[x.astype(np.intp) % len(ends)], picks[y.astype(np.intp) % len(picks)]
        on_yarn = np.where(yarn[..., None] == WARP, of_end[None, :, :], of_pick[:, None, :])
        colours.append(np.where(covered, on_yarn, 0.0))
    sums = (covered[..., 0], height, covered * surface.normal, fibres, *colours)
    return Planes(*(np.asarray(plane, np.float32) for plane in sums))
