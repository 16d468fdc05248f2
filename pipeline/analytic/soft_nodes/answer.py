"""Sums over soft nodes for each query: fixed nodes for a wide footprint, nodes placed in a narrow one.

deviations                           weights
both >= `Table.uniform`              the cloth evenly
both >= `Table.waves_from`           waves
the narrower one < `NARROW`,
    `STRETCHED` times the other      nodes placed on lines along the footprint, at most `MOST`
    the wider one < `LONG`           nodes placed in the footprint
else                                 densities of both axes, which fixed nodes resolve from `RESOLVED` on

Deviations are compared along a footprint's own axes. For a rotated footprint densities are a mixture
(pipeline.truth.footprint.mixture), waves and lines are exact, and other nodes are placed in a footprint along the
yarns of equal area.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from pipeline.analytic.axis_densities import NARROW, axis_densities
from pipeline.analytic.soft_horizons import sharpness_of_points
from pipeline.analytic.soft_nodes.diamond import AZIMUTHS, around
from pipeline.analytic.soft_nodes.ellipse_nodes import MOST, Ellipse, ellipse, most_nodes, place_ellipse, sharpness_of
from pipeline.analytic.soft_nodes.footprint_nodes import LINE_ROWS, MOST_ACROSS, fill_block, gap_area, place_nodes
from pipeline.analytic.soft_nodes.groups import COLUMNS
from pipeline.analytic.soft_nodes.nodes import BLOCK, BLOCK_NODES, FAMILY, X_HIGH, X_LOW, Y_HIGH, Y_LOW, Table
from pipeline.analytic.soft_nodes.shade import (
    ROWS,
    SUMS,
    GridHorizons,
    Horizons,
    directions,
    shade_fixed,
    shade_fixed_behind,
    shade_footprint,
    shade_footprint_behind,
    shade_gaps,
)
from pipeline.analytic.soft_nodes.waves import HIGHEST
from pipeline.analytic.soft_nodes.weights import REACH, TURN_ROWS, product_weights, wave_weights
from pipeline.compiled.arrays import Float32
from pipeline.compiled.decorators import allocating_kernel
from pipeline.truth.footprint.mixture import COARSE_LINE, deviations, line_points, narrow_axis
from pipeline.truth.geometry.heightfield import ALPHA, BLEND, GAP, RADIUS
from pipeline.truth.query import Queries

LONG: Final = 0.75
"""Largest deviation along the wider axis for which nodes are placed in a footprint that is narrow along the other axis.
This bounds the number of nodes."""

STRETCHED: Final = 1.5
"""Least ratio of the axes of a narrow footprint that places nodes along its own axes."""

RESOLVED: Final = 0.12
"""Least deviation whose density fixed nodes resolve; narrower footprints are widened to it."""

SMALLEST: Final = np.float32(1e-3)
"""Least deviation of a footprint: a thousandth of a yarn is a point. Smaller ones would fall between the digits of a
place."""

# Cells touched by a footprint of deviations LONG and NARROW, their pieces, and the nodes of these.
_MOST_CELLS = (2 + math.floor(2 * REACH * LONG)) * (2 + math.floor(2 * REACH * NARROW))
_MOST_NODES = 3 * _MOST_CELLS * MOST_ACROSS**2
_POINTS = COARSE_LINE.points
_ROUND = Ellipse(1.0, 0.0, 1.0, 1.0, 1.0, 1)
_LEAST = 0.1  # of a deviation, that a footprint must cover of a piece
_0, _1, _HALF = np.float32(0.0), np.float32(1.0), np.float32(0.5)


def query_sums(table: Table, queries: Queries) -> tuple[Float32, Float32]:
    """Return what `sum_queries` returns for N queries about flat cloth, the viewer in front."""
    columns = (queries.u, queries.v, *deviations(queries, SMALLEST), queries.wi, queries.wo)
    return sum_queries(table, *(np.ascontiguousarray(column, np.float32) for column in columns))


@allocating_kernel
def sum_queries(
    table: Table,
    u: Float32,
    v: Float32,
    deviation_x: Float32,
    deviation_y: Float32,
    correlation: Float32,
    wi: Float32,
    wo: Float32,
) -> tuple[Float32, Float32]:
    """Return the sums of N queries, the viewer in front; the light is behind only if the table knows it.

    Parameters
    ----------
    table : Table
        The cloth.
    u, v, deviation_x, deviation_y, correlation : float32 (N,)
        Footprints: centre and deviations along the axes in yarn spacings, correlation of the axes.
    wi, wo : float32 (N, 3)
        Directions.

    Returns
    -------
    float32 (N, K, SUMS), float32 (N,)
        The sums of each kind of yarn (`Table.kinds`), five where the light is behind, and the area seen through gaps.
    """
    count = len(u)
    of_warp, of_weft = table.kinds[0], table.kinds[1]
    kinds = of_warp + of_weft
    result, gaps = np.zeros((count, kinds, SUMS), np.float32), np.zeros(count, np.float32)
    ends, picks, size = table.repeat[0], table.repeat[1], table.grid.shape[2]
    yarn, starts, nodes, evenly = table.yarn, table.starts, table.nodes, table.evenly
    mean, sharpness, thickness = table.mean, table.sharpness, np.float32(table.thickness)
    piece_starts, pieces, bounds = table.piece_starts, table.pieces, table.bounds
    per_azimuth, per_grid = size * size, AZIMUTHS * size * size
    grid, behind_grid = table.grid.reshape(table.grid.size), table.behind_grid.reshape(table.behind_grid.size)
    behind_mean, behind_sharpness = table.behind_mean, table.behind_sharpness

    # Scratch: weights of fixed nodes, and nodes placed in the footprint, of all kinds.
    weight = np.zeros((starts[kinds + 1], BLOCK_NODES), np.float32)
    lines = weight.reshape(starts[kinds + 1] * BLOCK_NODES // COLUMNS, COLUMNS)
    turns = np.zeros((TURN_ROWS, HIGHEST + 1), np.float32)
    density_x = np.zeros((ends, len(table.places), COLUMNS), np.float32)
    density_y = np.zeros((picks, len(table.places), COLUMNS), np.float32)
    touched_x, touched_y = np.zeros(ends, np.bool_), np.zeros(picks, np.bool_)
    columns, rows = np.zeros(ends, np.uint32), np.zeros(picks, np.uint32)
    most = (max(_MOST_NODES, MOST) + BLOCK_NODES - 1) // BLOCK_NODES
    own_nodes = np.zeros((kinds, most, ROWS, BLOCK_NODES), np.float32)
    cells = np.zeros((kinds, most, BLOCK_NODES), np.uint32)
    flat_cells = cells.reshape(kinds, most * BLOCK_NODES)
    line = np.zeros((LINE_ROWS, 8), np.float32)
    stops = np.zeros(kinds, np.int64)
    line_places, line_shares = np.zeros(_POINTS, np.float32), np.zeros(_POINTS, np.float32)

    for n in range(count):
        ix, iy, iz, ox, oy, oz = wi[n, 0], wi[n, 1], wi[n, 2], wo[n, 0], wo[n, 1], wo[n, 2]
        low_i, high_i, turn_i = around(ix, iy)
        low_o, high_o, turn_o = around(ox, oy)
        # Reduced in double precision: single would lose the place of a far centre within the repeat.
        x = np.float64(u[n]) - ends * math.floor(np.float64(u[n]) / ends)
        y = np.float64(v[n]) - picks * math.floor(np.float64(v[n]) / picks)
        dx, dy, rho = deviation_x[n], deviation_y[n], correlation[n]
        narrowest, near_x, near_y = min(dx, dy), dx, dy
        if rho != _0:
            narrowest, blur = np.float32(narrow_axis(dx, dy, rho)), np.sqrt(np.sqrt(_1 - rho * rho))
            near_x, near_y = blur * dx, blur * dy
        thin, shape = narrowest < NARROW and (rho != _0 or max(dx, dy) >= LONG), _ROUND
        if thin:
            shape = ellipse(dx, dy, rho)
            thin = shape.major > STRETCHED * shape.minor and most_nodes(shape) <= MOST
        if not thin and (min(near_x, near_y) >= NARROW or max(near_x, near_y) >= LONG):
            shares = weight
            if narrowest >= table.uniform:
                shares = evenly
            elif narrowest >= table.waves_from:
                wave_weights(
                    table.waves, table.wave_size, table.wave_nodes, evenly, np.float32(x), np.float32(y), dx, dy,
                    rho, narrowest, np.float32(ends), np.float32(picks), turns, weight,
                )  # fmt: skip
            else:
                # Beyond `uniform` an axis is even; the images of a huge footprint are not to be counted.
                blur = np.sqrt(_1 - abs(rho))
                widest_x = np.float32(min(max(blur * dx, RESOLVED), max(table.uniform, LONG)))
                widest_y = np.float32(min(max(blur * dy, RESOLVED), max(table.uniform, LONG)))
                line_x = np.sqrt(abs(rho)) * dx
                line_y = np.copysign(np.sqrt(abs(rho)) * dy, rho)
                lines[:, :] = _0
                for point in range(line_points(rho, COARSE_LINE, line_places, line_shares)):
                    across = axis_densities(
                        table.places, table.weights, COLUMNS, np.float32(x + line_places[point] * line_x), widest_x,
                        np.float32(REACH), density_x, touched_x, columns,
                    )  # fmt: skip
                    along = axis_densities(
                        table.places, table.weights, COLUMNS, np.float32(y + line_places[point] * line_y), widest_y,
                        np.float32(REACH), density_y, touched_y, rows,
                    )  # fmt: skip
                    product_weights(
                        table.group_starts, table.cell_groups, table.groups, density_x, density_y, columns[:across],
                        rows[:along], ends, line_shares[point], lines,
                    )  # fmt: skip
            near_i, near_o = (high_i if turn_i > _HALF else low_i), (high_o if turn_o > _HALF else low_o)
            for kind in range(kinds):
                family = 0 if kind < of_warp else 1
                a, b = starts[kind], starts[kind + 1]
                d = directions(ix, iy, iz, ox, oy, oz, family)
                if iz < _0:
                    light = Horizons(
                        behind_mean[low_i, a:b], behind_mean[high_i, a:b], behind_sharpness[near_i, a:b], turn_i
                    )
                    viewer = Horizons(mean[low_o, a:b], mean[high_o, a:b], sharpness[near_o, a:b], turn_o)
                    through = shade_fixed_behind(
                        nodes[a:b], shares[a:b], light, viewer, d, yarn[family, ALPHA], thickness, yarn[family, BLEND]
                    )
                    for q in range(len(through)):
                        result[n, kind, q] = through[q]
                    continue
                found = shade_fixed(
                    nodes[a:b], shares[a:b], mean[low_i, a:b], mean[high_i, a:b], sharpness[near_i, a:b], turn_i,
                    mean[low_o, a:b], mean[high_o, a:b], sharpness[near_o, a:b], turn_o, d, yarn[family, ALPHA],
                    thickness, yarn[family, BLEND],
                )  # fmt: skip
                for q in range(SUMS):
                    result[n, kind, q] = found[q]
            a, b = starts[kinds], starts[kinds + 1]
            if b > a:
                gaps[n] = shade_gaps(
                    shares[a:b], mean[low_o, a:b], mean[high_o, a:b], sharpness[near_o, a:b], turn_o, oz
                )
            continue

        from_front = GridHorizons(grid, np.uint32(low_o * per_azimuth), np.uint32(high_o * per_azimuth), turn_o)
        stops[:] = 0
        dx, dy = near_x, near_y
        if thin:
            sharp = sharpness_of(shape)
            gaps[n] = place_ellipse(table, shape, x, y, from_front, oz, own_nodes, flat_cells, stops)
        else:
            # Place nodes in every piece touched; a rotated footprint counts as one along the axes of the same area.
            sharp = sharpness_of_points(max(dx, dy))
            left, right, lower, upper = x - REACH * dx, x + REACH * dx, y - REACH * dy, y + REACH * dy
            for row in range(math.floor(lower), math.floor(upper) + 1):
                for column in range(math.floor(left), math.floor(right) + 1):
                    cell = (row % picks) * ends + column % ends
                    for p in range(piece_starts[cell], piece_starts[cell + 1]):
                        x_low, x_high = max(left - column, bounds[p, X_LOW]), min(right - column, bounds[p, X_HIGH])
                        y_low, y_high = max(lower - row, bounds[p, Y_LOW]), min(upper - row, bounds[p, Y_HIGH])
                        if x_high - x_low < _LEAST * dx or y_high - y_low < _LEAST * dy:
                            continue
                        family, first = pieces[p, FAMILY], pieces[p, BLOCK] * per_grid
                        if family == GAP:
                            gaps[n] += gap_area(
                                bounds[p], grid, first, size, low_o * per_azimuth, high_o * per_azimuth, turn_o, sharp,
                                oz, np.float32(x - column), np.float32(y - row), dx, dy, np.float32(x_low),
                                np.float32(x_high), np.float32(y_low), np.float32(y_high),
                            )  # fmt: skip
                        else:
                            kind = column % of_warp if family == 0 else of_warp + row % of_weft
                            stops[kind] = place_nodes(
                                bounds[p], first, size, yarn[family, RADIUS], family, np.float32(x - column),
                                np.float32(y - row), dx, dy, np.float32(x_low), np.float32(x_high), np.float32(y_low),
                                np.float32(y_high), own_nodes[kind], flat_cells[kind], stops[kind], line,
                            )  # fmt: skip
        for kind in range(kinds):
            if stops[kind] == 0:
                continue
            family = 0 if kind < of_warp else 1
            blocks = fill_block(own_nodes[kind], flat_cells[kind], stops[kind])
            d = directions(ix, iy, iz, ox, oy, oz, family)
            if iz < _0:
                from_behind = GridHorizons(
                    behind_grid, np.uint32(low_i * per_azimuth), np.uint32(high_i * per_azimuth), turn_i
                )
                through = shade_footprint_behind(
                    own_nodes[kind, :blocks], cells[kind, :blocks], from_behind, from_front, sharp, d, yarn[family],
                    thickness,
                )  # fmt: skip
                for q in range(len(through)):
                    result[n, kind, q] = through[q]
                continue
            found = shade_footprint(
                own_nodes[kind, :blocks], cells[kind, :blocks], grid, np.uint32(low_i * per_azimuth),
                np.uint32(high_i * per_azimuth), turn_i, np.uint32(low_o * per_azimuth),
                np.uint32(high_o * per_azimuth), turn_o, sharp, d, yarn[family], thickness,
            )  # fmt: skip
            for q in range(SUMS):
                result[n, kind, q] = found[q]
    return result, gaps
