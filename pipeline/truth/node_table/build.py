"""A table of nodes with horizons over one repeat: a query is a sum over some thousand nodes.

A cloth whose draft maps onto itself under a translation needs one cell of each orbit only: an 8-end satin is 8 cells,
not 64. Every piece of yarn seen from above in such a cell is a tensor grid of nodes, x = r sin v across the yarn with v
evenly spaced, evenly spaced along it. A node holds normal, tangent, and for each azimuth the slope of its horizon.
Where a highlight is narrower than a node, finer nodes resolve it.
"""

import math
from typing import NamedTuple

import numpy as np

from pipeline.compiled.arrays import Float32, Float64, Index
from pipeline.compiled.decorators import allocating_kernel
from pipeline.truth.geometry import heightfield
from pipeline.truth.geometry.heightfield import GAP, RADIUS, TOP, UNDER, WARP, WEFT, HeightField
from pipeline.truth.geometry.horizon import horizons
from pipeline.truth.geometry.pieces import cell_pieces, lattice, longest_period, orbits
from pipeline.truth.node_table.walls import Edges, Grid, WallNodes, no_walls, wall_nodes

_RESOLVED = 1.2  # nodes a half-width of a highlight: sums of it are then right to 1e-3
_FINEST = 16
_SIDE = 0.25  # share of a node by which the last one along a yarn is cut in two
_FADED = math.sqrt(math.log(5e4) / 2.0) / math.pi  # times the shortest period: a Gaussian whose waves are below 2e-5

# Columns of `ExactNodes.pieces`.
FIRST_NODE, NODES_X, NODES_Y, EDGES_X, EDGES_Y, PIECE_FAMILY, FIRST_FINE, FINE_COUNT = range(8)


class ExactNodes(NamedTuple):
    """Nodes of one side of a cloth."""

    repeat: Index  # ends and picks, (2,)
    pieces: Index
    """First node, nodes along x and along y, which edges along x and along y, family (or GAP), first fine node, fine
    nodes a node, (P, 8)."""
    copies: Index  # end and pick of the cells in which a piece lies, (P, C, 2)
    edges: Float32  # borders of nodes within their cell; shorter rows repeat their last value, (E, n + 1)
    evenly: Float32  # share of a node and its copies in the cloth's area, (N,)
    normal: Float32  # normal of each node, and 1 / n_z; rows x, y, z, 1 / z, (4, N)
    fine: Float32
    """The same for the finer nodes, then the tangent, (7, F). Within a piece, first all nodes' first ones."""
    slope: Float32  # slope of the horizon, (A, N)
    slope_behind: Float32  # the same at the back of the cloth; no rows if there is no need for them, (A, N)
    uniform: float  # standard deviation from which on a Gaussian covers the cloth evenly
    lattice: tuple[int, int, int]  # translations of the cloth (`pipeline.truth.geometry.pieces.lattice`)
    places: Float32  # where each node is in the repeat, and its height; that of a gap is 0, (3, N)
    walls: WallNodes  # walls below the borders of yarns, if view rays see rims


def tabulate(
    front: HeightField, back: HeightField, behind: bool, nodes: int, azimuths: int, rims: bool = False
) -> ExactNodes:
    """Build the table of one side of a cloth, with so many `nodes` per yarn spacing, across and along.

    `behind` says whether there may be light from behind; cloth with gaps has horizons at its back in any case. With
    `rims` it has walls.
    """
    picks, ends = front.top.shape
    alike = orbits(front)
    kinds: dict[Edges, int] = {}
    rows, copies, grids, at, areas = [], [], [], [], []
    start, fine_start = 0, 0
    for orbit in alike:
        pick, end = orbit[0]
        for family, x_edges, y_edges in _pieces(front, pick, end, nodes):
            columns, lines = len(x_edges) - 1, len(y_edges) - 1
            finer = (1, 1) if family == GAP else _finer(front, family, pick, end, columns, lines)
            kind_x, kind_y = (kinds.setdefault(edges, len(kinds)) for edges in (x_edges, y_edges))
            rows.append((start, columns, lines, kind_x, kind_y, family, fine_start, finer[0] * finer[1]))
            copies.append([(e, p) for p, e in orbit])
            grids.append((end, pick, family, x_edges, y_edges))
            at.append((*_positions(front, grids[-1], (1, 1)), *_positions(front, grids[-1], finer)))
            areas.append(np.outer(np.diff(y_edges), np.diff(x_edges)).ravel() * len(orbit))
            start += columns * lines
            fine_start += columns * lines * finer[0] * finer[1]

    x, y, fine_x, fine_y = (np.concatenate(parts) for parts in zip(*at, strict=True))
    size = max(map(len, kinds))
    slope = horizons(front, x, y, azimuths, False)
    behind = behind or any(family == GAP for _, _, family, *_ in grids)
    slope_behind = horizons(back, x, y, azimuths, True) if behind else np.zeros((0, len(x)), np.float32)
    surface = _surface(front, x, y)
    return ExactNodes(
        repeat=np.array([ends, picks], np.int64),
        pieces=np.array(rows, np.int64),
        copies=np.array(copies, np.int64),
        edges=np.array([edges + (edges[-1],) * (size - len(edges)) for edges in kinds], np.float32),
        evenly=(np.concatenate(areas) / (ends * picks)).astype(np.float32),
        normal=surface[:4],
        fine=_surface(front, fine_x, fine_y)[:7],
        slope=slope,
        slope_behind=slope_behind,
        uniform=_FADED * longest_period(front),
        lattice=lattice(front),
        places=np.array([x, y, surface[7]], np.float32),
        walls=wall_nodes(front, back, grids, len(alike[0]), behind, azimuths) if rims else no_walls(),
    )


