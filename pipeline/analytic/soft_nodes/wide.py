"""Sums of a wide footprint over the fixed nodes of the cloth, weighted by its Gaussian where the viewer sees them."""

import math
from typing import Final, NamedTuple

import numpy as np

from pipeline.analytic.soft_horizons import bend_of, bend_rows
from pipeline.analytic.soft_nodes.groups import COLUMNS
from pipeline.analytic.soft_nodes.nodes import LINES, START, SoftNodeTable
from pipeline.analytic.soft_nodes.scratch import Scratch, SoftQuery
from pipeline.analytic.soft_nodes.seen_areas import angle_of, write_areas
from pipeline.analytic.soft_nodes.shade import NodeHorizons, directions, shade_fixed, shares_of, write_freed, write_sums
from pipeline.compiled.arrays import Float32
from pipeline.compiled.decorators import inlined_fast_kernel, inlined_kernel
from pipeline.compiled.float32 import remaining

RESOLVED: Final = 0.12  # least deviation whose density fixed nodes resolve; narrower footprints are widened to it

_TAIL = np.float32(5.0)
_REACH = np.float32(2.6)  # deviations at which a footprint is cut off; 1 % of it lies beyond
_CHEAPER: Final = 4.0  # time of a line of nodes in a loop over cells, over that in one over all nodes
_SHORTEST_RUN = np.float32(1e-6)
_0, _HALF, _1, _2 = np.float32(0.0), np.float32(0.5), np.float32(1.0), np.float32(2.0)


class Sight(NamedTuple):
    """How a viewer sees heights displaced: azimuth (ex, ey), distance in the plane for each unit of height, T.

    `bent` is 2 kappa T^2 over cloth of curvature kappa.
    """

    ex: np.float32
    ey: np.float32
    run: np.float32
    bent: np.float32


@inlined_fast_kernel
def sight(ox: np.float32, oy: np.float32, oz: np.float32, bend: np.float32) -> Sight:
    """Return the sight of a viewer in whose azimuth the cloth has a curvature `bend`."""
    run = np.sqrt(ox * ox + oy * oy)
    ex, ey = (ox / run, oy / run) if run > _SHORTEST_RUN else (_1, _0)
    run = run / oz
    return Sight(ex, ey, run, _2 * bend * run * run)


@inlined_fast_kernel
def where_seen(table: SoftNodeTable, of: Sight, seen: Float32) -> None:
    """Write where the viewer sees the fixed nodes, from the corner of their cell, in x and in y, (2, nodes).

    A node of height h is displaced by d = 2 g T / (1 + sqrt(1 + 2 kappa T^2 g)) towards the viewer (view_rays).
    """
    plane = np.float32(table.plane)
    for line in range(len(table.spots)):
        spot, own = table.spots[line], seen[:, COLUMNS * line :]
        for k in range(COLUMNS):
            over = spot[3, k] - plane
            shift = over * of.run
            if of.bent > _0:
                shift *= _2 / (_1 + np.sqrt(max(_1 + of.bent * over, _0)))
            own[0, k], own[1, k] = spot[0, k] - shift * of.ex, spot[1, k] - shift * of.ey


@inlined_fast_kernel
def touched(
    table: SoftNodeTable, of: Sight, dx: np.float32, dy: np.float32
) -> tuple[np.float32, np.float32, np.float32, np.float32]:
    """Return the extent around a footprint's centre that it may see: least and greatest x, least and greatest y."""
    plane = np.float32(table.plane)
    nearest, farthest = table.shown[0] - plane, table.shown[1] - plane
    nearest = _2 * nearest * of.run / (_1 + np.sqrt(max(_1 + of.bent * nearest, _0)))
    farthest = _2 * farthest * of.run / (_1 + np.sqrt(max(_1 + of.bent * farthest, _0)))
    return (
        min(nearest * of.ex, farthest * of.ex) - _REACH * dx, max(nearest * of.ex, farthest * of.ex) + _REACH * dx,
        min(nearest * of.ey, farthest * of.ey) - _REACH * dy, max(nearest * of.ey, farthest * of.ey) + _REACH * dy,
    )  # fmt: skip


@inlined_fast_kernel
def form(dx: np.float32, dy: np.float32, rho: np.float32) -> tuple[np.float32, np.float32, np.float32]:
    """Return the numbers of `density` of a footprint."""
    scale = _1 / (_1 - rho * rho)
    return _HALF * scale / (dx * dx), _HALF * scale / (dy * dy), -rho * scale / (dx * dy)


