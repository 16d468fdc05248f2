"""A horizon map of the repeat: the horizons at a grid of nodes on every piece of yarn.

Every piece of yarn that is seen from above in a cell is one block of nodes, as many across the yarn, evenly spaced in
the angle v, as along it; cells that a translation of the cloth carries into one another share their blocks.
A node holds the sine of its horizon's elevation for evenly spaced azimuths, as in Max's horizon maps (1988).
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from pipeline.analytic.gauss_rules import grid_middles
from pipeline.compiled.arrays import Float32, Float64
from pipeline.truth.geometry.heightfield import GAP, TOP, WEFT, HeightField
from pipeline.truth.geometry.horizon import horizon_sines
from pipeline.truth.geometry.pieces import CellPiece, cell_pieces, orbits

SLOTS: Final = 4
"""Pieces of a cell: the yarn on top, the one beneath on its low and on its high side, the gap."""


class HorizonMap(NamedTuple):
    """Horizons of one repeat."""

    blocks: npt.NDArray[np.int32]
    """Index of the first horizon of each piece, int32 (picks * ends * SLOTS,)."""
    horizon: Float32
    """Sine of the horizon's elevation: azimuth by azimuth, line by line along the yarn, across it,
    (blocks * azimuths * grid * grid,)."""
    grid: int
    azimuths: int
    """Nodes a block and side; azimuths from +x, counter-clockwise."""


def horizon_map(field: HeightField, back: HeightField, grid: int, azimuths: int) -> HorizonMap:
    """Tabulate one side of a cloth, `grid` nodes a block and side; `back` is the other one, which hides gaps too.

    `azimuths` is even.
    """
    picks, ends = field.top.shape
    blocks = np.zeros((picks, ends, SLOTS), np.int32)
    xs: list[Float64] = []
    ys: list[Float64] = []
    gaps: list[bool] = []
    size = azimuths * grid * grid
    for orbit in orbits(field):
        pick, end = orbit[0]
        # One horizon will do for all gaps of a cell: the first one's, so that it comes last here.
        for slot, piece in {_slot_of(piece): piece for piece in reversed(cell_pieces(field, pick, end))}.items():
            for p, e in orbit:
                blocks[p, e, slot] = len(xs) * size
            x, y = _nodes(piece, grid)
            gaps.append(piece.family == GAP)
            xs.append(end + x)
            ys.append(pick + y)
    gap = np.repeat(gaps, grid * grid)
    sines = horizon_sines(field, back, np.concatenate(xs), np.concatenate(ys), gap, azimuths)
    sines = sines.reshape(azimuths, len(xs), grid * grid)
    horizon = np.ascontiguousarray(sines.transpose(1, 0, 2), np.float32).ravel()
    return HorizonMap(blocks.ravel(), horizon, grid, azimuths)


def _slot_of(piece: CellPiece) -> int:
    """Return which of the SLOTS of its cell a piece is."""
    if piece.family == GAP:
        return 3
    if piece.side == TOP:
        return 0
    return 1 if piece.along[0] == 0.0 else 2


def _nodes(piece: CellPiece, grid: int) -> tuple[Float64, Float64]:
    """Return x and y of a block's nodes within the cell, (grid * grid,): across the yarn runs fastest."""
    if piece.family == GAP:
        x = np.full(grid * grid, 0.5 * min(piece.across[1], piece.along[1]))
        return x, x
    across = np.tile(grid_middles(*piece.across, grid, piece.radius), grid)
    along = np.repeat(grid_middles(*piece.along, grid, 0.0), grid)
    return (across, along) if piece.family != WEFT else (along, across)
