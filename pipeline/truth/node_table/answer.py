"""Answers to queries from a table of nodes, with their estimated error.

The error of a sum over nodes comes mostly from borders of shadows that cross nodes. The margins of two nodes show how
far the border between them lies from half-way, and so by how much it moves the sum; this is reported as an error. Where
the horizon jumps, the place of the border is unknown. Curvature within a node (`kernels.SMOOTH`) and errors that
neither nodes nor borders show (`refine.UNSEEN`) add a share each; both were fitted to converged answers (tests/fits).
Where the estimated error exceeds the requested one, the nodes on borders are sampled (refine).
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np

from pipeline.compiled.arrays import Float64, Index
from pipeline.compiled.decorators import allocating_kernel, kernel
from pipeline.truth.cloth import ClothSide, Columns
from pipeline.truth.footprint.mixture import Line
from pipeline.truth.footprint.place import GAUSSIAN
from pipeline.truth.footprint.sequences import derive
from pipeline.truth.geometry.azimuths import azimuth_rows
from pipeline.truth.geometry.heightfield import ALPHA, BLEND, GAP
from pipeline.truth.monte_carlo import query_directions
from pipeline.truth.node_table.build import COLUMNS, FAMILY, FINE, FINE_START, ROWS, START, Table
from pipeline.truth.node_table.kernels import borders, crossing, reflected, transmitted, weigh
from pipeline.truth.node_table.refine import UNSEEN, refine
from pipeline.truth.node_table.shares import NodeShares, no_shares, with_weight
from pipeline.truth.node_table.weights import any_weight, fill_weights
from pipeline.truth.query import HIDDEN_SHARE

_SUBDIVISIONS: Final = (2, 4)

_0 = np.float32(0.0)
_STEEPEST = 1e4


class NodeDirections(NamedTuple):
    """Light and viewer of one query as the loops over nodes read them; numbers in float32.

    Attributes
    ----------
    behind : bool
        Whether the light is behind the cloth.
    ix, iy, iz : float32
        wi, or -wi if the light is behind.
    ox, oy, oz : float32
        wo.
    slope_i, slope_o : float32
        Rise of both per unit of distance in the fabric plane.
    i, o, b : tuple of int, int, float32
        For light, viewer and -wo: the two azimuths around it, and where between them it lies.
    size : float32
        1 / |wi + wo|^2.
    """

    behind: bool
    ix: np.float32
    iy: np.float32
    iz: np.float32
    ox: np.float32
    oy: np.float32
    oz: np.float32
    slope_i: np.float32
    slope_o: np.float32
    i: tuple[int, int, np.float32]
    o: tuple[int, int, np.float32]
    b: tuple[int, int, np.float32]
    size: np.float32


@kernel
def bounded_slope(x: float, y: float, z: float) -> float:
    """Return the rise of a direction with z > 0, bounded."""
    return min(z / max(math.sqrt(x * x + y * y), 1e-9), _STEEPEST)


@kernel
def _azimuths_around(x: float, y: float, azimuths: int) -> tuple[int, int, np.float32]:
    low, high, turn = azimuth_rows(x, y, azimuths)
    return low, high, np.float32(turn)


@kernel
def node_directions(wi: Float64, wo: Float64, azimuths: int) -> NodeDirections:
    """Prepare unit directions, wo with z > 0, for a table with so many azimuths."""
    behind = wi[2] < 0.0
    sign = -1.0 if behind else 1.0
    half = (wi[0] + wo[0]) ** 2 + (wi[1] + wo[1]) ** 2 + (wi[2] + wo[2]) ** 2
    return NodeDirections(
        behind,
        np.float32(sign * wi[0]),
        np.float32(sign * wi[1]),
        np.float32(sign * wi[2]),
        np.float32(wo[0]),
        np.float32(wo[1]),
        np.float32(wo[2]),
        np.float32(bounded_slope(wi[0], wi[1], abs(wi[2]))),
        np.float32(bounded_slope(wo[0], wo[1], wo[2])),
        # Light from behind travels in its own azimuth, not in that of -wi.
        _azimuths_around(wi[0], wi[1], azimuths),
        _azimuths_around(wo[0], wo[1], azimuths),
        _azimuths_around(-wo[0], -wo[1], azimuths),
        np.float32(1.0 / max(half, 1e-12)),
    )


@allocating_kernel
def sum_rows(
    cloth: ClothSide,
    table: Table,
    columns: Columns,
    index: Index,
    relative_error: float,
    absolute_error: float,
    seed: np.uint64,
    line: Line,
) -> tuple[Float64, Float64, Index]:
    """Answer every row: means and standard errors (N, 5), and nodes visited; rotated ellipses by a `line`.

    Footprints are Gaussian or lie along the axes, the cloth is flat, cosines go to the ply normal, points hide one
    another, and there is light from behind only if the table has horizons there.
    """
    rows = len(columns.u)
    means, errors, counts = np.zeros((rows, 5)), np.zeros((rows, 5)), np.zeros(rows, np.int64)
    own = no_shares(table.normal.shape[1])
    everywhere = with_weight(own, table.evenly)
    cells = max(table.repeat[0], table.repeat[1])
    scratch = np.zeros((2, cells, len(table.edges), table.edges.shape[1] - 1), np.float32)
    touched = np.zeros((2, cells, len(table.edges)), np.bool_)
    points = np.zeros((2, 2 * line.half + 1), np.float32)
    moved, known, known_error = np.zeros(5), np.zeros(5), np.zeros(5)
    for row in range(rows):
        towards = node_directions(columns.wi[row], columns.wo[row], len(table.slope))
        even = cloth.shape == GAUSSIAN and min(columns.sigma[row], columns.sigma_minor[row]) >= table.uniform
        if not even:
            fill_weights(table, cloth.shape, columns, row, scratch, touched, line, points, own.weight)
        shares = everywhere if even else own

        area, area_error, moved_area, nodes = _sum_pieces(cloth, table, towards, shares, means[row], moved, errors[row])
        counts[row] += nodes
        cosine = columns.wo[row, 2]
        if area < HIDDEN_SHARE * cosine:
            means[row], errors[row] = 0.0, 0.0
            continue
        _divide(cloth.projected, cosine, area, area_error, moved_area, moved, means[row], errors[row])
        size, doubt = _squared_norm(means[row]), _squared_norm(errors[row])
        target = max(relative_error**2 * size, absolute_error**2)
        if doubt > target:
            known[:], known_error[:] = means[row], errors[row]
            directions, key = query_directions(columns, row), derive(seed, index[row])
            below = cosine if cloth.projected else area
            for side in _SUBDIVISIONS:
                means[row], errors[row] = known, known_error
                counts[row] += refine(cloth, table, directions, key, side, shares, below, means[row], errors[row])
                if _squared_norm(errors[row]) <= target:
                    break
    return means, errors, counts


@kernel
def _squared_norm(components: Float64) -> float:
    """Return the sum of the squares of the four components."""
    total = 0.0
    for q in range(4):
        total += components[q] ** 2
    return total


@kernel
def _sum_pieces(
    cloth: ClothSide,
    table: Table,
    towards: NodeDirections,
    shares: NodeShares,
    sums: Float64,
    moved: Float64,
    squares: Float64,
) -> tuple[float, float, float, int]:
    """Write the sums over all nodes, their changes by borders, and their squared errors.

    Returns
    -------
    area, area_error, moved_area : float
        The denominator, its squared error, and its change by borders.
    nodes : int
        Nodes visited.
    """
    area, area_error, moved_area = np.float64(0.0), np.float64(0.0), np.float64(0.0)
    nodes = 0
    moved[:] = 0.0
    for p in range(len(table.pieces)):
        piece = table.pieces[p]
        start, across, count, family = piece[START], piece[COLUMNS], piece[COLUMNS] * piece[ROWS], piece[FAMILY]
        stop = start + count
        if not any_weight(shares.weight[start:stop]):
            continue
        nodes += count
        a, c = _weigh_piece(cloth, table, towards, shares, start, stop, family)
        if family == GAP:
            shares.speculars[start:stop] = _0
            for k in range(start, stop):
                shares.areas[k] = towards.oz * shares.lit[k]
                shares.margins[k] = shares.lit_margins[k]
            a = c / towards.oz
            sums[4] += a
        else:
            lit = bool(c > 0.0)
            nodes += _scatter(cloth, table, towards, shares, p, lit, sums)
            if lit:
                sums[2 + family] += c / math.pi
        area += a
        areas, margins = shares.areas[start:stop], shares.margins[start:stop]
        a1, _, a2, _ = borders(areas, areas, margins, across)
        diffuses, speculars = shares.diffuses[start:stop], shares.speculars[start:stop]
        c1, s1, c2, s2 = borders(diffuses, speculars, shares.lit_margins[start:stop], across)
        moved_area += a1
        area_error += a2
        if family != GAP:
            moved[family] += s1
            moved[2 + family] += c1 / math.pi
            squares[family] += s2
            squares[2 + family] += c2 / (math.pi * math.pi)
    return area, area_error, moved_area, nodes


@kernel
def _weigh_piece(
    cloth: ClothSide, table: Table, towards: NodeDirections, shares: NodeShares, start: int, stop: int, family: int
) -> tuple[np.float32, np.float32]:
    """Write which nodes of a piece are visible and lit; return its sums of area and of diffuse shares.

    The straight way through a gap must clear both sides of the cloth, so a gap is lit by its own ray.
    """
    gap = family == GAP
    i, o, b = towards.i, towards.o, towards.b
    horizon_i = table.slope_behind if towards.behind else table.slope
    return weigh(
        table.normal[0, start:stop],
        table.normal[1, start:stop],
        table.normal[2, start:stop],
        table.normal[3, start:stop],
        shares.weight[start:stop],
        -towards.ox if gap else towards.ix,
        -towards.oy if gap else towards.iy,
        towards.oz if gap else towards.iz,
        towards.ox,
        towards.oy,
        towards.oz,
        towards.slope_o if gap else towards.slope_i,
        table.slope_behind[b[0], start:stop] if gap else horizon_i[i[0], start:stop],
        table.slope_behind[b[1], start:stop] if gap else horizon_i[i[1], start:stop],
        b[2] if gap else i[2],
        towards.slope_o,
        table.slope[o[0], start:stop],
        table.slope[o[1], start:stop],
        o[2],
        np.float32(cloth.front.yarn[min(family, 1), BLEND]),
        shares.lit[start:stop],
        shares.areas[start:stop],
        shares.diffuses[start:stop],
        shares.margins[start:stop],
        shares.lit_margins[start:stop],
    )


@kernel
def _scatter(
    cloth: ClothSide, table: Table, towards: NodeDirections, shares: NodeShares, p: int, lit: bool, sums: Float64
) -> int:
    """Write the specular shares of a piece of yarn, 0 unless a node is `lit`, and add them to the sums.

    The unscattered light is added too. Returns the number of finer nodes visited beyond one a node.
    """
    piece = table.pieces[p]
    start, count, fine, family = piece[START], piece[COLUMNS] * piece[ROWS], piece[FINE], piece[FAMILY]
    stop, f0 = start + count, piece[FINE_START]
    f1 = f0 + count
    yarn, thickness = cloth.front.yarn[family], np.float32(cloth.front.thickness)
    square = np.float32(yarn[ALPHA] ** 2)
    ix, iy, iz, ox, oy, oz = towards.ix, towards.iy, towards.iz, towards.ox, towards.oy, towards.oz
    sums[4] += crossing(
        table.normal[0, start:stop],
        table.normal[1, start:stop],
        table.normal[2, start:stop],
        table.fine[4, f0:f1],
        table.fine[5, f0:f1],
        table.fine[6, f0:f1],
        ox,
        oy,
        oz,
        square,
        thickness,
        shares.areas[start:stop],
    )
    speculars = shares.speculars[start:stop]
    speculars[:] = _0
    if not lit:
        return 0
    scale = np.float32(yarn[ALPHA] ** 3 / (4.0 * math.pi * fine))
    material = square, thickness, towards.size, scale
    for _ in range(fine):
        parts = (
            table.fine[0, f0:f1],
            table.fine[1, f0:f1],
            table.fine[2, f0:f1],
            table.fine[3, f0:f1],
            table.fine[4, f0:f1],
            table.fine[5, f0:f1],
            table.fine[6, f0:f1],
        )
        if towards.behind:
            sums[family] += transmitted(*parts, ix, iy, iz, ox, oy, oz, *material, shares.lit[start:stop], speculars)
        else:
            sums[family] += reflected(*parts, ix, iy, iz, ox, oy, oz, *material, shares.lit[start:stop], speculars)
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
    error[4] = area_error * (mean[4] / area) ** 2
    for q in range(5):
        ratio = mean[q] / below
        inner = 0.0 if projected else ratio
        shift = moved[q] - inner * moved_area
        doubt = error[q] + inner * inner * area_error
        mean[q] = ratio
        error[q] = math.sqrt(shift * shift + doubt) / below + UNSEEN * ratio
