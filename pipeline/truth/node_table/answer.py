"""Answers to queries from a table of nodes, with their estimated error.

The error of a sum over nodes comes mostly from borders of shadows that cross nodes. The margins of two nodes show how
far the border between them lies from half-way, and so by how much it moves the sum; this is reported as an error. Where
the horizon jumps, the place of the border is unknown. Curvature within a node (`kernels.SMOOTH`) and errors that
neither nodes nor borders show (`refine.UNSEEN`) add a share each; both were fitted to converged answers (tests/fits).
Where the standard error that this gives exceeds the requested one, the nodes that may be most wrong are refined.
"""

import math
from typing import Final, NamedTuple

import numpy as np

from pipeline.compiled.arrays import Float64, Index
from pipeline.compiled.decorators import kernel
from pipeline.truth.calibration import REFINED, Factors, squared_norm, standard_error
from pipeline.truth.cloth import ClothSide, Raw, WideQueries
from pipeline.truth.footprint.mixture import Line
from pipeline.truth.footprint.place import GAUSSIAN
from pipeline.truth.footprint.sequences import derive
from pipeline.truth.geometry.heightfield import BLEND, GAP
from pipeline.truth.monte_carlo import conceal, query_directions
from pipeline.truth.node_table import build, kernels
from pipeline.truth.node_table.build import ExactNodes
from pipeline.truth.node_table.doubts import doubtful_from
from pipeline.truth.node_table.kernels import HorizonSlopes, NodeDirections, NodeShares, Normals, Tangents
from pipeline.truth.node_table.refine import UNSEEN, Refinement, RefineRoom, refine, refine_room
from pipeline.truth.node_table.seen_walls import WallRoom, sum_walls, wall_room
from pipeline.truth.node_table.weights import WeightRoom, any_weight, fill_displaced, fill_weights, weight_room

UNDECIDED: Final = 0.3
"""Error by nodes whose horizons disagree, relative to the components of the patch and to the share of the nodes."""

_ROWS: Final = (2, 4, 8)  # rows of a refined node, tried in this order
_0 = np.float32(0.0)


class Requested(NamedTuple):
    """When an answer is good enough."""

    relative: float
    absolute: float
    """Requested standard error: relative to the norm of the four components, and 1/sr."""
    front: tuple[Factors, Factors]
    behind: tuple[Factors, Factors]
    """Calibration of answers by the table alone and of refined ones, for light from either side."""


class _Work(NamedTuple):
    """Input of all queries, and room for one: shares of an own and of an even footprint, weights, sums."""

    cloth: ClothSide
    table: ExactNodes
    requested: Requested
    line: Line
    own: NodeShares
    everywhere: NodeShares
    weights: WeightRoom
    walls: WallRoom
    moved: Float64
    mean: Float64
    error: Float64
    refinement: RefineRoom


def sum_rows(
    cloth: ClothSide, table: ExactNodes, columns: WideQueries, index: Index, requested: Requested, seed: int, line: Line
) -> Raw:
    """Answer every row; ellipses by a `line`. Rows whose nodes were refined have the stage REFINED, others 0.

    Footprints are Gaussian or lie along the axes, the cloth is flat, cosines go to the ply normal, points hide one
    another, and there is light from behind only if the table has horizons there.
    """
    nodes = table.normal.shape[1]
    own = kernels.no_shares(nodes)
    shares, rooms = (own, own._replace(weight=table.evenly)), (weight_room(table, line), wall_room(table))
    moved, mean, error = np.zeros((3, 5))
    work = _Work(cloth, table, requested, line, *shares, *rooms, moved, mean, error, refine_room(nodes))
    answers = Raw.empty(len(columns.u))
    _answer_rows(work, columns, index, np.uint64(seed), answers)
    return answers


@kernel
def _answer_rows(work: _Work, columns: WideQueries, index: Index, seed: np.uint64, answers: Raw) -> None:
    cloth, table, line = work.cloth, work.table, work.line
    for row in range(len(columns.u)):
        even = cloth.shape == GAUSSIAN and min(columns.sigma[row], columns.sigma_minor[row]) >= table.uniform
        points = 0
        if not even and cloth.parallax:
            points = fill_displaced(table, cloth.plane, columns, row, line, work.weights, work.own.weight)
        elif not even:
            fill_weights(table, cloth.shape, columns, row, line, work.weights, work.own.weight)
        shares = work.everywhere if even else work.own
        _answer_row(work, columns, row, derive(seed, index[row]), shares, points, answers)