@inlined_fast_kernel
def density(x: np.float32, y: np.float32, of_xx: np.float32, of_yy: np.float32, of_xy: np.float32) -> np.float32:
    """Return exp(-(of_xx x^2 + of_xy x y + of_yy y^2))."""
    return remaining(of_xx * x * x + (of_yy * y + of_xy * x) * y)


@inlined_fast_kernel
def _add_densities(
    places: Float32, x: np.float32, y: np.float32, of_xx: np.float32, of_yy: np.float32, of_xy: np.float32,
    found: Float32,
) -> None:  # fmt: skip
    """Add the density of a Gaussian around (x, y) at a line of nodes, places (2, nodes from the first on)."""
    # Sums first: a loop that stores what it reads is kept from the vector units.
    d0, d1, d2, d3 = (
        density(places[0, 0] - x, places[1, 0] - y, of_xx, of_yy, of_xy),
        density(places[0, 1] - x, places[1, 1] - y, of_xx, of_yy, of_xy),
        density(places[0, 2] - x, places[1, 2] - y, of_xx, of_yy, of_xy),
        density(places[0, 3] - x, places[1, 3] - y, of_xx, of_yy, of_xy),
    )
    d4, d5, d6, d7 = (
        density(places[0, 4] - x, places[1, 4] - y, of_xx, of_yy, of_xy),
        density(places[0, 5] - x, places[1, 5] - y, of_xx, of_yy, of_xy),
        density(places[0, 6] - x, places[1, 6] - y, of_xx, of_yy, of_xy),
        density(places[0, 7] - x, places[1, 7] - y, of_xx, of_yy, of_xy),
    )
    found[0] += d0
    found[1] += d1
    found[2] += d2
    found[3] += d3
    found[4] += d4
    found[5] += d5
    found[6] += d6
    found[7] += d7


@inlined_fast_kernel
def _write_sums_along(places: Float32, centre: float, low: int, high: int, of: np.float32, found: Float32) -> None:
    """Write sums of exp(-of x^2) over all repeats at nodes, for cells in sight along an axis, (cells, nodes)."""
    for cell in range(low, min(high + 1, low + len(found))):
        found[cell % len(found)] = _0
    for cell in range(low, high + 1):
        middle, own = np.float32(centre - cell), found[cell % len(found)]
        for k in range(len(places)):
            x = places[k] - middle
            own[k] += remaining(of * x * x)


@inlined_fast_kernel
def _add_products(first: Float32, second: Float32, found: Float32) -> None:
    """Add the products of as many numbers as `found` has."""
    for k in range(len(found)):
        found[k] += first[k] * second[k]


@inlined_fast_kernel
def displaced_weights(table: SoftNodeTable, scratch: Scratch, look: SoftQuery) -> None:
    """Write the weights of all nodes: the density of a footprint of rays where the viewer sees each of them."""
    of = sight(look.ox, look.oy, look.oz, look.bend_o)
    dx, dy = max(look.dx, np.float32(RESOLVED)), max(look.dy, np.float32(RESOLVED))
    of_xx, of_yy, of_xy = form(dx, dy, look.rho)
    x_low, x_high, y_low, y_high = touched(table, of, dx, dy)
    ends, picks, weight, groups = table.repeat[0], table.repeat[1], scratch.lines, table.groups
    weight[:, :] = _0
    seen = scratch.seen
    where_seen(table, of, seen)
    first_row, last_row = math.floor(look.y + y_low), math.floor(look.y + y_high)
    first_column, last_column = math.floor(look.x + x_low), math.floor(look.x + x_high)
    of_nodes = weight.reshape(weight.size)
    columns, rows = last_column - first_column + 1, last_row - first_row + 1
    if look.rho == _0 and _CHEAPER * columns * rows * scratch.lines_of_cell > len(weight) * (columns + rows):
        # The density is a product, and the same cells of all repeats are summed first.
        _write_sums_along(seen[0], look.x, first_column, last_column, of_xx, scratch.across)
        _write_sums_along(seen[1], look.y, first_row, last_row, of_yy, scratch.along)
        for row in range(first_row, min(last_row, first_row + picks - 1) + 1):
            for column in range(first_column, min(last_column, first_column + ends - 1) + 1):
                end, pick = column % ends, row % picks
                cell = pick * ends + end
                for c in range(table.group_starts[cell], table.group_starts[cell + 1]):
                    group = groups[table.cell_groups[c]]
                    first, last = group[START], group[START] + COLUMNS * group[LINES]
                    _add_products(scratch.across[end, first:], scratch.along[pick, first:], of_nodes[first:last])
    else:
        # At each y a slanted footprint is thin in x: cells beyond `_TAIL` deviations hold less than 1e-5 of it.
        lean, side = look.rho * dx / dy, _TAIL * dx * np.sqrt(_1 - look.rho * look.rho)
        for row in range(first_row, last_row + 1):
            middle_y = np.float32(look.y - row)
            below, above = lean * (_REACH * dy - middle_y - y_high), lean * (_1 - _REACH * dy - middle_y - y_low)
            first = math.floor(look.x + min(below, above) - side + x_low + _REACH * dx)
            last = math.floor(look.x + max(below, above) + side + x_high - _REACH * dx)
            for column in range(max(first_column, first), min(last_column, last) + 1):
                middle_x = np.float32(look.x - column)
                cell = (row % picks) * ends + column % ends
                for c in range(table.group_starts[cell], table.group_starts[cell + 1]):
                    group = groups[table.cell_groups[c]]
                    start = group[START] // np.uint32(COLUMNS)
                    for j in range(start, start + group[LINES]):
                        _add_densities(seen[:, COLUMNS * j :], middle_x, middle_y, of_xx, of_yy, of_xy, weight[j])
    for line in range(len(weight)):
        for k in range(COLUMNS):
            weight[line, k] *= table.spots[line, 2, k]


