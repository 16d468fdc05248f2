"""Groups of similar pieces: the pieces of a repeat that share nodes.

Pieces of one shape that lie alike on floats of one length form a group, of one thread alone where sums are wanted by
thread. A yarn may be cut into parts across, each a piece of its own (`Detail.parts`). A draft of many different floats
has too many groups: then the two most alike are merged, again and again (Ward's distance between their inclinations),
until the nodes of all groups are few enough.

The surface at the nodes of a group has normal, tangent, and by how much the tangent turns within a node's box. A
highlight may be narrower than a box: the tangent's change over half a box, along and across the yarn, gives it four
places there, at the points of the Gauss rule (1 / sqrt 3 of half a box). All of it is in the frame of the yarn.
"""

import itertools
import math
from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np

from pipeline.analytic.gauss_rules import Rule, gauss_rule, grid_edges, overlap
from pipeline.analytic.torus_frame import Fibre, bend, normal, tangent, turning
from pipeline.compiled.arrays import Float64
from pipeline.compiled.decorators import fast_kernel
from pipeline.truth.geometry.heightfield import BETA, COS_TWIST, GAP, SIN_TWIST, TOP, UNDER, WARP
from pipeline.truth.geometry.pieces import CellPiece


class Detail(NamedTuple):
    """How fine the nodes of a table are."""

    most: int  # nodes of all groups of pieces on top above which groups are merged; half as many beneath
    along: float  # nodes along a yarn, as a multiple of those at level 2
    parts: int  # parts of a yarn across, each with nodes of its own
    lines: float  # deviation, in yarn spacings, below which a footprint places its nodes, on lines; 0: none does
    spacing: float  # distance of these lines and of their nodes, as a multiple of that at level 2


DETAILS: Final = {
    0: Detail(most=64, along=0.5, parts=1, lines=0.0, spacing=1.8),
    1: Detail(most=64, along=0.5, parts=1, lines=0.25, spacing=1.8),
    2: Detail(most=256, along=1.0, parts=1, lines=0.3, spacing=1.0),
    4: Detail(most=1024, along=1.0, parts=2, lines=0.5, spacing=0.7),
    8: Detail(most=2048, along=2.0, parts=2, lines=0.8, spacing=0.5),
}
"""The details of every level k."""

USUAL: Final = 2  # the level unless another one is named

COLUMNS: Final = 8  # nodes across a yarn: half the width of the vector units

_ALONG = ((1.5, 4), (2.5, 3))  # nodes along a cell of a float shorter than
_LONG = 2  # and of any longer one
_STRIP = 3.0  # nodes a yarn spacing along the visible part of a yarn beneath, and along gaps

Cell = tuple[int, int]


class PieceGroup(NamedTuple):
    """Pieces that share nodes."""

    piece: CellPiece  # the mean of them
    cells: list[Cell]  # cells of the pieces, (end, pick)
    blocks: list[int]  # numbers of their horizons, one for each cell
    thread: int = 0  # the end or pick that they belong to; 0 if groups hold pieces of all threads
    dense: float = 1.0  # nodes along it, as a multiple of those at level 2

    @property
    def lines(self) -> int:
        """Nodes along it."""
        if self.piece.side == UNDER:
            count = math.ceil(_STRIP * (self.piece.along[1] - self.piece.along[0]))
        else:
            count = next((count for length, count in _ALONG if 2.0 * self.piece.half < length), _LONG)
        return max(1, round(self.dense * count))

    @property
    def nodes(self) -> int:
        """Nodes of the group."""
        return COLUMNS * self.lines

    @property
    def rules(self) -> tuple[Rule, Rule]:
        """Its nodes across and along."""
        columns = self.lines if self.piece.family == GAP else COLUMNS
        across = gauss_rule(*self.piece.across, columns, self.piece.radius)
        return across, gauss_rule(*self.piece.along, self.lines, 0.0)

    def overlaps(self, size: int) -> tuple[Float64, Float64]:
        """Return which shares of its nodes' boxes, across and along, lie in each of `size` cells of a grid."""
        piece, (across, along) = self.piece, self.rules
        of_across = overlap(across.borders, grid_edges(*piece.across, size, piece.radius))
        return of_across, overlap(along.borders, grid_edges(*piece.along, size, 0.0))


