"""Walls: the steps below the borders of yarns, as nodes that view rays meet and that look like the rim above them.

A wall is a border of a piece of yarn beyond which the cloth lies lower. Each place along it is a node: it has the
frame, the light and the colour of the rim, and towards the viewer the area

    length  x  seen height  x  max(m.wo, 0),    m the horizontal normal of the wall,

because that is what its rays cover of a plane across them. The seen height comes from the horizons of a few points of
the wall: a deeper point sees less. Over a gap a wall ends where the yarn's back does, but not above the fabric plane.
Below that, as in `ray_share`, it goes on for rays that do not clear the back of the cloth: a *deep* wall, whose points
are met by rays that are flatter than their horizon at the back.
"""

import math
from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np

from pipeline.compiled.arrays import Float32, Float64, Index, Mask
from pipeline.compiled.decorators import allocating_kernel
from pipeline.truth.geometry.heightfield import GAP, UNDER, WARP, HeightField, surface_at
from pipeline.truth.geometry.horizon import horizon, horizons

HEIGHTS: Final = 6  # points of a wall from the rim to the foot

Edges = tuple[float, ...]
Grid = tuple[int, int, int, Edges, Edges]  # end, pick, family, and the edges of a piece's nodes along x and y

_INSET, _OUTSET = 1e-9, 1e-7  # distances from the border
_LEAST_HEIGHT = 1e-4
_UNSEEN = 1e4


class WallNodes(NamedTuple):
    """Walls of one side of a cloth: those of warps, their deep ones, those of wefts, their deep ones."""

    starts: tuple[int, int, int, int, int]  # first wall of each kind, and the number of all
    places: Float32  # where each wall is in the repeat, and the height of its top, (3, W)
    height: Float32  # from the foot to the top, (W,)
    out: Float32  # its horizontal normal, (2, W)
    normal: Float32  # normal of the rim, and 1, (4, W)
    tangent: Float32  # fibre tangent of the rim, (3, W)
    evenly: Float32  # length of a wall and its copies over the area of the repeat, (W,)
    horizon: Float32  # slope of the horizon at points of the wall, from the top down, (A, HEIGHTS, W)
    passing: Float32
    """Slope above which a view ray to these points of deep walls clears the back; no rows without deep walls,
    (A, HEIGHTS, W)."""
    slope: Float32
    slope_behind: Float32
    """Slope of the rim's horizon, and of that at the back of the cloth; no rows if there is no need for them,
    (A, W)."""


def no_walls() -> WallNodes:
    """Return the walls of a table without any."""
    points = (0, HEIGHTS, 0)
    shapes = (3, 0), (0,), (2, 0), (4, 0), (3, 0), (0,), points, points, (0, 0), (0, 0)
    return WallNodes((0,) * 5, *(np.zeros(shape, np.float32) for shape in shapes))


