"""The table of a cloth: fixed nodes for wide footprints, grids of horizons for narrow ones.

    wide     The nodes of every group are fixed. A node has the mean and spread of its horizon for some azimuths, over
             the box of the node and over all cells of its group: a light reaches it by a ramp, not a step. What a
             viewer sees of its box is tabulated (seen_areas).
    narrow   Nodes are placed on lines of view rays; a light's horizons are read from a grid of the piece.

Nodes come in blocks of BLOCK_NODES, the width of vector units. Horizons are sines of elevation, compared with the z of
a direction; azimuths are even in the diamond angle, which needs no arc tangent. Grids hold 8 bits a value; the more
different pieces there are, the coarser they are, so that a table stays near a megabyte.
"""

from functools import lru_cache
from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt

from pipeline.analytic.gauss_rules import grid_middles
from pipeline.analytic.soft_horizons import AZIMUTHS, CURVATURES, FALL, from_even, over_boxes
from pipeline.analytic.soft_nodes.groups import COLUMNS, DETAILS, FLAT, USUAL, PieceGroup, gather, piece_rows
from pipeline.analytic.soft_nodes.seen_areas import SEEN_ANGLES, Sample, heights, rays_left, seen_areas
from pipeline.compiled.arrays import Float32, Float64, Index, Mask
from pipeline.truth.cloth import ClothSide, cloth_side
from pipeline.truth.geometry.heightfield import GAP, RADIUS, WARP, WEFT, HeightField
from pipeline.truth.geometry.horizon import horizon_sines, horizons
from pipeline.truth.geometry.pieces import CellPiece, cell_pieces, longest_period, orbits
from pipeline.truth.options import TruthOptions
from weaves.fabric import Fabric

BLOCK_NODES: Final = 16  # numbers in single precision that the widest vector units take at a time

LEVELS: Final = 255.0  # largest value of a grid, for a horizon straight above

UPPER: Final = np.float32(4e-3)
"""Cells of a grid: a place so near below the border of two belongs to the upper one. The middle of a piece is such a
border and often a node; how a processor rounds must not decide."""

_GRID_BYTES = 1 << 20
_GRIDS = (48, 32, 24, 16, 12, 8, 6, 4)  # cells of a grid, along each axis
EVEN: Final = 0.42  # of the longest period: deviation from which on a Gaussian covers the cloth evenly, to 3 %

_SHARPEST, _FLATTEST = 0.02, 0.5  # least spread of a horizon, least sharpness of a ramp
_LEAST_AREA = 1e-9  # of a node's box, of which walls are a share
_DARK_BESIDE_GAPS = 0.5  # share of walls that light from behind does not reach, if yarns leave gaps (measured)

# Columns of `SoftNodeTable.groups`.
START, LINES, GROUP_FAMILY = range(3)
# Columns of `SoftNodeTable.pieces` and of `SoftNodeTable.bounds`.
FAMILY, BLOCK = range(2)
X_LOW, X_HIGH, Y_LOW, Y_HIGH, SHIFT, CURVE, BOUND = range(7)


