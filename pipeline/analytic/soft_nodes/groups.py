"""Groups of similar pieces: the pieces of a repeat that share nodes.

Pieces of one shape that lie alike on floats of one length form a group, of one thread alone where sums are wanted by
thread. A yarn may be cut into parts across, each a piece of its own (`Detail.parts`). A draft of many different floats
has too many groups: then the two most alike are merged, again and again (Ward's distance between their inclinations),
until the nodes of all groups are few enough.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from typing import Final, NamedTuple

from pipeline.analytic.soft_nodes.detail import Detail
from pipeline.truth.geometry.heightfield import GAP, TOP, UNDER
from pipeline.truth.geometry.pieces import Piece

COLUMNS: Final = 8
"""Nodes across a yarn: half the width of the vector units."""

_ALONG = ((1.5, 4), (2.5, 3))  # nodes along a cell of a float shorter than
_LONG = 2  # and of any longer one
_STRIP = 3.0  # nodes a yarn spacing along the visible part of a yarn beneath, and along gaps

Cell = tuple[int, int]


class PieceGroup(NamedTuple):
    """Pieces that share nodes.

    Attributes
    ----------
    piece : Piece
        The mean of them.
    cells : list of (end, pick)
        Cells of the pieces.
    blocks : list of int
        Numbers of their horizons, one for each cell.
    thread : int
        The end or pick that they belong to; 0 if groups hold pieces of all threads.
    dense : float
        Nodes along it, as a multiple of those at level 2.
    """

    piece: Piece
    cells: list[Cell]
    blocks: list[int]
    thread: int = 0
    dense: float = 1.0

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


def gather(pieces: Sequence[tuple[Cell, Piece, int]], detail: Detail, by_thread: bool = False) -> list[PieceGroup]:
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


def _parts(piece: Piece, count: int) -> list[Piece]:
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
            if _mergeable(first, second)
        ]
        if not pairs:
            break
        _, i, j = min(pairs)
        second = groups.pop(j)
        groups[i] = _together(groups[i], second)
    return groups


def _mergeable(first: PieceGroup, second: PieceGroup) -> bool:
    one, other = first.piece, second.piece
    return one[:4] == other[:4] and first.lines == second.lines and one.family != GAP


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
