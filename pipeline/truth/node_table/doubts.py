"""Doubts about the nodes of a table: which are worth refining, and the error that the others leave.

A border of visibility or light lies somewhere between the centres of two nodes that it separates. The margins say where
if they change smoothly: the sum moves by a known amount, and borders along a row of nodes move it together. Where the
margin jumps, the place is unknown. Both count half for either node.
"""

import math
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from pipeline.compiled.arrays import Float32, Float64, Index
from pipeline.compiled.decorators import kernel
from pipeline.truth.calibration import squared_norm
from pipeline.truth.geometry.heightfield import GAP
from pipeline.truth.node_table.build import FIRST_NODE, NODES_X, NODES_Y, PIECE_FAMILY, ExactNodes
from pipeline.truth.node_table.kernels import SMOOTH, NodeShares
from pipeline.truth.node_table.weights import any_weight

_LEFT: Final = 0.35  # share of the requested squared error that nodes which are not refined may keep
_KNOWN, _JUMPED = np.float32(0.05), np.float32(0.1)  # squared error of a border's place, in nodes: by margins; unknown
_JUMP = np.float32(3.0)  # times the change of the margin beside it
_SURE = np.float32(1e30)  # doubt of a node whose horizons disagree: always refined
_SEEN = 1e-5  # share of the area from which on such a node matters
_LEVELS, _MIDDLE = 64, 40  # powers of 2 of doubts, and the place of the requested squared error itself
_LIGHTEST = np.float32(1e-7)  # share of the footprint below which a node is left as it is
_MANTISSA, _BIAS = 23, 127  # bits of a float32 below its exponent, and the exponent of 1

_0, _HALF = np.float32(0.0), np.float32(0.5)
_PER_PI = np.float32(1.0 / math.pi)
_TINY = np.float32(1e-30)


class Doubts(NamedTuple):
    """Possible errors of the nodes, for one query; overwritten for each."""

    right: Float32
    down: Float32
    """Squared change of the components by the border to the next node in x and in y; 0 without one, (N,)."""
    score: Float32  # squared change of the components by a node, (N,)
    bits: npt.NDArray[np.int32]  # the bits of `score`: the same memory, int32 (N,)
    specular: Float32
    diffuse: Float32
    """Changes of a node's family by the borders beside it, if these lie where the margins say, (N,)."""
    left: Float64
    """Errors that unrefined nodes leave together: the squared error and the four components' changes, (5,)."""
    levels: Float64  # the same for nodes whose score lies between two powers of 2, (L, 5)


def no_doubts(nodes: int) -> Doubts:
    """Return room for so many nodes, all 0."""
    right, down, score, specular, diffuse = np.zeros((5, nodes), np.float32)
    return Doubts(right, down, score, score.view(np.int32), specular, diffuse, np.zeros(5), np.zeros((_LEVELS, 5)))


@kernel
def doubtful_from(
    table: ExactNodes, shares: NodeShares, mean: Float64, below: float, requested: float, doubts: Doubts
) -> float:
    """Write the doubts of all nodes; return the score from which on a node is to be refined.

    The other nodes leave at most a fixed share of the squared error `requested`. `mean` are the components of the
    patch, `below` their denominator.
    """
    levels, left = doubts.levels, doubts.left
    levels[:] = 0.0
    left[:] = 0.0
    squares = squared_norm(mean)
    whole = requested * below * below
    zero = math.frexp(whole)[1] - 1 - _MIDDLE
    for p in range(len(table.pieces)):
        piece = table.pieces[p]
        start, across, family = piece[FIRST_NODE], piece[NODES_X], piece[PIECE_FAMILY]
        stop = start + across * piece[NODES_Y]
        doubts.score[start:stop] = _0
        if not any_weight(shares.weight[start:stop]):
            continue
        own = 0 if family == GAP else family
        _doubt_links(piece, shares, mean, squares, doubts)
        _score(piece, shares, mean[own], mean[2 + own], doubts)
        for k in range(start, stop):
            if shares.undecided[k] > _SEEN * below:
                doubts.score[k] = _SURE
            if doubts.score[k] > _0:
                # The power of 2 of a float32 is in its bits.
                level = min(max((doubts.bits[k] >> _MANTISSA) - _BIAS - zero, 0), _LEVELS - 1)
                levels[level, 0] += doubts.score[k]
                if doubts.specular[k] != _0 or doubts.diffuse[k] != _0:
                    levels[level, 1 + own] += doubts.specular[k]
                    levels[level, 3 + own] += doubts.diffuse[k]
    level = 0
    while level < _LEVELS - 1:
        total = left[0] + levels[level, 0]
        for q in range(1, 5):
            total += (left[q] + levels[level, q]) ** 2
        if total > _LEFT * whole:
            break
        for q in range(5):
            left[q] += levels[level, q]
        level += 1
    return math.ldexp(1.0, zero + level)