class SoftNodeTable(NamedTuple):
    """A cloth's nodes and grids."""

    repeat: Index  # ends and picks, (2,)
    yarn: Float32  # `HeightField.yarn`, (2, 8)
    thickness: np.float32  # optical thickness T
    uniform: float  # deviation from which on a Gaussian covers the cloth evenly
    starts: Index
    """First block of the nodes of each kind of yarn, and of gaps; their end, (K + 2,). Kinds are warps and wefts,
    K = 2, or all ends, then all picks."""
    kinds: Index  # kinds of warps, kinds of wefts: 1 and 1, or ends and picks, (2,)
    nodes: Float32  # see `surface`, (B, ROWS, BLOCK_NODES)
    evenly: Float32  # share of the cloth's area that a node represents, (B, BLOCK_NODES)
    mean: Float32
    sharpness: Float32
    """Mean of the horizon, and 1 over the width of its ramp, sqrt 12 standard deviations,
    (AZIMUTHS, B, BLOCK_NODES)."""
    groups: npt.NDArray[np.uint32]  # first node, lines of nodes, family, uint32 (K, 3)
    group_starts: npt.NDArray[np.uint32]
    cell_groups: npt.NDArray[np.uint32]
    """The groups in cell c = pick ends + end are cell_groups[group_starts[c] : group_starts[c + 1]], uint32."""
    piece_starts: Index  # the pieces of cell c are those from piece_starts[c] to piece_starts[c + 1]
    pieces: Index  # family, grid, (P, 2)
    bounds: Float32
    """Extent in x and y within the cell; offset, curve (negative beneath) and largest sine of the inclination,
    (P, 7)."""
    floats: Float64  # row of `HeightField.floats`, (P, 4)
    crowns: Float64  # greatest height of its cell, (P,)
    grid: npt.NDArray[np.uint8]
    """Horizons; cells are even in v across a yarn, uint8 (grids, AZIMUTHS, cells along y, cells along x)."""
    behind_mean: Float32
    behind_sharpness: Float32
    behind_grid: npt.NDArray[np.uint8]
    """The same of the back at the same places, its tangent planes included: above them it sees light from behind. The
    middles are those of `_ramps`. Of no nodes and no grids if the table was built without."""
    falls: Float32
    grid_falls: npt.NDArray[np.uint8]
    """Falls of `mean` and `grid` over curved cloth, as shares (curved_horizons); of no curvatures if the table was
    built without, float32 (curvatures, AZIMUTHS, B, BLOCK_NODES), uint8 (curvatures, …)."""
    heights: Float64  # `HeightField.yarn` in double precision, in which heights are found, (2, 8)
    highest: float
    lowest: float
    plane: float
    """Those of the height field, and the height of the reference plane."""
    spots: Float32
    """Of every line of nodes: places in x and y from the corner of the cell, shares of the cell, heights,
    (lines, 4, COLUMNS)."""
    shown: Float32  # least and greatest of these heights, (2,)
    areas: Float32  # area that a viewer sees of each node's box (seen_areas), (AZIMUTHS, SEEN_ANGLES, B, BLOCK_NODES)
    end_walls: npt.NDArray[np.uint8]
    """Share of that area which is a wall that no light from behind reaches, of LEVELS; of no azimuths without light
    from behind or without rims, uint8 (AZIMUTHS, …)."""
    view_lines: float  # deviation below which a footprint places its nodes on lines; 0: none does
    spacing: float  # distance of lines and of their nodes, as a multiple of that at level 2
    rims: bool  # true if view rays that meet a wall see the yarn's rim above it


def tabulate(
    fabric: Fabric, by_thread: bool = False, behind: bool = False, level: int = USUAL, curved: bool = False,
    rims: bool = True,
) -> SoftNodeTable:  # fmt: skip
    """Build the table of a fabric's front, as the default model of the truth sees it.

    With `by_thread` every end and pick of the repeat has nodes of its own. With `behind` it knows light from behind,
    with `curved` cloth that is curved towards the viewer. `level` is one of DETAILS. With `rims` view rays that meet a
    wall see the rim above it.
    """
    detail, model, layout = DETAILS[level], cloth_side(fabric, TruthOptions()), _lay_out(fabric, by_thread, level, rims)
    front, located, numbered, (picks, ends) = model.front, layout.located, layout.numbered, model.front.top.shape
    stop = layout.evenly.size
    grid, grid_falls, behind_grid = _horizon_grids(fabric, layout.size, behind, curved)

    nodes, mean, variance = np.tile(FLAT[:, None], stop), np.zeros((AZIMUTHS, stop)), np.ones((AZIMUTHS, stop))
    behind_mean, behind_variance = (part[:, : stop if behind else 0].copy() for part in (mean, variance))
    falls = np.zeros((len(grid_falls), AZIMUTHS, stop))
    for group, start in numbered:
        indices, (across, along) = _node_indices(group, start), group.rules
        nodes[:, indices] = piece_rows(front.yarn, group.piece, across, along)
        mean[:, indices], variance[:, indices] = _soft_horizons(group, grid)
        for of_nodes, of_grid in zip(falls, grid_falls, strict=True):
            of_nodes[:, indices], _ = _soft_horizons(group, of_grid)
        if behind:
            behind_mean[:, indices], behind_variance[:, indices] = _soft_horizons(group, behind_grid)
    behind_mean, behind_sharpness = _ramps(behind_mean, behind_variance)
    cell_groups: list[list[int]] = [[] for _ in range(ends * picks)]
    for index, (group, _) in enumerate(numbered):
        for end, pick in group.cells:
            cell_groups[pick * ends + end].append(index)

    spots = _spots(front, numbered, stop)
    shown = spots[:, 3][spots[:, 2] > 0.0]
    return SoftNodeTable(
        repeat=np.array([ends, picks], np.int64),
        yarn=np.ascontiguousarray(front.yarn, np.float32),
        thickness=np.float32(front.thickness),
        uniform=EVEN * (max(ends, picks) if by_thread else longest_period(front)),
        starts=np.array(layout.starts, np.int64),
        kinds=np.array((ends, picks) if by_thread else (1, 1), np.int64),
        nodes=np.ascontiguousarray(_in_blocks(nodes).transpose(1, 0, 2)),
        evenly=layout.evenly,
        mean=_in_blocks(mean),
        sharpness=_in_blocks(_sharpness(variance)),
        groups=np.array([(k, group.lines, group.piece.family) for group, k in numbered], np.uint32),
        group_starts=np.concatenate([[0], np.cumsum([len(found) for found in cell_groups])]).astype(np.uint32),
        cell_groups=np.array([index for found in cell_groups for index in found], np.uint32),
        **_piece_columns(located),
        grid=grid,
        behind_mean=_in_blocks(behind_mean),
        behind_sharpness=_in_blocks(behind_sharpness),
        behind_grid=behind_grid,
        falls=_in_blocks(falls),
        grid_falls=grid_falls,
        floats=np.array([front.floats[pick, end, piece.side] for (end, pick), piece, _ in located.pieces]),
        crowns=np.array([front.crown[pick, end] for (end, pick), _, _ in located.pieces]),
        heights=front.yarn, highest=front.highest, lowest=front.lowest, plane=model.plane,
        spots=spots,
        shown=np.array([shown.min(), shown.max()], np.float32),
        areas=layout.areas,
        end_walls=layout.end_walls if behind and rims else layout.end_walls[:0].copy(),
        view_lines=detail.lines, spacing=detail.spacing, rims=rims,
    )  # fmt: skip