@kernel
def _answer_row(
    work: _Work, columns: WideQueries, row: int, key: np.uint64, shares: NodeShares, points: int, answers: Raw
) -> None:
    """Answer a row whose footprint is spread over the nodes; `key` names its random numbers.

    `points` are those of the grid of the footprint's density, which walls read; 0 if it is even.
    """
    cloth, table, requested, moved = work.cloth, work.table, work.requested, work.moved
    mean, error = answers.mean[row], answers.error[row]
    towards = kernels.node_directions(columns.wi[row], columns.wo[row], len(table.slope))
    area, area_error, moved_area, undecided, nodes = sum_pieces(cloth, table, towards, shares, mean, moved, error)
    answers.count[row] += nodes
    if cloth.choices.rims:
        of_walls, doubt = sum_walls(cloth, table, towards, points, work.weights, work.walls, mean, error)
        area, area_error = area + of_walls, area_error + doubt
    cosine = columns.wo[row, 2]
    if area <= 0.0:
        mean[:], error[:] = 0.0, 0.0
        return
    # From sums to ratios, and from squared errors to standard errors.
    below = cosine if cloth.projected else area
    for q in range(5):
        ratio = mean[q] / below
        inner = 0.0 if cloth.projected else ratio
        shift = moved[q] - inner * moved_area
        doubt = error[q] + inner * inner * area_error
        mean[q] = ratio
        error[q] = math.sqrt(shift * shift + doubt) / below + UNSEEN * ratio
    # Undecided nodes lie side by side and change together: they are all visible and lit, or none is.
    change = UNDECIDED * (undecided / (area + undecided)) * math.sqrt(squared_norm(mean))
    for q in range(4):
        error[q] = math.hypot(error[q], change)
    share, share_error = area / cosine, (math.hypot(moved_area, math.sqrt(area_error)) + undecided) / cosine
    if conceal(share, share_error, mean, error):
        return
    target = max(requested.relative**2 * squared_norm(mean), requested.absolute**2)
    plain, refined = requested.behind if columns.wi[row, 2] < 0.0 else requested.front
    if _squared_error(mean, error, plain) <= target:
        return
    answers.stage[row] = REFINED
    refinement = Refinement(cloth, table, query_directions(columns, row), key, shares, work.refinement)
    least = doubtful_from(table, shares, mean, below, target / refined.reported**2, work.refinement.doubts)
    for q in range(5):
        work.mean[q], work.error[q] = mean[q], error[q]
    for rows in _ROWS:
        for q in range(5):
            mean[q], error[q] = work.mean[q], work.error[q]
        answers.count[row] += refine(refinement, rows, least, below, mean, error)
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
def sum_pieces(
    cloth: ClothSide, table: ExactNodes, towards: NodeDirections, shares: NodeShares, sums: Float64, moved: Float64,
    squares: Float64,
) -> tuple[float, float, float, float, int]:  # fmt: skip
    """Write the sums over all nodes, their changes by borders, and their squared errors.

    Returns the denominator, its squared error, its change by borders, the share of undecided nodes in it, and the
    number of nodes visited.
    """
    area, area_error, moved_area, undecided = np.float64(0.0), np.float64(0.0), np.float64(0.0), np.float64(0.0)
    nodes, viewer, n, fine = 0, towards.viewer, table.normal, table.fine
    moved[:] = 0.0
    for p in range(len(table.pieces)):
        piece = table.pieces[p]
        start, across, family = piece[build.FIRST_NODE], piece[build.NODES_X], piece[build.PIECE_FAMILY]
        count = across * piece[build.NODES_Y]
        stop = start + count
        if not any_weight(shares.weight[start:stop]):
            continue
        nodes += count
        own = NodeShares(
            shares.weight[start:stop], shares.lit[start:stop], shares.areas[start:stop], shares.diffuses[start:stop],
            shares.speculars[start:stop], shares.margins[start:stop], shares.lit_margins[start:stop],
            shares.undecided[start:stop],
        )  # fmt: skip
        normal = Normals(n[0, start:stop], n[1, start:stop], n[2, start:stop], n[3, start:stop])
        # The straight way through a gap must clear both sides of the cloth, so a gap is lit by its own ray.
        light = towards.through if family == GAP else towards.light
        slope = table.slope_behind if family == GAP or towards.behind else table.slope
        light_slopes = HorizonSlopes(slope[light.first, start:stop], slope[light.second, start:stop])
        viewer_slopes = HorizonSlopes(table.slope[viewer.first, start:stop], table.slope[viewer.second, start:stop])
        blend = np.float32(cloth.front.yarn[min(family, 1), BLEND])
        a, c = kernels.weigh(normal, light, light_slopes, viewer, viewer_slopes, blend, own)
        own.speculars[:] = _0
        if family == GAP:
            for k in range(count):
                own.areas[k] = viewer.z * own.lit[k]
                own.margins[k] = own.lit_margins[k]
            a = c / viewer.z
            sums[4] += a
        else:
            places, f0 = piece[build.FINE_COUNT], piece[build.FIRST_FINE]
            f1 = f0 + count
            layer = kernels.flake_layer(cloth.front, family, places)
            tangent = Tangents(fine[4, f0:f1], fine[5, f0:f1], fine[6, f0:f1])
            sums[4] += kernels.crossing(normal, tangent, viewer, layer, own.areas)
            if c > 0.0:
                nodes += count * (places - 1)
                for _ in range(places):
                    finer = Normals(fine[0, f0:f1], fine[1, f0:f1], fine[2, f0:f1], fine[3, f0:f1])
                    tangent = Tangents(fine[4, f0:f1], fine[5, f0:f1], fine[6, f0:f1])
                    sums[family] += kernels.scatter(finer, tangent, towards, layer, own.lit, own.speculars)
                    f0, f1 = f1, f1 + count
                sums[2 + family] += c / math.pi
        area += a
        undecided += own.undecided.sum()
        a1, _, a2, _ = kernels.borders(own.areas, own.areas, own.margins, across)
        c1, s1, c2, s2 = kernels.borders(own.diffuses, own.speculars, own.lit_margins, across)
        moved_area += a1
        area_error += a2
        if family == GAP:
            moved[4] += a1
            squares[4] += a2
            continue
        moved[family] += s1
        moved[2 + family] += c1 / math.pi
        squares[family] += s2
        squares[2 + family] += c2 / (math.pi * math.pi)
    return area, area_error, moved_area, undecided, nodes
