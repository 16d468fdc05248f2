"""One query as the sums take it, and their scratch memory, made once for all queries of a call."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from pipeline.analytic.soft_nodes.groups import COLUMNS
from pipeline.analytic.soft_nodes.nodes import BLOCK_NODES, SoftNodeTable
from pipeline.analytic.soft_nodes.shade import BLOCK_ROWS
from pipeline.analytic.soft_nodes.waves import HIGHEST, TOGETHER
from pipeline.compiled.arrays import Float32, Float64, Index, Mask
from pipeline.compiled.decorators import allocating_kernel
from pipeline.truth.footprint.mixture import COARSE_LINE


class SoftQuery(NamedTuple):
    """A query.

    Attributes
    ----------
    x, y : float64
        Centre of the footprint, within the repeat.
    dx, dy, rho, narrowest : float32
        Deviations along x and y in yarn spacings, correlation of the axes, and the least deviation of any direction.
    ix, iy, iz, ox, oy, oz : float32
        wi and wo.
    low_i, high_i, turn_i, low_o, high_o, turn_o
        Azimuths around wi and wo, and where between them these lie.
    bend_i, bend_o : float32
        Curvatures of the cloth towards wi and wo, 1/yarn spacings.
    """

    x: float
    y: float
    dx: np.float32
    dy: np.float32
    rho: np.float32
    narrowest: np.float32
    ix: np.float32
    iy: np.float32
    iz: np.float32
    ox: np.float32
    oy: np.float32
    oz: np.float32
    low_i: int
    high_i: int
    turn_i: np.float32
    low_o: int
    high_o: int
    turn_o: np.float32
    bend_i: np.float32
    bend_o: np.float32


TURN_ROWS: Final = 4
"""Rows of `Scratch.turns`: cosines and sines of whole turns of x, then of y."""

LINE_ROWS: Final = 9
"""Rows of `Scratch.line`."""

DRAFT_ROWS: Final = 15
"""Rows of `Scratch.drafts`, see `line_nodes`."""

MOST_ON_LINES: Final = 2048
"""Most nodes of a kind of yarn on view lines."""

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
    nodes : float32 (K, BLOCK_ROWS, most)
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
    view_lines : float64 (2, lines)
        Places of view lines across the viewer's azimuth, and the widths that they stand for.
    drafts, firsts : float32 (K, DRAFT_ROWS, MOST_ON_LINES), uint32 (K, MOST_ON_LINES)
        Nodes on view lines, and the first cells of their grids.
    seen : float32 (lines, 2, COLUMNS)
        Where the viewer sees the fixed nodes, in x and in y.
    areas, freed : float32 (B, BLOCK_NODES)
        Area seen of the boxes of the fixed nodes, and by how much more of them is seen over curved cloth.
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
    view_lines: Float64
    drafts: Float32
    firsts: npt.NDArray[np.uint32]
    seen: Float32
    areas: Float32
    freed: Float32


@allocating_kernel
def scratch_for(table: SoftNodeTable, most: int) -> Scratch:
    """Return what the queries of a call need; `most` is the largest number of nodes placed in a footprint."""
    kinds = table.kinds[0] + table.kinds[1]
    ends, picks, fixed = table.repeat[0], table.repeat[1], table.starts[kinds + 1]
    room = most + 2 * BLOCK_NODES
    on_lines = MOST_ON_LINES if table.parallax else 0
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
        np.empty((kinds, BLOCK_ROWS, room), np.float32),
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
        np.empty((2, 512)),
        np.empty((kinds, DRAFT_ROWS, on_lines), np.float32),
        np.empty((kinds, on_lines), np.uint32),
        np.empty((len(table.spots), 2, COLUMNS), np.float32),
        np.zeros((fixed if table.parallax else 0, BLOCK_NODES), np.float32),
        np.zeros((fixed if table.parallax else 0, BLOCK_NODES), np.float32),
    )