def wall_nodes(
    front: HeightField, back: HeightField, grids: Sequence[Grid], copies: int, behind: bool, azimuths: int
) -> WallNodes:
    """Return the walls below all borders of pieces, each of which has so many `copies` in the repeat."""
    picks, ends = front.top.shape
    inside: list[Float64] = []
    outside: list[Float64] = []
    out, lengths, families = [], [], []
    for end, pick, family, x_edges, y_edges in grids:
        if family == GAP:
            continue
        for axis, (across, along) in enumerate(((x_edges, y_edges), (y_edges, x_edges))):
            places = 0.5 * (np.array(along[1:]) + np.array(along[:-1]))
            for sign, border in ((-1.0, across[0]), (1.0, across[-1])):
                for points, beyond in ((inside, -_INSET), (outside, _OUTSET)):
                    level = np.full(len(places), border + sign * beyond)
                    x, y = (level, places) if axis == 0 else (places, level)
                    points.append(np.array([(x + end) % ends, (y + pick) % picks]))
                normal = (sign, 0.0) if axis == 0 else (0.0, sign)
                out.append(np.broadcast_to(np.array(normal)[:, None], (2, len(places))))
                lengths.append(np.diff(along))
                families.append(np.full(len(places), family))
    at, beside, normals = (np.concatenate(part, axis=1) for part in (inside, outside, out))
    rim, foot, over_gap = _rims(front, back, at, beside)
    # Deep walls follow the others.
    count, deep = at.shape[1], np.flatnonzero(over_gap)
    every = np.concatenate([np.arange(count), deep])
    top = np.concatenate([rim[0], foot[deep]])
    height = top - np.concatenate([foot, np.full(len(deep), front.lowest)])
    kind = 2 * (np.concatenate(families) != WARP)[every] + (np.arange(len(every)) >= count)
    kept = np.flatnonzero(height > _LEAST_HEIGHT)
    kept = kept[np.argsort(kind[kept], kind="stable")]
    chosen, top, height, kind = every[kept], top[kept], height[kept], kind[kept]
    at, beside, normals, rim = (np.ascontiguousarray(part[:, chosen]) for part in (at, beside, normals, rim))
    points = top - height * np.linspace(0.0, 1.0, HEIGHTS)[:, None]
    passing = np.zeros((0, HEIGHTS, len(kept)), np.float32)
    if (kind % 2).any():
        passing = np.roll(_wall_horizons(back, at, -normals, -points, kind % 2, azimuths), azimuths // 2, axis=0)
    slope_behind = horizons(back, at[0], at[1], azimuths, True) if behind else np.zeros((0, len(kept)), np.float32)
    starts = np.searchsorted(kind, np.arange(5)).tolist()
    return WallNodes(
        starts=(starts[0], starts[1], starts[2], starts[3], starts[4]),
        places=np.array([at[0], at[1], top], np.float32),
        height=height.astype(np.float32),
        out=normals.astype(np.float32),
        normal=np.concatenate([rim[1:4], np.ones((1, len(kept)))]).astype(np.float32),
        tangent=rim[4:7].astype(np.float32),
        evenly=(np.concatenate(lengths)[chosen] * copies / (ends * picks)).astype(np.float32),
        horizon=_wall_horizons(front, beside, normals, points, np.ones_like(kind), azimuths),
        passing=passing,
        slope=horizons(front, at[0], at[1], azimuths, False),
        slope_behind=slope_behind,
    )


@allocating_kernel
def _rims(front: HeightField, back: HeightField, at: Float64, beside: Float64) -> tuple[Float64, Float64, Mask]:
    """Return height, normal and tangent of rims, (7, N), the heights of the walls' feet, and which are over gaps."""
    count = at.shape[1]
    rim, feet, over_gap = np.zeros((7, count)), np.zeros(count), np.zeros(count, np.bool_)
    for k in range(count):
        x, y = at[0, k], at[1, k]
        _, _, z, nx, ny, nz, tx, ty, tz = surface_at(front, x, y, int(x), int(y))
        rim[0, k], rim[1, k], rim[2, k], rim[3, k] = z, nx, ny, nz
        rim[4, k], rim[5, k], rim[6, k] = tx, ty, tz
        x, y = beside[0, k], beside[1, k]
        family, _, foot, _, _, _, _, _, _ = surface_at(front, x, y, int(x), int(y))
        if family == GAP:
            x, y = at[0, k], at[1, k]
            _, _, under, _, _, _, _, _, _ = surface_at(back, x, y, int(x), int(y))
            foot, over_gap[k] = min(-under, 0.0), True
        feet[k] = foot
    return rim, feet, over_gap


@allocating_kernel
def _wall_horizons(
    field: HeightField, at: Float64, out: Float64, points: Float64, wanted: Index, azimuths: int
) -> Float32:
    """Return horizons at points (HEIGHTS, N) over places (2, N); 1e4 if a wall faces away, or is not `wanted`."""
    count = len(wanted)
    slopes = np.full((azimuths, HEIGHTS, count), _UNSEEN, np.float32)
    for k in range(count):
        if not wanted[k]:
            continue
        for a in range(azimuths):
            turn = 2.0 * math.pi * a / azimuths
            dx, dy = math.cos(turn), math.sin(turn)
            if dx * out[0, k] + dy * out[1, k] < -1e-9:
                continue
            for h in range(HEIGHTS):
                slopes[a, h, k] = horizon(field, at[0, k], at[1, k], points[h, k], UNDER, dx, dy)
    return slopes
