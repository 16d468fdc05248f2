"""Answers to queries from a table of nodes, with their estimated error.

The error of a sum over nodes comes mostly from borders of shadows that cross nodes. The margins of two nodes show how
far the border between them lies from half-way, and so by how much it moves the sum; this is reported as an error. Where
the horizon jumps, the place of the border is unknown. Curvature within a node (`kernels.SMOOTH`) and errors that
neither nodes nor borders show (`refine.UNSEEN`) add a share each; both were fitted to converged answers (tests/fits).
Where the standard error that this gives exceeds the requested one, the nodes that may be most wrong are refined.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np

from pipeline.compiled.arrays import Float64, Index
from pipeline.compiled.decorators import inlined_kernel, kernel
from pipeline.truth.calibration import REFINED, Factors, squared_norm, standard_error
from pipeline.truth.cloth import ClothSide, Raw, WideQueries
from pipeline.truth.footprint.mixture import Line
from pipeline.truth.footprint.place import GAUSSIAN
from pipeline.truth.footprint.sequences import derive
from pipeline.truth.geometry.heightfield import BLEND, GAP
from pipeline.truth.monte_carlo import conceal, query_directions
from pipeline.truth.node_table.build import (
    FINE_COUNT,
    FIRST_FINE,
    FIRST_NODE,
    NODES_X,
    NODES_Y,
    PIECE_FAMILY,
    ExactNodes,
)
from pipeline.truth.node_table.displaced import DensityRoom, density_room, fill_displaced
from pipeline.truth.node_table.doubts import doubtful_from
from pipeline.truth.node_table.kernels import (
    HorizonSlopes,
    NodeDirections,
    NodeShares,
    Normals,
    Tangents,
    borders,
    crossing,
    flake_layer,
    no_shares,
    node_directions,
    scatter,
    weigh,
)
from pipeline.truth.node_table.refine import UNSEEN, RefineRoom, refine, refine_room
from pipeline.truth.node_table.seen_walls import WallRoom, sum_walls, wall_room
from pipeline.truth.node_table.weights import WeightRoom, any_weight, fill_weights, weight_room

_ROWS: Final = (2, 4, 8)
"""Rows of a refined node, tried in this order."""

UNDECIDED: Final = 0.3
"""Error by nodes whose horizons disagree, relative to the components of the patch and to the share of the nodes."""

_0 = np.float32(0.0)


class Requested(NamedTuple):
    """When an answer is good enough."""

    relative: float
    absolute: float
    """Requested standard error: relative to the norm of the four components, and 1/sr."""
    front: tuple[Factors, Factors]
    behind: tuple[Factors, Factors]
    """Calibration of answers by the table alone and of refined ones, for light from either side."""


class _Room(NamedTuple):
    """Room for one query: shares of an own and of an even footprint, its weights, sums, and for refinement."""

    own: NodeShares
    everywhere: NodeShares
    weights: WeightRoom
    density: DensityRoom
    walls: WallRoom
    moved: Float64
    mean: Float64
    error: Float64
    refinement: RefineRoom


def sum_rows(
    cloth: ClothSide,
    table: ExactNodes,
    columns: WideQueries,
    index: Index,
    requested: Requested,
    seed: np.uint64,
    line: Line,
) -> Raw:
    """Answer every row; ellipses by a `line`. Rows whose nodes were refined have the stage REFINED, others 0.

    Footprints are Gaussian or lie along the axes, the cloth is flat, cosines go to the ply normal, points hide one
    another, and there is light from behind only if the table has horizons there.
    """
    nodes = table.normal.shape[1]
    own = no_shares(nodes)
    everywhere, sums = own._replace(weight=table.evenly), np.zeros((3, 5))
    rooms = weight_room(table, line), density_room(table, line), wall_room(table)
    room = _Room(own, everywhere, *rooms, sums[0], sums[1], sums[2], refine_room(nodes))
    answers = Raw.empty(len(columns.u))
    _answer_rows(cloth, table, columns, index, requested, seed, line, room, answers)
    return answers


@kernel
def _answer_rows(
    cloth: ClothSide,
    table: ExactNodes,
    columns: WideQueries,
    index: Index,
    requested: Requested,
    seed: np.uint64,
    line: Line,
    room: _Room,
    answers: Raw,
) -> None:
    """Answer every row."""
    for row in range(len(columns.u)):
        even = cloth.shape == GAUSSIAN and min(columns.sigma[row], columns.sigma_minor[row]) >= table.uniform
        points = 0
        if not even and cloth.parallax:
            points = fill_displaced(table, cloth.plane, columns, row, line, room.density, room.own.weight)
        elif not even:
            fill_weights(table, cloth.shape, columns, row, line, room.weights, room.own.weight)
        shares = room.everywhere if even else room.own
        _answer_row(cloth, table, columns, row, derive(seed, index[row]), requested, shares, points, room, answers)


@kernel
def _answer_row(
    cloth: ClothSide,
    table: ExactNodes,
    columns: WideQueries,
    row: int,
    key: np.uint64,
    requested: Requested,
    shares: NodeShares,
    points: int,
    room: _Room,
    answers: Raw,
) -> None:
    """Answer a row whose footprint is spread over the nodes; `key` names its random numbers.

    `points` are those of the grid of the footprint's density, which walls read; 0 if it is even.
    """
    mean, error = answers.mean[row], answers.error[row]
    towards = node_directions(columns.wi[row], columns.wo[row], len(table.slope))
    area, area_error, moved_area, undecided, nodes = sum_pieces(cloth, table, towards, shares, mean, room.moved, error)
    answers.count[row] += nodes
    if cloth.choices.rims:
        of_walls, doubt = sum_walls(cloth, table, towards, points, room.density, room.walls, mean, error)
        area, area_error = area + of_walls, area_error + doubt
    cosine = columns.wo[row, 2]
    if area <= 0.0:
        mean[:], error[:] = 0.0, 0.0
        return
    _divide(cloth.projected, cosine, area, area_error, moved_area, room.moved, mean, error)
    _add_undecided(undecided / (area + undecided), mean, error)
    share, share_error = area / cosine, (math.hypot(moved_area, math.sqrt(area_error)) + undecided) / cosine
    if conceal(share, share_error, mean, error):
        return
    target = max(requested.relative**2 * squared_norm(mean), requested.absolute**2)
    plain, refined = requested.behind if columns.wi[row, 2] < 0.0 else requested.front
    if _squared_error(mean, error, plain) <= target:
        return
    answers.stage[row] = REFINED
    below = cosine if cloth.projected else area
    directions = query_directions(columns, row)
    least = doubtful_from(table, shares, mean, below, target / refined.reported**2, room.refinement.doubts)
    for q in range(5):
        room.mean[q], room.error[q] = mean[q], error[q]
    for rows in _ROWS:
        for q in range(5):
            mean[q], error[q] = room.mean[q], room.error[q]
        answers.count[row] += refine(
            cloth, table, directions, key, rows, shares, least, below, room.refinement, mean, error
        )
        if _squared_error(mean, error, refined) <= target:
            break


@kernel
def _squared_error(mean: Float64, error: Float64, factors: Factors) -> float:
    """Return the sum of the squares of the standard errors of the four components."""
    size, total = math.sqrt(squared_norm(mean)), 0.0
    for q in range(4):
        total += standard_error(error[q], size, factors) ** 2
    return total


@kernel
def _add_undecided(share: float, mean: Float64, error: Float64) -> None:
    """Raise the errors of the components by what nodes with such a share of the area may change.

    They lie side by side and change together: they are all visible and lit, or none is.
    """
    change = UNDECIDED * share * math.sqrt(squared_norm(mean))
    for q in range(4):
        error[q] = math.hypot(error[q], change)


@kernel
def sum_pieces(
    cloth: ClothSide,
    table: ExactNodes,
    towards: NodeDirections,
    shares: NodeShares,
    sums: Float64,
    moved: Float64,
    squares: Float64,
) -> tuple[float, float, float, float, int]:
    """Write the sums over all nodes, their changes by borders, and their squared errors.

    Returns the denominator, its squared error, its change by borders, the share of undecided nodes in it, and the
    number of nodes visited.
    """
    area, area_error, moved_area, undecided = np.float64(0.0), np.float64(0.0), np.float64(0.0), np.float64(0.0)
    nodes = 0
    moved[:] = 0.0
    for p in range(len(table.pieces)):
        piece = table.pieces[p]
        start, across, family = piece[FIRST_NODE], piece[NODES_X], piece[PIECE_FAMILY]
        count = across * piece[NODES_Y]
        stop = start + count
        if not any_weight(shares.weight[start:stop]):
            continue
        nodes += count
        own = NodeShares(
            shares.weight[start:stop],
            shares.lit[start:stop],
            shares.areas[start:stop],
            shares.diffuses[start:stop],
            shares.speculars[start:stop],
            shares.margins[start:stop],
            shares.lit_margins[start:stop],
            shares.undecided[start:stop],
        )
        normal = Normals(
            table.normal[0, start:stop],
            table.normal[1, start:stop],
            table.normal[2, start:stop],
            table.normal[3, start:stop],
        )
        a, c = _weigh_piece(cloth, table, towards, piece, normal, own)
        if family == GAP:
            own.speculars[:] = _0
            for k in range(count):
                own.areas[k] = towards.viewer.z * own.lit[k]
                own.margins[k] = own.lit_margins[k]
            a = c / towards.viewer.z
            sums[4] += a
        else:
            lit = bool(c > 0.0)
            nodes += _scatter(cloth, table, towards, piece, normal, own, lit, sums)
            if lit:
                sums[2 + family] += c / math.pi
        area += a
        undecided += own.undecided.sum()
        a1, _, a2, _ = borders(own.areas, own.areas, own.margins, across)
        c1, s1, c2, s2 = borders(own.diffuses, own.speculars, own.lit_margins, across)
        moved_area += a1
        area_error += a2
        if family == GAP:
            moved[4] += a1
            squares[4] += a2
        else:
            moved[family] += s1
            moved[2 + family] += c1 / math.pi
            squares[family] += s2
            squares[2 + family] += c2 / (math.pi * math.pi)
    return area, area_error, moved_area, undecided, nodes


@inlined_kernel
def _weigh_piece(
    cloth: ClothSide, table: ExactNodes, towards: NodeDirections, piece: Index, normal: Normals, shares: NodeShares
) -> tuple[np.float32, np.float32]:
    """Write which nodes of a piece are visible and lit; return its sums of area and of diffuse shares.

    The straight way through a gap must clear both sides of the cloth, so a gap is lit by its own ray.
    """
    gap = piece[PIECE_FAMILY] == GAP
    start, stop = piece[FIRST_NODE], piece[FIRST_NODE] + piece[NODES_X] * piece[NODES_Y]
    light, viewer = towards.through if gap else towards.light, towards.viewer
    slope = table.slope_behind if gap or towards.behind else table.slope
    return weigh(
        normal,
        light,
        HorizonSlopes(slope[light.first, start:stop], slope[light.second, start:stop]),
        viewer,
        HorizonSlopes(table.slope[viewer.first, start:stop], table.slope[viewer.second, start:stop]),
        np.float32(cloth.front.yarn[min(piece[PIECE_FAMILY], 1), BLEND]),
        shares,
    )


@inlined_kernel
def _scatter(
    cloth: ClothSide,
    table: ExactNodes,
    towards: NodeDirections,
    piece: Index,
    normal: Normals,
    shares: NodeShares,
    lit: bool,
    sums: Float64,
) -> int:
    """Write the specular shares of a piece of yarn, 0 unless a node is `lit`, and add them to the sums.

    The unscattered light is added too. Returns the number of finer nodes visited beyond one a node.
    """
    count, fine, family = piece[NODES_X] * piece[NODES_Y], piece[FINE_COUNT], piece[PIECE_FAMILY]
    layer = flake_layer(cloth.front, family, fine)
    f0 = piece[FIRST_FINE]
    f1 = f0 + count
    tangent = Tangents(table.fine[4, f0:f1], table.fine[5, f0:f1], table.fine[6, f0:f1])
    sums[4] += crossing(normal, tangent, towards.viewer, layer, shares.areas)
    shares.speculars[:] = _0
    if not lit:
        return 0
    for _ in range(fine):
        finer = Normals(table.fine[0, f0:f1], table.fine[1, f0:f1], table.fine[2, f0:f1], table.fine[3, f0:f1])
        tangent = Tangents(table.fine[4, f0:f1], table.fine[5, f0:f1], table.fine[6, f0:f1])
        sums[family] += scatter(finer, tangent, towards, layer, shares.lit, shares.speculars)
        f0, f1 = f1, f1 + count
    return int(count * (fine - 1))


@kernel
def _divide(
    projected: bool,
    cosine: float,
    area: float,
    area_error: float,
    moved_area: float,
    moved: Float64,
    mean: Float64,
    error: Float64,
) -> None:
    """Replace the sums in `mean` by ratios, and the squared errors in `error` by standard errors."""
    below = cosine if projected else area
    for q in range(5):
        ratio = mean[q] / below
        inner = 0.0 if projected else ratio
        shift = moved[q] - inner * moved_area
        doubt = error[q] + inner * inner * area_error
        mean[q] = ratio
        error[q] = math.sqrt(shift * shift + doubt) / below + UNSEEN * ratio
