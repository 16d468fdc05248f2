"""Scratch memory of the sums of one query, made once for all queries of a call."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from pipeline.analytic.soft_nodes.groups import COLUMNS
from pipeline.analytic.soft_nodes.nodes import BLOCK_NODES, Table
from pipeline.analytic.soft_nodes.shade import ROWS
from pipeline.analytic.soft_nodes.waves import HIGHEST, TOGETHER
from pipeline.compiled.arrays import Float32, Index, Mask
from pipeline.compiled.decorators import allocating_kernel
from pipeline.truth.footprint.mixture import COARSE_LINE

TURN_ROWS: Final = 4
"""Rows of `Scratch.turns`: cosines and sines of whole turns of x, then of y."""

LINE_ROWS: Final = 9
"""Rows of `Scratch.line`."""

_POINTS = COARSE_LINE.points


class Scratch(NamedTuple):
    """Arrays that each query overwrites.

    Attributes
    ----------
    weight, lines : float32 (B, BLOCK_NODES), (lines, COLUMNS)
        Weights of the fixed nodes, as blocks and as lines of one array.
    turns, phases : float32 (TURN_ROWS, HIGHEST + 1), (H / TOGETHER, 2 TOGETHER)
        See `wave_weights`.
    density_x, touched_x, columns, density_y, touched_y, rows
        Densities along both axes, which cells they touch, and the list of these.
    line_places, line_shares : float32 (points,)
        Points of the line of a mixture.
    nodes : float32 (K, ROWS, most)
        Nodes placed in the footprint, for each kind of yarn.
    cells : uint32 (K, most)
        Cells of the grids for these.
    stops : int64 (K,)
        Number of them.
    line, offsets : float32 (LINE_ROWS, 8), uint32 (8,)
        See `place_nodes`.
    grid, behind_grid, grid_falls : uint8
        Those of the table, flat.
    curved : float32 (2, B, BLOCK_NODES)
        Horizons of the fixed nodes towards light and viewer, over curved cloth.
    curved_narrow : float32 (2 most,)
        The same of nodes placed in the footprint, of one kind of yarn; levels.
    order : uint32 (most,)
        Numbers from 0 on.
    """

    weight: Float32
    lines: Float32
    turns: Float32
    phases: Float32
    density_x: Float32
    touched_x: Mask
    columns: npt.NDArray[np.uint32]
    density_y: Float32
    touched_y: Mask
    rows: npt.NDArray[np.uint32]
    line_places: Float32
    line_shares: Float32
    nodes: Float32
    cells: npt.NDArray[np.uint32]
    stops: Index
    line: Float32
    offsets: npt.NDArray[np.uint32]
    grid: npt.NDArray[np.uint8]
    behind_grid: npt.NDArray[np.uint8]
    grid_falls: npt.NDArray[np.uint8]
    curved: Float32
    curved_narrow: Float32
    order: npt.NDArray[np.uint32]


@allocating_kernel
def scratch_for(table: Table, most: int) -> Scratch:
    """Return what the queries of a call need; `most` is the largest number of nodes placed in a footprint."""
    kinds = table.kinds[0] + table.kinds[1]
    ends, picks, fixed = table.repeat[0], table.repeat[1], table.starts[kinds + 1]
    room = most + 2 * BLOCK_NODES
    weight = np.zeros((fixed, BLOCK_NODES), np.float32)
    return Scratch(
        weight,
        weight.reshape(fixed * BLOCK_NODES // COLUMNS, COLUMNS),
        np.zeros((TURN_ROWS, HIGHEST + 1), np.float32),
        np.zeros((len(table.waves) // TOGETHER, 2 * TOGETHER), np.float32),
        np.zeros((ends, len(table.places_x)), np.float32),
        np.zeros(ends, np.bool_),
        np.zeros(ends, np.uint32),
        np.zeros((picks, len(table.places_y)), np.float32),
        np.zeros(picks, np.bool_),
        np.zeros(picks, np.uint32),
        np.zeros(_POINTS, np.float32),
        np.zeros(_POINTS, np.float32),
        np.empty((kinds, ROWS, room), np.float32),
        np.empty((kinds, room), np.uint32),
        np.zeros(kinds, np.int64),
        np.zeros((LINE_ROWS, 8), np.float32),
        np.zeros(8, np.uint32),
        table.grid.reshape(table.grid.size),
        table.behind_grid.reshape(table.behind_grid.size),
        table.grid_falls.reshape(len(table.grid_falls), table.grid.size if len(table.grid_falls) else 0),
        np.zeros((2, fixed, BLOCK_NODES), np.float32),
        np.zeros(2 * room, np.float32),
        np.arange(room).astype(np.uint32),
    )
