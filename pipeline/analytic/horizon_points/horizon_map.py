"""A horizon map of the repeat: the surface at any point and the horizon of the nearest node, without branches.

Every piece of yarn that is seen from above in a cell is one block of GRID x GRID nodes, evenly spaced in the angle v
across the yarn and evenly along it; cells that a translation of the cloth carries into one another share their blocks.
A node holds the sine of its horizon's elevation for evenly spaced azimuths, as in Max's horizon maps (1988): memory
replaces ray marching. The price is that borders of shadows move by up to half a node.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from pipeline.analytic.gauss_rules import grid_middles
from pipeline.compiled.arrays import Float32, Float64, Index
from pipeline.compiled.decorators import fast_kernel
from pipeline.compiled.float32 import arcsine
from pipeline.truth.geometry.heightfield import GAP, RADIUS, TOP, WARP, WEFT, HeightField
from pipeline.truth.geometry.horizon import horizon_sines
from pipeline.truth.geometry.pieces import CellPiece, cell_pieces, orbits

SCRATCH_ROWS: Final = 26
"""Rows of numbers."""

# Inputs: position in the repeat and weight; directions of the query, 1 / |wi + wo|^2, where between two azimuths they
# lie. Then the results of `locate`, and the shares that `shade` writes.
(X, Y, WEIGHT, IX, IY, IZ, OX, OY, OZ, SIZE, TURN_I, TURN_O, SINE, DISTANCE, CURVATURE, LIMIT, WARPNESS, WEFTNESS,
 SEEN, BOTH, STEP_V, STEP_Y, STEEPNESS, AREA, DIFFUSE, SPECULAR) = range(SCRATCH_ROWS)  # fmt: skip

INTEGERS: Final = 5
"""Rows of integers."""

# The azimuths' rows around wi and wo, and the node.
I0, I1, O0, O1, NODE = range(INTEGERS)


SLOTS: Final = 4
"""Pieces of a cell: the yarn on top, the one beneath on its low and on its high side, the gap."""

# Columns of `HorizonMap.pieces`.
MAP_ALONG, MAP_CURVE, MAP_BOUND, MAP_START, MAP_SCALE = range(5)

_0, _1, _HALF = np.float32(0.0), np.float32(1.0), np.float32(0.5)
_INVERSE_PI = np.float32(1.0 / math.pi)
_STEEPEST: Final = 0.99999  # sine of u that rounding may not pass


class HorizonMap(NamedTuple):
    """Pieces and horizons of one repeat.

    Attributes
    ----------
    repeat : int64 (2,)
        Ends and picks.
    top : int32 (picks * ends,)
        Family on top of each cell, row by row.
    pieces : float32 (picks * ends * SLOTS * 5,)
        CellPiece by piece: what is added to the position along the yarn, from the cell's centre, to measure from the
        float's; curvature of the float, negative beneath; bound of sin u; where the block begins along the cell, and
        how many blocks' lengths a yarn spacing is.
    blocks : int32 (picks * ends * SLOTS,)
        Index of the first horizon of each piece.
    horizon : float32 (blocks * azimuths * grid * grid,)
        Sine of the horizon's elevation: azimuth by azimuth, line by line along the yarn, across it.
    grid, azimuths : int
        Nodes a block and side; azimuths from +x, counter-clockwise.
    yarn : float32 (2, 8)
        As `HeightField.yarn`.
    thickness : float
        Optical thickness.
    """

    repeat: Index
    top: npt.NDArray[np.int32]
    pieces: Float32
    blocks: npt.NDArray[np.int32]
    horizon: Float32
    grid: int
    azimuths: int
    yarn: Float32
    thickness: np.float32


def horizon_map(field: HeightField, back: HeightField, grid: int, azimuths: int) -> HorizonMap:
    """Tabulate one side of a cloth, `grid` nodes a block and side; `back` is the other one, which hides gaps too.

    `azimuths` is even.
    """
    picks, ends = field.top.shape
    pieces = np.zeros((picks, ends, SLOTS, 5))
    blocks = np.zeros((picks, ends, SLOTS), np.int32)
    xs: list[Float64] = []
    ys: list[Float64] = []
    gaps: list[bool] = []
    size = azimuths * grid * grid
    for orbit in orbits(field):
        pick, end = orbit[0]
        # One horizon will do for all gaps of a cell: the first one's, so that it comes last here.
        for slot, piece in {slot_of(piece): piece for piece in reversed(cell_pieces(field, pick, end))}.items():
            for p, e in orbit:
                pieces[p, e, slot] = _row(piece)
                blocks[p, e, slot] = len(xs) * size
            x, y = _nodes(piece, grid)
            gaps.append(piece.family == GAP)
            xs.append(end + x)
            ys.append(pick + y)
    gap = np.repeat(gaps, grid * grid)
    sines = horizon_sines(field, back, np.concatenate(xs), np.concatenate(ys), gap, azimuths)
    sines = sines.reshape(azimuths, len(xs), grid * grid)
    return HorizonMap(
        repeat=np.array([ends, picks], np.int64),
        top=field.top.ravel().astype(np.int32),
        pieces=pieces.ravel().astype(np.float32),
        blocks=blocks.ravel(),
        horizon=np.ascontiguousarray(sines.transpose(1, 0, 2), np.float32).ravel(),
        grid=grid,
        azimuths=azimuths,
        yarn=field.yarn.astype(np.float32),
        thickness=np.float32(field.thickness),
    )


def slot_of(piece: CellPiece) -> int:
    """Return which of the SLOTS of its cell a piece is."""
    if piece.family == GAP:
        return 3
    if piece.side == TOP:
        return 0
    return 1 if piece.along[0] == 0.0 else 2


def _row(piece: CellPiece) -> tuple[float, ...]:
    """Return the row of `HorizonMap.pieces`."""
    if piece.family == GAP:
        return (0.0, 0.0, 0.0, 0.0, 0.0)
    low, high = piece.along
    # A weft is measured along -x.
    offset = piece.offset if piece.family == WARP else -piece.offset
    return (offset, piece.sign * piece.curve, min(piece.steepest, _STEEPEST), low, 1.0 / (high - low))


def _nodes(piece: CellPiece, grid: int) -> tuple[Float64, Float64]:
    """Return x and y of a block's nodes within the cell, (grid * grid,): across the yarn runs fastest."""
    if piece.family == GAP:
        x = np.full(grid * grid, 0.5 * min(piece.across[1], piece.along[1]))
        return x, x
    across = np.tile(grid_middles(*piece.across, grid, piece.radius), grid)
    along = np.repeat(grid_middles(*piece.along, grid, 0.0), grid)
    return (across, along) if piece.family != WEFT else (along, across)