@lru_cache(maxsize=4)  # most of the time of a table; tables of all levels have the same
def _horizon_grids(
    fabric: Fabric, size: int, behind: bool, curved: bool
) -> tuple[npt.NDArray[np.uint8], npt.NDArray[np.uint8], npt.NDArray[np.uint8]]:
    """Return grids of horizons, their falls over curved cloth, and those of the back, empty if not wanted."""
    model = cloth_side(fabric, TruthOptions())
    x, y, gap = _grid_places(_locate(model.front).samples, size)
    sines = horizon_sines(model.front, model.back, x, y, gap, 2 * AZIMUTHS)
    grid = _grids(sines, size)
    grid_falls = np.zeros((len(CURVATURES) if curved else 0, *grid.shape), np.uint8)
    for own, curvature in zip(grid_falls, CURVATURES, strict=False):
        bent = horizon_sines(model.front, model.back, x, y, gap, 2 * AZIMUTHS, curvature)
        own[:] = _grids(np.clip((sines - bent) / (FALL * curvature), 0.0, 1.0), size)
    behind_grid = grid[:0]
    if behind:
        slopes = horizons(model.back, x, y, 2 * AZIMUTHS, True).astype(np.float64)
        behind_grid = _grids(slopes / np.sqrt(1.0 + slopes * slopes), size)
    return grid, grid_falls, behind_grid


def _areas(
    front: HeightField, samples: list[Sample], grid: npt.NDArray[np.uint8], numbered: list[tuple[PieceGroup, int]],
    evenly: Float64, gaps: int, rims: bool,
) -> tuple[Float64, Float64]:  # fmt: skip
    """Return the area that a viewer sees of each node's box, and the share of it that are walls, of LEVELS.

    Groups come with their first node; nodes from `gaps` on are gaps.
    """
    areas, ends = np.zeros((2, AZIMUTHS, SEEN_ANGLES, len(evenly)))
    of_groups = seen_areas(front, samples, grid, [group for group, _ in numbered], rims)
    for (group, first), own in zip(numbered, of_groups, strict=True):
        indices = _node_indices(group, first)
        areas[..., indices], ends[..., indices] = own
    dark = LEVELS * (1.0 if front.yarn[:, RADIUS].min() >= 0.5 else _DARK_BESIDE_GAPS)
    shares = np.rint(dark * ends / np.maximum(areas, _LEAST_AREA))
    if rims:
        areas[..., :gaps] *= rays_left(areas * evenly, gaps)[..., None]
    return areas, shares


def _node_indices(group: PieceGroup, first: int) -> Index:
    """Return which nodes are those of a group, given its first one."""
    return (first + np.arange(group.nodes)).reshape(group.lines, COLUMNS)[:, : len(group.rules[0].places)].ravel()


