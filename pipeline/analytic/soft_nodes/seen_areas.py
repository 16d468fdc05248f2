"""Area that a viewer sees of each fixed node's box, tabulated: what the rays of a wide footprint meet.

A box has the area a = integral of A(wo) V over it, as a share of its own: 1 from above, n_s.wo / n_z where nothing
hides it. With rims it has that of the wall below its border too. The areas of all boxes and gaps then sum to wo.n_s,
because every ray meets something. Walls where floats end are counted apart too: sums over fixed nodes take them for
dark with the light behind, which agrees with the truth (reports/LOG.md, "Rims lit from behind").

Cells of the grids of horizons are summed. Their heights differ by exactly what a ray sees of their slope,
n_s.wo / n_z = wo_z - wo.grad h, so that steep borders of yarns lose nothing.
"""

import math
from collections.abc import Iterator
from typing import Final

import numpy as np
import numpy.typing as npt

from pipeline.analytic.gauss_rules import grid_edges
from pipeline.analytic.soft_horizons import AZIMUTHS, azimuth_at
from pipeline.analytic.soft_nodes.groups import PieceGroup
from pipeline.compiled.arrays import Float32, Float64
from pipeline.compiled.decorators import allocating_kernel, fast_kernel, inlined_kernel
from pipeline.truth.geometry import heightfield
from pipeline.truth.geometry.heightfield import GAP, OFFSET, UNDER, WARP, WEFT, HeightField
from pipeline.truth.geometry.horizon import horizon
from pipeline.truth.geometry.pieces import CellPiece

SEEN_ANGLES: Final = 18
"""Angles of the viewer to the normal, 0 to 90 degrees, even in their power 3/2: finer where less is seen."""

Sample = tuple[int, int, CellPiece]  # a piece that has a grid of horizons, with its pick and end

_WALL_HEIGHTS, _WALL_PLACES = 3, 8  # points of a wall, upwards and along
_RAMP = 0.02  # of the sine of a cell's horizon
_OUTSIDE = 1e-7
_LEAST_WALL = 1e-4
_STEPS, _TURN = np.float32(SEEN_ANGLES - 1), np.float32(2.0 / math.pi)
_0, _1 = np.float32(0.0), np.float32(1.0)


def _directions() -> Float64:
    """Return all directions of the table, (angles, azimuths, 3)."""
    angle = 0.5 * math.pi * (np.arange(SEEN_ANGLES) / (SEEN_ANGLES - 1)) ** (2.0 / 3.0)
    dx, dy = azimuth_at(np.arange(AZIMUTHS) / AZIMUTHS)
    dx, dy = dx / np.hypot(dx, dy), dy / np.hypot(dx, dy)
    sine, cosine = np.sin(angle)[:, None], np.cos(angle)[:, None]
    return np.stack([sine * dx, sine * dy, np.broadcast_to(cosine, (SEEN_ANGLES, AZIMUTHS))], axis=-1)


def seen_areas(
    front: HeightField, samples: list[Sample], grid: npt.NDArray[np.uint8], groups: list[PieceGroup], rims: bool
) -> Iterator[Float64]:
    """Yield the areas of each group's nodes, and of the walls where floats end in them, (2, azimuths, angles, nodes).

    `grid` are the horizons of the `samples`, (grids, AZIMUTHS, cells along y, cells along x); the `blocks` of the
    groups are numbers of grids. Walls count if `rims`.
    """
    towards = _directions()
    of_grids = [_areas_of(front, sample, own, towards, rims) for sample, own in zip(samples, grid, strict=True)]
    for group in groups:
        of_across, of_along = group.overlaps(grid.shape[-1])
        blocks, counts = np.unique(group.blocks, return_counts=True)
        mean = sum(count * of_grids[block] for block, count in zip(blocks, counts, strict=True)) / counts.sum()
        yield (of_along @ mean @ of_across.T).reshape(2, SEEN_ANGLES, AZIMUTHS, -1).swapaxes(1, 2)


def rays_left(shares: Float64, gaps: int) -> Float64:
    """Return the factor of the areas of yarns with which every ray meets something, (azimuths, angles).

    `shares` (azimuths, angles, nodes) are areas as shares of the cloth's, of gaps from node `gaps` on.
    """
    rise = _directions()[..., 2].T
    yarns, free = shares[..., :gaps].sum(axis=-1), shares[..., gaps:].sum(axis=-1)
    return np.asarray((rise - free) / np.maximum(yarns, 1e-9))


def _areas_of(front: HeightField, sample: Sample, grid: npt.NDArray[np.uint8], towards: Float64, rims: bool) -> Float64:
    """Return areas of a grid's cells and of the walls where its float ends, (2, angles, azimuths, along, across)."""
    pick, end, piece = sample
    size = grid.shape[-1]
    across, along = grid_edges(*piece.across, size, piece.radius), grid_edges(*piece.along, size, 0.0)
    height = np.zeros((size + 1, size + 1))
    if piece.family != GAP:
        height = heights(front, pick, end, piece.family, piece.side, across, along)
    by_across = 0.5 * (np.diff(height[1:], axis=1) + np.diff(height[:-1], axis=1)) / np.diff(across)
    by_along = 0.5 * (np.diff(height[:, 1:], axis=0) + np.diff(height[:, :-1], axis=0)) / np.diff(along)[:, None]
    # x runs along a weft.
    weft = piece.family == WEFT
    sines = (grid.transpose(0, 2, 1) if weft else grid) / 255.0
    o_across, o_along, rise = (towards[..., axis, None, None] for axis in ((1, 0, 2) if weft else (0, 1, 2)))
    area = np.maximum(rise - o_across * by_across - o_along * by_along, 0.0)
    area *= np.clip(0.5 + (rise - sines) / _RAMP, 0.0, 1.0)
    ends = np.zeros_like(area)
    if rims and piece.family != GAP:
        _add_walls(front, sample, height, across, along, area, ends, towards)
    return np.stack([area, ends])