@fast_kernel
def locate(table: HorizonMap, count: int, points: Float32, places: npt.NDArray[np.int32]) -> None:
    """Find what is seen from above at points of the repeat: place in the yarn's frame, float and nearest node.

    Reads the rows X and Y of the scratch (`points`); writes SINE to WEFTNESS, and NODE.
    """
    x, y, node = points[X], points[Y], places[NODE]
    sine, distance, curvature, limit = points[SINE], points[DISTANCE], points[CURVATURE], points[LIMIT]
    warpness, weftness = points[WARPNESS], points[WEFTNESS]
    ends = np.int32(table.repeat[0])
    last_end, last_pick = np.float32(table.repeat[0] - 1), np.float32(table.repeat[1] - 1)
    top, pieces, blocks = table.top, table.pieces, table.blocks
    warp_radius, weft_radius = table.yarn[0, RADIUS], table.yarn[1, RADIUS]
    grid, size = np.int32(table.grid), np.float32(table.grid)
    for k in range(count):
        column, line = min(np.floor(x[k]), last_end), min(np.floor(y[k]), last_pick)
        cell = np.int32(line) * ends + np.int32(column)
        fx, fy = x[k] - column - _HALF, y[k] - line - _HALF
        in_warp, in_weft = abs(fx) <= warp_radius, abs(fy) <= weft_radius
        warp_top = top[cell] == np.int32(0)
        covered = in_warp if warp_top else in_weft
        beneath = in_weft if warp_top else in_warp
        warp = warp_top if covered else not warp_top
        gap = not (covered or beneath)
        along = fy if warp else fx
        slot = np.int32(0) if covered else (np.int32(3) if gap else (np.int32(1) if along < _0 else np.int32(2)))
        piece = cell * np.int32(SLOTS) + slot
        row = piece * np.int32(5)
        across = (fx if warp else fy) / (warp_radius if warp else weft_radius)
        across = min(max(across, -_1), _1)
        place = (along + _HALF - pieces[row + np.int32(MAP_START)]) * pieces[row + np.int32(MAP_SCALE)] * size
        turn = (arcsine(across) * _INVERSE_PI + _HALF) * size
        i = np.int32(min(max(turn, _0), size - _HALF))
        j = np.int32(min(max(place, _0), size - _HALF))
        node[k] = blocks[piece] + j * grid + i
        sine[k] = across
        distance[k] = (along if warp else -along) + pieces[row + np.int32(MAP_ALONG)]
        curvature[k] = pieces[row + np.int32(MAP_CURVE)]
        limit[k] = pieces[row + np.int32(MAP_BOUND)]
        warpness[k] = _1 if (warp and not gap) else _0
        weftness[k] = _0 if (warp or gap) else _1