def gather(pieces: Sequence[tuple[Cell, CellPiece, int]], detail: Detail, by_thread: bool = False) -> list[PieceGroup]:
    """Return the groups of pieces, given with their cell (end, pick) and the name of their horizons.

    Warps come first, then wefts and gaps; with `by_thread` those of each thread follow each other.
    """
    alike: dict[tuple[float | int, ...], PieceGroup] = {}
    for cell, whole, block in pieces:
        thread = cell[whole.family] if by_thread and whole.family != GAP else 0
        for piece in _parts(whole, detail.parts):
            numbers = (*piece.across, *piece.along, piece.offset, piece.curve, piece.half)
            key = (piece.family, piece.side, thread, *(round(n, 6) for n in numbers))
            group = alike.setdefault(key, PieceGroup(piece, [], [], thread, detail.along))
            group.cells.append(cell)
            group.blocks.append(block)
    groups: list[PieceGroup] = []
    for side, most in ((TOP, detail.most), (UNDER, detail.most // 2)):
        # Pieces of different threads are not merged, so each thread has its own number of nodes.
        for thread in sorted({group.thread for group in alike.values()}):
            groups += _merged(
                [group for group in alike.values() if group.piece.side == side and group.thread == thread], most
            )
    return sorted(groups, key=lambda group: (group.piece.family, group.thread))


def _parts(piece: CellPiece, count: int) -> list[CellPiece]:
    """Return a piece of yarn cut into parts that are equal in the angle across; a gap is not cut."""
    if piece.family == GAP or count == 1:
        return [piece]
    borders = [0.5 + piece.radius * math.sin(math.pi * (part / count - 0.5)) for part in range(count + 1)]
    return [piece._replace(across=extent) for extent in itertools.pairwise(borders)]


def _merged(groups: list[PieceGroup], most: int) -> list[PieceGroup]:
    """Merge the two groups most alike until all have together at most `most` nodes, or nothing is left to merge."""
    groups = list(groups)
    while sum(group.nodes for group in groups) > most:
        pairs = [
            (_distance(first, second), i, j)
            for j, second in enumerate(groups)
            for i, first in enumerate(groups[:j])
            if first.piece[:4] == second.piece[:4] and first.lines == second.lines and first.piece.family != GAP
        ]
        if not pairs:
            break
        _, i, j = min(pairs)
        second = groups.pop(j)
        groups[i] = _together(groups[i], second)
    return groups


def _distance(first: PieceGroup, second: PieceGroup) -> float:
    """Return by how much merging raises the sum over cells of the squared error of the inclination."""
    sizes = len(first.cells), len(second.cells)
    middle = first.piece.offset * first.piece.curve - second.piece.offset * second.piece.curve
    curve = first.piece.curve - second.piece.curve
    return sizes[0] * sizes[1] / sum(sizes) * (middle**2 + curve**2 / 12.0)


def _together(first: PieceGroup, second: PieceGroup) -> PieceGroup:
    """Return two groups as one of their mean inclination."""
    cells = first.cells + second.cells
    share = len(first.cells) / len(cells)

    def mean(a: float, b: float) -> float:
        return share * a + (1.0 - share) * b

    one, other = first.piece, second.piece
    curve = mean(one.curve, other.curve)
    middle = mean(one.offset * one.curve, other.offset * other.curve)
    # The length only tells where the arc of a yarn beneath ends.
    piece = one._replace(offset=middle / curve if curve else 0.0, curve=curve, half=max(one.half, other.half))
    return PieceGroup(piece, cells, first.blocks + second.blocks, first.thread, first.dense)


SURFACE_ROWS: Final = 13  # normal (3), 1 / n_z, tangent (3), its change along (3) and across (3)

FLAT: Final = np.array([0.0, 0.0, 1.0, 1.0] + [0.0] * 9)  # the rows of a gap, and of the nodes that fill up a block

_AXES = np.eye(3)
_GAUSS = 1.0 / math.sqrt(3.0)


def piece_rows(yarn: Float64, piece: CellPiece, across: Rule, along: Rule) -> Float64:
    """Return the surface at the nodes of a piece, (SURFACE_ROWS, nodes); nodes across the yarn follow each other.

    `yarn` is `HeightField.yarn`; `across` and `along` are the nodes of the piece, which may be a gap.
    """
    lines, columns = len(along.places), len(across.places)
    if piece.family == GAP:
        return np.tile(FLAT[:, None], lines * columns)
    own = yarn[piece.family]
    radius = piece.radius
    turned = 1.0 if piece.family == WARP else -1.0  # y of the yarn's frame against the cell's axis

    # Sine of the angle across, place along and half box of each node.
    sines = np.clip((np.tile(across.places, lines) - 0.5) / radius, -1.0, 1.0)
    places = turned * (np.repeat(along.places, columns) - 0.5 + piece.offset)
    half_across = 0.5 * np.tile(np.diff(across.borders), lines)
    half_along = 0.5 * np.repeat(np.diff(along.borders), columns)
    fibre = Fibre(float(own[SIN_TWIST]), float(own[COS_TWIST]), float(own[BETA]))
    found = np.zeros((SURFACE_ROWS, len(sines)))
    curvature = float(piece.sign * piece.curve)
    _fill_rows(sines, places, half_across, half_along, float(radius), curvature, float(piece.steepest), fibre, found)
    return found


@fast_kernel
def _fill_rows(
    sines: Float64, places: Float64, half_across: Float64, half_along: Float64, radius: float, curvature: float,
    limit: float, fibre: Fibre, found: Float64,
) -> None:  # fmt: skip
    """Write the rows of all nodes of a piece of yarn, (SURFACE_ROWS, nodes)."""
    for k in range(len(sines)):
        cos_v = math.sqrt((1.0 - sines[k]) * (1.0 + sines[k]))
        angles, inner = bend(sines[k], cos_v, radius, places[k], curvature, limit)
        found[0, k], found[1, k], found[2, k] = normal(angles, fibre.beta)
        found[3, k] = 1.0 / found[2, k]
        t = tangent(angles, fibre)
        found[4, k], found[5, k], found[6, k] = t.x, t.y, t.z
        step_u = _GAUSS * half_along[k] * inner / angles.cos_u
        step_v = _GAUSS * half_across[k] / (radius * max(cos_v, 1e-9))
        for axis in range(3):
            by_u, by_v = turning(_AXES[axis, 0], _AXES[axis, 1], _AXES[axis, 2], t, angles, fibre)
            found[7 + axis, k], found[10 + axis, k] = step_u * by_u, step_v * by_v