@kernel
def _score(piece: Index, shares: NodeShares, specular: float, diffuse: float, doubts: Doubts) -> None:
    """Write half the doubts of each node's four links, and its error from curvature; two components of the patch."""
    start, across, lines, gap = piece[FIRST_NODE], piece[NODES_X], piece[NODES_Y], piece[PIECE_FAMILY] == GAP
    right, down = doubts.right, doubts.down
    s_mean, c_mean = np.float32(specular), np.float32(diffuse)
    for line in range(lines):
        for column in range(across):
            k = start + line * across + column
            if shares.weight[k] <= _LIGHTEST:
                continue
            score = right[k] + down[k]
            if column > 0:
                score += right[k - 1]
            if line > 0:
                score += down[k - across]
            score *= _HALF
            if not gap:
                s = shares.speculars[k] - s_mean * shares.areas[k]
                c = shares.diffuses[k] * _PER_PI - c_mean * shares.areas[k]
                score += (s * s + c * c) * SMOOTH
            doubts.score[k] = score


@kernel
def _doubt_links(piece: Index, shares: NodeShares, mean: Float64, squares: float, doubts: Doubts) -> None:
    """Write the doubts of the links between the nodes of a piece, and the changes; `squares` is |mean|^2."""
    start, across, lines, family = piece[FIRST_NODE], piece[NODES_X], piece[NODES_Y], piece[PIECE_FAMILY]
    stop = start + across * lines
    gap = family == GAP
    own = 0 if gap else family
    specular, diffuse = np.float32(mean[own]), np.float32(mean[2 + own])
    other = np.float32(squares) - specular * specular - diffuse * diffuse
    doubts.right[start:stop] = _0
    doubts.down[start:stop] = _0
    doubts.specular[start:stop] = _0
    doubts.diffuse[start:stop] = _0
    margins, lit_margins = shares.margins, shares.lit_margins
    for line in range(lines):
        for column in range(across):
            k = start + line * across + column
            if shares.weight[k] <= _LIGHTEST:
                continue
            seen, lit = margins[k] > _0, lit_margins[k] > _0
            for axis in range(2):
                if (column == across - 1) if axis == 0 else (line == lines - 1):
                    continue
                j = k + (1 if axis == 0 else across)
                changed = (margins[j] > _0) != seen
                if not changed and (lit_margins[j] > _0) == lit:
                    continue
                # What the next node would bring in place of this one, beyond its share of the denominator.
                area = shares.areas[k] - shares.areas[j]
                s, c = -specular * area, -diffuse * area
                if not gap:
                    s += shares.speculars[k] - shares.speculars[j]
                    c += (shares.diffuses[k] - shares.diffuses[j]) * _PER_PI
                moved, place = _border(margins if changed else lit_margins, k, axis, start, across, stop)
                doubt = (s * s + c * c + other * area * area) * (moved * moved + place)
                if axis == 0:
                    doubts.right[k] = doubt
                else:
                    doubts.down[k] = doubt
                for node in (k, j):
                    doubts.specular[node] += _HALF * moved * s
                    doubts.diffuse[node] += _HALF * moved * c


@kernel
def _border(margins: Float32, k: int, axis: int, start: int, across: int, stop: int) -> tuple[np.float32, np.float32]:
    """Return by how much of a node the border lies beyond half-way from node k, and the square of what is unknown."""
    column = (k - start) % across
    step, turn = (1, across) if axis == 0 else (across, 1)
    room_before = column > 0 if axis == 0 else k - across >= start
    room_after = column < across - 2 if axis == 0 else k + 2 * across < stop
    room_aside = k + turn < stop if axis == 0 else column < across - 1
    here, there = margins[k], margins[k + step]
    change = abs(here - there)
    before = abs(margins[k - step] - here) if room_before else change
    after = abs(margins[k + 2 * step] - there) if room_after else change
    aside = k + turn if room_aside else k - turn
    # A border that the link at a right angle crosses too counts in parts.
    weight = change / (change + (abs(here - margins[aside]) if aside >= start else change) + _TINY)
    if change > _JUMP * max(before, after):
        return _0, weight * _JUMPED
    moved = (max(here, there) / change - _HALF) * weight
    return (moved if here > there else -moved), weight * _KNOWN