@inlined_kernel
def sum_fixed(table: SoftNodeTable, scratch: Scratch, look: SoftQuery, again: bool, result: Float32) -> np.float32:
    """Write the sums of each kind of yarn (K, NODE_SUMS), and return the area seen through gaps.

    With `again` the last query was of the same place: weights and areas are there.
    """
    shares = table.evenly if look.narrowest >= table.uniform else scratch.weight
    of_warp, kinds = table.kinds[0], table.kinds[0] + table.kinds[1]
    mean, sharp, low_i, high_i = table.mean, table.sharpness, look.low_i, look.high_i
    near_i = look.high_i if look.turn_i > _HALF else look.low_i
    step, part = angle_of(look.oz)
    low_o, high_o, turn_o = look.low_o, look.high_o, look.turn_o
    if not again:
        if look.narrowest < table.uniform:
            displaced_weights(table, scratch, look)
        write_areas(table.areas, low_o, high_o, turn_o, step, part, scratch.areas)
        scratch.freed[:] = _0
        if look.bend_o > _0:
            bend_rows(mean, table.falls, low_o, high_o, turn_o, bend_of(look.bend_o), scratch.curved[1])
            sharpness = table.sharpness[high_o if turn_o > _HALF else low_o]
            bent = NodeHorizons(scratch.curved[1], scratch.curved[1], sharpness, turn_o)
            write_freed(bent, NodeHorizons(mean[low_o], mean[high_o], sharpness, turn_o), look.oz, scratch.freed)
    if look.iz < _0 and len(table.end_walls) > 0:
        write_areas(table.end_walls, low_o, high_o, turn_o, step, part, scratch.walls)
    if look.bend_o > _0 and look.iz > _0:
        bend_rows(mean, table.falls, low_i, high_i, look.turn_i, bend_of(look.bend_i), scratch.curved[0])
        mean, low_i, high_i = scratch.curved, 0, 0
    if look.iz < _0:
        mean, sharp = table.behind_mean, table.behind_sharpness
    for kind in range(kinds):
        family = 0 if kind < of_warp else 1
        a, b = table.starts[kind], table.starts[kind + 1]
        d = directions(look.ix, look.iy, look.iz, look.ox, look.oy, look.oz, family)
        nodes, own, yarn, thickness = table.nodes[a:b], shares[a:b], table.yarn[family], np.float32(table.thickness)
        areas, freed = scratch.areas[a:b], scratch.freed[a:b]
        light = NodeHorizons(mean[low_i, a:b], mean[high_i, a:b], sharp[near_i, a:b], look.turn_i)
        if look.iz < _0:
            sums = shade_fixed(nodes, own, light, areas, freed, scratch.walls[a:b], d, yarn, thickness)
        else:
            sums = shade_fixed(nodes, own, light, areas, freed, None, d, yarn, thickness)
        write_sums(sums, result[kind])
    a, b = table.starts[kinds], table.starts[kinds + 1]
    return shares_of(shares[a:b], scratch.areas[a:b]) if b > a else _0
