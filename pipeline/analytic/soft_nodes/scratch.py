"""One query as the sums take it, and their scratch memory, made once for all queries of a call."""

from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from pipeline.analytic.soft_nodes.groups import COLUMNS
from pipeline.analytic.soft_nodes.nodes import BLOCK_NODES, LINES, SoftNodeTable
from pipeline.compiled.arrays import Float32, Float64, Index


class SoftQuery(NamedTuple):
    """A query."""

    x: float
    y: float
    """Centre of the footprint, within the repeat."""
    dx: np.float32
    dy: np.float32
    rho: np.float32
    narrowest: np.float32
    """Deviations along x and y in yarn spacings, correlation of the axes, and the least deviation of any direction."""
    ix: np.float32
    iy: np.float32
    iz: np.float32
    ox: np.float32
    oy: np.float32
    oz: np.float32
    """wi and wo."""
    low_i: int
    high_i: int
    turn_i: np.float32
    low_o: int
    high_o: int
    turn_o: np.float32
    """Azimuths around wi and wo, and where between them these lie."""
    bend_i: np.float32
    bend_o: np.float32
    """Curvatures of the cloth towards wi and wo, 1/yarn spacings."""


DRAFT_ROWS: Final = 15  # rows of `Scratch.drafts`, see `line_nodes`

MOST_ON_LINES: Final = 2048  # most nodes of a kind of yarn on view lines


class Scratch(NamedTuple):
    """Arrays that each query overwrites."""

    weight: Float32
    lines: Float32
    """Weights of the fixed nodes, as blocks and as lines of one array, (B, BLOCK_NODES), (lines, COLUMNS)."""
    stops: Index  # number of nodes on view lines of each kind of yarn, (K,)
    line: Float32  # places and lengths of the nodes of an interval, (2, 8)
    grid: npt.NDArray[np.uint8]
    behind_grid: npt.NDArray[np.uint8]
    grid_falls: npt.NDArray[np.uint8]
    """Those of the table, flat, uint8."""
    curved: Float32  # horizons of the fixed nodes towards light and viewer, over curved cloth, (2, B, BLOCK_NODES)
    view_lines: Float64
    """Places of view lines across the viewer's azimuth, and the widths that they stand for, (2, lines)."""
    drafts: Float32
    firsts: npt.NDArray[np.uint32]
    """Nodes on view lines, and the first cells of their grids, float32 (K, DRAFT_ROWS, MOST_ON_LINES), uint32
    (K, MOST_ON_LINES)."""
    seen: Float32  # where the viewer sees the fixed nodes, in x and in y, (2, nodes)
    across: Float32
    along: Float32
    """Sums of a footprint's density over repeats along x and along y, (ends, nodes), (picks, nodes)."""
    lines_of_cell: float  # mean number of lines of nodes in a cell
    gaps: Float32  # area seen through gaps, and 1 / deviation along lines, of nodes on lines, (2,)
    areas: Float32
    freed: Float32
    walls: Float32
    """Area seen of the boxes of the fixed nodes, by how much more of them is seen over curved cloth, and which share
    of the area are walls that light from behind does not reach, of LEVELS, (B, BLOCK_NODES)."""


def scratch_for(table: SoftNodeTable) -> Scratch:
    """Return what the queries of a call need."""
    kinds, fixed, most = table.kinds.sum(), len(table.evenly), MOST_ON_LINES
    weight, areas, freed, walls = np.zeros((4, fixed, BLOCK_NODES), np.float32)
    across, along = (np.empty((cells, table.evenly.size), np.float32) for cells in table.repeat)
    return Scratch(
        weight, weight.reshape(-1, COLUMNS),
        np.zeros(kinds, np.int64),
        np.zeros((2, 8), np.float32),
        table.grid.ravel(), table.behind_grid.ravel(),
        table.grid_falls.reshape(len(table.grid_falls), table.grid.size if len(table.grid_falls) else 0),
        np.zeros((2, fixed, BLOCK_NODES), np.float32),
        np.empty((2, 512)),
        np.empty((kinds, DRAFT_ROWS, most), np.float32), np.empty((kinds, most), np.uint32),
        np.empty((2, table.evenly.size), np.float32),
        across, along, float(table.groups[table.cell_groups, LINES].sum() / (len(table.group_starts) - 1)),
        np.zeros(2, np.float32), areas, freed, walls,
    )  # fmt: skip