def _spots(front: HeightField, numbered: list[tuple[PieceGroup, int]], stop: int) -> Float32:
    """Return place in the cell, share of the cell and height of all nodes, (lines, 4, COLUMNS)."""
    spots = np.zeros((stop // COLUMNS, 4, COLUMNS), np.float32)
    for group, first in numbered:
        (across, along), (end, pick), piece = group.rules, group.cells[0], group.piece
        own = spots[first // COLUMNS :][: group.lines]
        own, extents = own[:, :, : len(across.places)], (across.places, along.places[:, None])
        own[:, 0], own[:, 1] = extents if piece.family != WEFT else extents[::-1]
        own[:, 2] = np.outer(along.weights, across.weights)
        if piece.family != GAP:
            own[:, 3] = heights(front, pick, end, piece.family, piece.side, across.places, along.places)
    return spots


def _in_blocks(values: Float64) -> Float32:
    """Return numbers of nodes, (..., nodes), by blocks."""
    blocks = values.shape[-1] // BLOCK_NODES
    return np.ascontiguousarray(values.reshape(*values.shape[:-1], blocks, BLOCK_NODES), np.float32)


def tabulate_pieces(model: ClothSide, size: int) -> dict[str, Any]:
    """Return the columns of `SoftNodeTable` about pieces of one side of a cloth, the grid flat, `size` cells a side."""
    located = _locate(model.front)
    x, y, gap = _grid_places(located.samples, size)
    grid = _grids(horizon_sines(model.front, model.back, x, y, gap, 2 * AZIMUTHS), size)
    return _piece_columns(located) | {"grid": grid.ravel()}


class _Located(NamedTuple):
    """The pieces of all cells, with their cell and their grid; where those of each cell begin; one piece a grid."""

    pieces: list[tuple[tuple[int, int], CellPiece, int]]
    starts: list[int]
    samples: list[Sample]


def _locate(front: HeightField) -> _Located:
    """Return all pieces; those that a translation of the cloth carries into one another share a grid."""
    first_of = {cell: orbit[0] for orbit in orbits(front) for cell in orbit}
    blocks: dict[tuple[tuple[int, int], int], int] = {}
    found = _Located([], [0], [])
    for pick, end in np.ndindex(*front.top.shape):
        for index, piece in enumerate(cell_pieces(front, pick, end)):
            key = (first_of[pick, end], index)
            if key not in blocks:
                blocks[key] = len(blocks)
                found.samples.append((*key[0], piece))
            found.pieces.append(((end, pick), piece, blocks[key]))
        found.starts.append(len(found.pieces))
    return found


class _Layout(NamedTuple):
    """The nodes of all groups, each kind in whole blocks, and what a viewer sees of them."""

    located: _Located
    size: int  # of grids
    numbered: list[tuple[PieceGroup, int]]  # groups, each with its first node
    starts: list[int]  # as in SoftNodeTable
    evenly: Float32
    areas: Float32
    end_walls: npt.NDArray[np.uint8]
    """As in SoftNodeTable; the walls also where the table has none."""


@lru_cache(maxsize=len(DETAILS))  # tables of light from behind and of curved cloth have the same
def _lay_out(fabric: Fabric, by_thread: bool, level: int, rims: bool) -> _Layout:
    front = cloth_side(fabric, TruthOptions()).front
    located, (picks, ends) = _locate(front), front.top.shape
    size = next((n for n in _GRIDS if len(located.samples) * AZIMUTHS * n * n <= _GRID_BYTES), _GRIDS[-1])
    groups, numbered, starts, stop = gather(located.pieces, DETAILS[level], by_thread), [], [], 0
    kinds = (ends, picks) if by_thread else (1, 1)
    for kind in (*((WARP, end) for end in range(kinds[0])), *((WEFT, pick) for pick in range(kinds[1])), (GAP, 0)):
        starts.append(stop // BLOCK_NODES)
        for group in groups:
            if (group.piece.family, group.thread) == kind:
                numbered.append((group, stop))
                stop += group.nodes
        stop += -stop % BLOCK_NODES
    starts.append(stop // BLOCK_NODES)
    evenly = np.zeros(stop)
    for group, start in numbered:
        across, along = group.rules
        shares = np.outer(along.weights, across.weights) * len(group.cells) / (ends * picks)
        evenly[_node_indices(group, start)] = shares.ravel()
    grid, _, _ = _horizon_grids(fabric, size, False, False)
    areas, walls = _areas(front, located.samples, grid, numbered, evenly, starts[-2] * BLOCK_NODES, rims)
    of_blocks = (_in_blocks(evenly), _in_blocks(areas), _in_blocks(walls).astype(np.uint8))
    return _Layout(located, size, numbered, starts, *of_blocks)


def _piece_columns(located: _Located) -> dict[str, Any]:
    """Return the columns of `SoftNodeTable` about pieces."""
    bounds = [(*p.box[0], *p.box[1], p.offset, p.sign * p.curve, p.steepest) for _, p, _ in located.pieces]
    return {
        "piece_starts": np.array(located.starts, np.int64),
        "pieces": np.array([(piece.family, block) for _, piece, block in located.pieces], np.int64),
        "bounds": np.array(bounds, np.float32),
    }


def _sharpness(variance: Float64) -> Float64:
    """Return 1 over the width of the ramp of a horizon."""
    return np.asarray(1.0 / np.sqrt(12.0 * (variance + _SHARPEST**2)))


def _ramps(mean: Float64, variance: Float64) -> tuple[Float64, Float64]:
    """Return middle and sharpness of ramps clip(1/2 + (z - middle) sharpness, 0, 1), z from 0 to 1, of horizons s.

    Many horizons of the back are 1. Ramps of their mean and variance would end beyond z = 1, and light too much. These
    have the integrals that V(z) = P(s < z) has: of V 1 - E[s], of z V (1 - E[s^2]) / 2.
    """
    # The ramp of 1 - s is the mirror image: only the nearer end of 0 to 1 is to be looked at.
    near, lit = np.clip(np.minimum(mean, 1.0 - mean), _LEAST_AREA, None), 1.0 - mean**2 - variance
    # A ramp that leaves that end alone begins `reach` before it; one that leaves both is a line, 0 up to `start`.
    reach, inside = 1.5 * (near + variance / near), np.sqrt(3.0 * variance) <= near
    line, slope = reach > 1.0, np.maximum(6.0 * (mean - 1.0 + lit), _FLATTEST)
    steep = np.minimum(2.0 * near / reach**2, _sharpness(np.zeros(1)))
    sharpness = np.where(inside, _sharpness(variance), np.where(line, slope, steep))
    middle = np.where(inside, near, reach - 0.5 / sharpness)
    start = 2.0 * np.cos((np.arccos(np.clip(1.5 * lit / slope - 1.0, -1.0, 0.0)) - 2.0 * np.pi) / 3.0)
    of_line = np.where(1.5 * lit < slope, start, 2.0 / 3.0 - lit / slope) + 0.5 / slope
    return np.where(line & ~inside, of_line, np.where(mean > 0.5, 1.0 - middle, middle)), sharpness


def _grid_places(samples: list[Sample], size: int) -> tuple[Float64, Float64, Mask]:
    """Return the middles of the cells of all grids of pieces, given with pick and end, and which lie in gaps."""
    xs, ys, gaps = [], [], []
    for pick, end, piece in samples:
        x, y = (grid_middles(*extent, size, radius) for extent, radius in zip(piece.box, piece.radii, strict=True))
        xs.append(np.tile(end + x, size))
        ys.append(np.repeat(pick + y, size))
        gaps.append(np.full(size * size, piece.family == GAP))
    return np.concatenate(xs), np.concatenate(ys), np.concatenate(gaps)


def _grids(sines: Float64, size: int) -> npt.NDArray[np.uint8]:
    """Return grids from the sines of horizons at azimuths even in the angle."""
    grids = from_even(sines).reshape(AZIMUTHS, -1, size, size).transpose(1, 0, 2, 3)
    return np.ascontiguousarray(np.rint(LEVELS * grids), np.uint8)


def _soft_horizons(group: PieceGroup, grid: npt.NDArray[np.uint8]) -> tuple[Float64, Float64]:
    """Return mean and variance of the horizon over each node's box and all cells of a group, (AZIMUTHS, nodes)."""
    of_across, of_along = group.overlaps(grid.shape[-1])
    blocks, counts = np.unique(group.blocks, return_counts=True)
    values = (grid[blocks].transpose(0, 1, 3, 2) if group.piece.family == WEFT else grid[blocks]) / LEVELS
    share = (counts / counts.sum())[:, None, None, None]
    return over_boxes((share * values).sum(axis=0), (share * values**2).sum(axis=0), of_along, of_across)
