"""A horizon map of the repeat: for any point the nearest node's horizon, and what its surface is, without branches.

Every piece of yarn that is seen from above in a cell is one block of GRID x GRID nodes, evenly spaced in the angle v
across the yarn and evenly along it; cells that a translation of the cloth carries into one another share their blocks.
A node knows the sine of its horizon's elevation for evenly spaced azimuths. Memory instead of ray marching, as with
Max's horizon maps (1988); what it costs in exactness is that borders of shadows move by up to half a node.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from pipeline.truth.heightfield import (
    BEND_RADIUS,
    GAP,
    HALF_LENGTH,
    OFFSET,
    RADIUS,
    TOP,
    UNDER,
    WARP,
    WEFT,
    HeightField,
)
from pipeline.truth.horizon import horizons
from pipeline.truth.table import orbits

Single = npt.NDArray[np.float32]

SLOTS: Final = 4
"""Pieces of a cell: the yarn on top, the one beneath on its low and on its high side, the gap."""

# Columns of `HorizonMap.pieces`.
ALONG, CURVE, BOUND, START, SCALE = range(5)

_STEEPEST: Final = 0.99999  # sine of u that rounding may not pass


class HorizonMap(NamedTuple):
    """Pieces and horizons of one repeat.

    Attributes
    ----------
    repeat : int64 (2,)
        Ends and picks.
    top : int32 (picks * ends,)
        Family on top of each cell, row by row.
    pieces : float32 (picks * ends * SLOTS, 5)
        What is added to the position along the yarn, from the cell's centre, to measure from the float's; curvature of
        the float, negative beneath; bound of sin u; where the block begins along the cell, and how many blocks' lengths
        a yarn spacing is.
    blocks : int32 (picks * ends * SLOTS,)
        Where the horizons of each piece begin.
    horizon : float32 (blocks * azimuths * grid * grid,)
        Sine of the horizon's elevation: azimuth by azimuth, line by line along the yarn, across it.
    grid, azimuths : int
        Nodes a block and side; azimuths from +x, counter-clockwise.
    yarn : float32 (2, 8)
        As `HeightField.yarn`.
    thickness : float
        Optical thickness.
    """

    repeat: npt.NDArray[np.int64]
    top: npt.NDArray[np.int32]
    pieces: Single
    blocks: npt.NDArray[np.int32]
    horizon: Single
    grid: int
    azimuths: int
    yarn: Single
    thickness: np.float32

    def bytes_stored(self) -> int:
        """Return the bytes of all arrays."""
        return sum(array.nbytes for array in self if isinstance(array, np.ndarray))


def horizon_map(field: HeightField, back: HeightField, grid: int, azimuths: int) -> HorizonMap:
    """Tabulate one side of a cloth, `grid` nodes a block and side; `back` is the other one, which hides gaps too.

    `azimuths` is even.
    """
    picks, ends = field.top.shape
    pieces = np.zeros((picks, ends, SLOTS, 5))
    blocks = np.zeros((picks, ends, SLOTS), np.int32)
    xs: list[npt.NDArray[np.float64]] = []
    ys: list[npt.NDArray[np.float64]] = []
    gaps: list[bool] = []
    size = azimuths * grid * grid
    for orbit in orbits(field.top):
        pick, end = orbit[0]
        for slot, family, low, high in slots(field, pick, end):
            for p, e in orbit:
                pieces[p, e, slot] = _piece(field, p, e, slot, family, low, high)
                blocks[p, e, slot] = len(xs) * size
            x, y = _nodes(field, family, low, high, grid)
            gaps.append(family == GAP)
            xs.append(end + x)
            ys.append(pick + y)
    x, y = np.concatenate(xs), np.concatenate(ys)
    slopes = horizons(field, x, y, azimuths, False).astype(np.float64)
    gap = np.repeat(gaps, grid * grid)
    if gap.any():
        # Who looks through a gap sees it if nothing on the other side of the cloth, seen from -wo, hides it either.
        other = horizons(back, x[gap], y[gap], azimuths, True)
        slopes[:, gap] = np.maximum(slopes[:, gap], np.roll(other, azimuths // 2, axis=0))
    sines = (slopes / np.sqrt(1.0 + slopes * slopes)).reshape(azimuths, len(xs), grid * grid)
    return HorizonMap(
        repeat=np.array([ends, picks], np.int64),
        top=field.top.ravel().astype(np.int32),
        pieces=pieces.reshape(-1, 5).astype(np.float32),
        blocks=blocks.ravel(),
        horizon=np.ascontiguousarray(sines.transpose(1, 0, 2), np.float32).ravel(),
        grid=grid,
        azimuths=azimuths,
        yarn=field.yarn.astype(np.float32),
        thickness=np.float32(field.thickness),
    )


def slots(field: HeightField, pick: int, end: int) -> list[tuple[int, int, float, float]]:
    """Return slot, family and extent along the yarn, within the cell, of everything seen from above."""
    top = int(field.top[pick, end])
    margin, gap = (max(0.0, 0.5 - float(field.yarn[family, RADIUS])) for family in (top, 1 - top))
    found = [(0, top, 0.0, 1.0)]
    if margin > 1e-9:
        found += [(1, 1 - top, 0.0, margin), (2, 1 - top, 1.0 - margin, 1.0)]
        if gap > 1e-9:
            found.append((3, GAP, 0.0, min(margin, gap)))
    return found


def _piece(
    field: HeightField, pick: int, end: int, slot: int, family: int, low: float, high: float
) -> tuple[float, ...]:
    """Return the row of `HorizonMap.pieces`."""
    if family == GAP:
        return (0.0, 0.0, 0.0, 0.0, 0.0)
    side = TOP if slot == 0 else UNDER
    own = field.floats[pick, end, side]
    bend, half = float(own[BEND_RADIUS]), float(own[HALF_LENGTH])
    curve, bound = 0.0, _STEEPEST
    if bend > 0.0:
        curve = 1.0 / bend if side == TOP else -1.0 / bend
        bound = _STEEPEST if side == TOP else min(half / bend, _STEEPEST)
    # A weft is measured along -x.
    offset = float(own[OFFSET]) * (1.0 if family == WARP else -1.0)
    return (offset, curve, bound, low, 1.0 / (high - low))


def _nodes(
    field: HeightField, family: int, low: float, high: float, grid: int
) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """Return x and y of a block's nodes within the cell, (grid * grid,): across the yarn runs fastest."""
    middle = (np.arange(grid) + 0.5) / grid
    if family == GAP:
        # One horizon will do for all four corners: that of the middle of the first.
        x = np.full(grid * grid, 0.5 * high)
        return x, x
    radius = float(field.yarn[family, RADIUS])
    across = np.tile(0.5 + radius * np.sin(math.pi * (middle - 0.5)), grid)
    along = np.repeat(low + (high - low) * middle, grid)
    return (across, along) if family != WEFT else (along, across)
