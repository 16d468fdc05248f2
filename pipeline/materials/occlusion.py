"""Ambient occlusion: the share of an even sky's light that reaches the yarns past other yarns.

With the horizon's elevation e in the azimuth d, never below the tangent plane, and the normal n:

    (1 / pi) integral of V(w) max(n.w, 0) dw  =  mean over d of  n_z cos^2 e + (n.d) (pi / 2 - e - sin e cos e)

Horizons are those of the truth at the nodes of a horizon map, bilinear between them on one piece of yarn. Every piece
that is seen from above in a cell is one block of nodes, as many across the yarn, evenly spaced in the angle v, as along
it; cells that a translation of the cloth carries into one another share their blocks. A node holds the sine of its
horizon's elevation for evenly spaced azimuths, as in Max's horizon maps (1988).
"""

import math
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from pipeline.analytic.gauss_rules import grid_middles
from pipeline.compiled.arrays import Float32, Float64
from pipeline.compiled.decorators import allocating_kernel, kernel
from pipeline.materials.planes import Layout, samples
from pipeline.truth.cloth import cloth_side
from pipeline.truth.geometry.heightfield import GAP, RADIUS, TOP, WARP, WEFT, HeightField, surface_at
from pipeline.truth.geometry.horizon import horizon_sines
from pipeline.truth.geometry.pieces import CellPiece, cell_pieces, different_cells, orbits
from pipeline.truth.options import TruthOptions
from weaves.fabric import Fabric

_AZIMUTHS: Final = 16
_GRIDS: Final = {64: 16, 1024: 8}  # nodes along a piece, by the most different cells
_COARSEST: Final = 4
_SLOTS: Final = 4  # pieces of a cell: the yarn on top, the one beneath on its low and on its high side, the gap


class _HorizonMap(NamedTuple):
    """Horizons of one repeat."""

    blocks: npt.NDArray[np.int32]  # index of the first horizon of each piece, int32 (picks * ends * _SLOTS,)
    horizon: Float32
    """Sine of the horizon's elevation: azimuth by azimuth, line by line along the yarn, across it,
    (blocks * azimuths * grid * grid,)."""
    grid: int  # nodes a block and side


def _horizon_map(field: HeightField, back: HeightField, grid: int, azimuths: int) -> _HorizonMap:
    """Tabulate a side of a cloth, `grid` nodes a block and side; its `back` hides gaps too.

    Its `azimuths` are even, from +x, counter-clockwise.
    """
    picks, ends = field.top.shape
    blocks = np.zeros((picks, ends, _SLOTS), np.int32)
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
    return _HorizonMap(blocks.ravel(), np.ascontiguousarray(sines.transpose(1, 0, 2), np.float32).ravel(), grid)


def _slot_of(piece: CellPiece) -> int:
    """Return which of the slots of its cell a piece is."""
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


def lit_coverage(fabric: Fabric, shown: Layout) -> Float32:
    """Return the coverage of each texel times the share of an even sky's light that reaches it, (H, W), pick 0 first.

    The points of a texel are those of `pipeline.materials.planes.planes`: over its coverage it is the occlusion.
    """
    side = cloth_side(fabric, TruthOptions())
    cells = different_cells(side.front)
    grid = next((nodes for most, nodes in _GRIDS.items() if cells <= most), _COARSEST)
    table = _horizon_map(side.front, side.back, grid, _AZIMUTHS)
    turns = 2.0 * math.pi * np.arange(_AZIMUTHS) / _AZIMUTHS
    return _texels(side.front, table, np.stack([np.cos(turns), np.sin(turns)], axis=-1), shown, samples(shown))


@allocating_kernel
def _texels(field: HeightField, table: _HorizonMap, azimuths: Float64, shown: Layout, points: int) -> Float32:
    """Compute `lit_coverage`; each texel has points x points."""
    lit = np.zeros((shown.height, shown.width), np.float32)
    dx, dy = shown.ends / (shown.width * points), shown.picks / (shown.height * points)
    for row in range(shown.height):
        for column in range(shown.width):
            total = 0.0
            for j in range(points):
                for k in range(points):
                    x, y = (column * points + k + 0.5) * dx, (row * points + j + 0.5) * dy
                    total += _at(field, table, azimuths, x, y)
            lit[row, column] = total / (points * points)
    return lit


@kernel
def _at(field: HeightField, table: _HorizonMap, azimuths: Float64, x: float, y: float) -> float:
    """Return the share of the light that reaches a point seen from above, 0 in gaps."""
    picks, ends = field.top.shape
    x, y = x % ends, y % picks
    end, pick = min(int(x), ends - 1), min(int(y), picks - 1)
    family, side, _, nx, ny, nz, _, _, _ = surface_at(field, x, y, end, pick)
    if family == GAP:
        return 0.0
    across, along = (x - end, y - pick) if family == WARP else (y - pick, x - end)
    slot = 0
    if side != TOP:
        margin = 0.5 - field.yarn[1 - family, RADIUS]
        slot = 1 if along < 0.5 else 2
        along = min(along, 1.0 - along) / margin if slot == 1 else 1.0 - (1.0 - along) / margin
    angle = math.asin(min(max((across - 0.5) / field.yarn[family, RADIUS], -1.0), 1.0)) / math.pi + 0.5
    column, of_column = _between(angle, table.grid)
    line, of_line = _between(along, table.grid)
    start = table.blocks[(pick * ends + end) * _SLOTS + slot]
    total = 0.0
    for a in range(len(azimuths)):
        low = start + (a * table.grid + line) * table.grid + column
        high = low + table.grid
        below = (1.0 - of_column) * table.horizon[low] + of_column * table.horizon[low + 1]
        above = (1.0 - of_column) * table.horizon[high] + of_column * table.horizon[high + 1]
        sine = (1.0 - of_line) * below + of_line * above
        towards = nx * azimuths[a, 0] + ny * azimuths[a, 1]
        sine = min(max(sine, 0.0, -towards / math.sqrt(towards * towards + nz * nz)), 1.0)
        cosine = math.sqrt(1.0 - sine * sine)
        total += nz * cosine * cosine + towards * (math.acos(sine) - sine * cosine)
    return total / len(azimuths)


@kernel
def _between(share: float, count: int) -> tuple[int, float]:
    """Return the node below a place from 0 to 1, and the place from it to the next; ends go on straight."""
    place = share * count - 0.5
    low = min(max(int(place), 0), count - 2)
    return low, place - low