def _pieces(field: HeightField, pick: int, end: int, nodes: int) -> list[tuple[int, Edges, Edges]]:
    """Return family, x edges and y edges of everything seen from above in a cell."""
    around = [tuple((0.5 + radius * np.sin(np.linspace(-math.pi / 2, math.pi / 2, nodes + 1))).tolist())
              for radius in field.yarn[:, RADIUS]]  # fmt: skip

    def straight(low: float, high: float) -> Edges:
        return tuple(np.linspace(low, high, max(2, math.ceil(nodes * (high - low))) + 1).tolist())

    def beneath_another(low: float, high: float) -> Edges:
        # The back of the cloth is a yarn across, which turns away from steep light close to its sides only.
        places = straight(low, high)
        step = _SIDE * (places[1] - low)
        return (low, low + step, *places[1:-1], high - step, high)

    # Nodes end where the crossing yarn does: from there on the other side of the cloth is another one.
    gap = max(0.0, 0.5 - float(field.yarn[1 - int(field.top[pick, end]), RADIUS]))
    if gap > 1e-9:
        covered = straight(0.0, gap)[:-1] + beneath_another(gap, 1.0 - gap)[:-1] + straight(1.0 - gap, 1.0)
    else:
        covered = beneath_another(0.0, 1.0)
    found = []
    for piece in cell_pieces(field, pick, end):
        across = straight(*piece.across) if piece.family == GAP else around[piece.family]
        along = covered if piece.side == TOP else straight(*piece.along)
        x, y = (along, across) if piece.family == WEFT else (across, along)
        found.append((piece.family, x, y))
    return found


def _finer(field: HeightField, family: int, pick: int, end: int, columns: int, lines: int) -> tuple[int, int]:
    """Return how many finer nodes, along x and along y, resolve the highlights of a piece."""
    side = TOP if family == field.top[pick, end] else UNDER
    alpha = field.yarn[family, heightfield.ALPHA]
    length = 2.0 * field.floats[pick, end, side, heightfield.HALF_LENGTH]
    across, along = (columns, lines) if family == WARP else (lines, columns)
    turn_along = 2.0 * field.yarn[family, heightfield.BEND] / length / along
    turn_across = math.pi * abs(field.yarn[family, heightfield.SIN_TWIST]) / across
    counts = [min(_FINEST, max(1, math.ceil(_RESOLVED * turn / alpha))) for turn in (turn_across, turn_along)]
    return (counts[0], counts[1]) if family == WARP else (counts[1], counts[0])


def _positions(field: HeightField, grid: Grid, counts: tuple[int, int]) -> tuple[Float64, Float64]:
    """Return x and y of so many even places along x and y in each node of a piece, place by place, row by row."""
    end, pick, family, x_edges, y_edges = grid
    radius = 0.0 if family == GAP else float(field.yarn[family, RADIUS])

    def middles(edges: Edges, count: int, bent: bool) -> Float64:
        # (count, nodes): within each node, `count` evenly spaced places; evenly in v across a yarn.
        places = np.array(edges)
        borders = np.arcsin(np.clip((places - 0.5) / radius, -1.0, 1.0)) if bent else places
        share = (np.arange(count)[:, None] + 0.5) / count
        at = borders[:-1] + share * np.diff(borders)
        return 0.5 + radius * np.sin(at) if bent else at

    xs, ys = end + middles(x_edges, counts[0], family == WARP), pick + middles(y_edges, counts[1], family == WEFT)
    shape = (counts[1], counts[0], ys.shape[1], xs.shape[1])
    return np.broadcast_to(xs[None, :, None, :], shape).ravel(), np.broadcast_to(ys[:, None, :, None], shape).ravel()


@allocating_kernel
def _surface(field: HeightField, x: Float64, y: Float64) -> Float32:
    """Return normal, 1 / n_z, tangent and height at points, (8, N); a gap's normal is +z."""
    found = np.zeros((8, len(x)), np.float32)
    for k in range(len(x)):
        family, _, height, nx, ny, nz, tx, ty, tz = heightfield.surface_at(field, x[k], y[k], int(x[k]), int(y[k]))
        if family == GAP:
            nx, ny, nz = 0.0, 0.0, 1.0
        values = (nx, ny, nz, 1.0 / nz, tx, ty, tz, height)
        for c in range(8):
            found[c, k] = values[c]
    return found