@allocating_kernel
def heights(
    front: HeightField, pick: int, end: int, family: int, side: int, across: Float64, along: Float64
) -> Float64:  # fmt: skip
    """Return heights of a piece at places of its cell, (along, across)."""
    height, yarn, own = np.zeros((len(along), len(across))), front.yarn[family], front.floats[pick, end, side]
    for j in range(len(along)):
        for i in range(len(across)):
            x, y = (across[i], along[j]) if family == WARP else (along[j], across[i])
            a, b = heightfield.local_position(family, own[OFFSET], x + end, y + pick, end, pick)
            height[j, i], _, _ = heightfield.float_height(yarn, own, side, a, b)
    return height


def _add_walls(
    front: HeightField, sample: Sample, height: Float64, across: Float64, along: Float64, area: Float64, ends: Float64,
    towards: Float64,
) -> None:  # fmt: skip
    """Add the walls below a piece's borders to the areas of the cells there; where its float ends, to `ends` too."""
    pick, end, piece = sample
    size, warp = len(across) - 1, piece.family == WARP
    cells = np.diff(along)[:, None] * np.diff(across)
    azimuths = np.arctan2(towards[-1, :, 1], towards[-1, :, 0])
    for runs_along in (True, False):
        edges, middles = (along, across) if runs_along else (across, along)
        lengths, whole = np.diff(edges), edges[-1] - edges[0]
        places = edges[0] + whole * (np.arange(_WALL_PLACES) + 0.5) / _WALL_PLACES
        # The point of each cell.
        near = (0.5 * (edges[1:] + edges[:-1]) - edges[0]) * (_WALL_PLACES / whole)
        near = np.clip(near.astype(np.int64), 0, _WALL_PLACES - 1)
        for index, sign in ((0, -1.0), (size, 1.0)):
            border = middles[index]
            rim = np.interp(places, edges, height[:, index] if runs_along else height[index])
            # Whether the border lies along y.
            upright = runs_along == warp
            x, y = (np.full(_WALL_PLACES, border), places) if upright else (places, np.full(_WALL_PLACES, border))
            dx, dy = (sign, 0.0) if upright else (0.0, sign)
            facing = np.maximum(towards[..., 0] * dx + towards[..., 1] * dy, 0.0)
            drop, sines = _wall_horizons(front, end + x, pick + y, dx, dy, rim, azimuths)
            free = np.clip(0.5 + (towards[..., 2, None, None] - sines) / _RAMP, 0.0, 1.0).mean(axis=-1)
            seen = facing[..., None] * (free * drop)[..., near] * lengths
            inside = index - 1 if index else 0
            row = (..., slice(None), inside) if runs_along else (..., inside, slice(None))
            for walls in (area,) if runs_along else (area, ends):
                walls[row] += seen / cells[row]


@allocating_kernel
def _wall_horizons(
    front: HeightField, x: Float64, y: Float64, dx: float, dy: float, rim: Float64, azimuths: Float64
) -> tuple[Float64, Float64]:
    """Return heights of the wall at places of a border, (P,), and sines of horizons, (azimuths, P, heights)."""
    picks, ends = front.top.shape
    height, sines = np.zeros(len(x)), np.ones((len(azimuths), len(x), _WALL_HEIGHTS))
    for k in range(len(x)):
        out_x, out_y = (x[k] + _OUTSIDE * dx) % ends, (y[k] + _OUTSIDE * dy) % picks
        _, _, foot, _, _, _, _, _, _ = heightfield.surface_at(front, out_x, out_y, int(out_x), int(out_y))
        if rim[k] - foot < _LEAST_WALL:
            continue
        height[k] = rim[k] - foot
        for h in range(_WALL_HEIGHTS):
            z = foot + height[k] * (h + 0.5) / _WALL_HEIGHTS
            for a in range(len(azimuths)):
                to_x, to_y = math.cos(azimuths[a]), math.sin(azimuths[a])
                if to_x * dx + to_y * dy > 1e-9:
                    slope = horizon(front, out_x, out_y, z, UNDER, to_x, to_y)
                    sines[a, k, h] = slope / math.sqrt(1.0 + slope * slope)
    return height, sines


@inlined_kernel
def angle_of(oz: np.float32) -> tuple[int, np.float32]:
    """Return the angle of the table below that of a direction, and where between it and the next one it lies."""
    share = np.arccos(min(max(oz, _0), _1)) * _TURN
    angle = share * np.sqrt(share) * _STEPS
    step = min(int(angle), SEEN_ANGLES - 2)
    return step, angle - np.float32(step)


@fast_kernel
def write_areas(
    table: Float32 | npt.NDArray[np.uint8], low: int, high: int, turn: np.float32, step: int, part: np.float32,
    found: Float32,
) -> None:  # fmt: skip
    """Write the areas or shares of all nodes, (B, BLOCK_NODES), towards a direction between azimuths and angles."""
    a, b, c, d = table[low, step], table[low, step + 1], table[high, step], table[high, step + 1]
    of_a, of_b = (_1 - turn) * (_1 - part), (_1 - turn) * part
    of_c, of_d = turn * (_1 - part), turn * part
    for k in range(len(found)):
        for i in range(found.shape[1]):
            found[k, i] = of_a * a[k, i] + of_b * b[k, i] + of_c * c[k, i] + of_d * d[k, i]
