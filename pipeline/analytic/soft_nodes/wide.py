"""Sums of a wide footprint over the fixed nodes of the cloth, weighted by waves or by the Gaussian over all its images.

A Gaussian along the axes is a product: one outer product of densities for every touched cell and group, and densities
at the nodes of a cell are those of a rule along x times those of a rule along y. A rotated one is a mixture of these
(pipeline.truth.footprint.mixture); waves take any Gaussian.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
import numpy.typing as npt

from pipeline.analytic.soft_horizons import bend_of, bend_rows
from pipeline.analytic.soft_nodes.footprint_nodes import REACH
from pipeline.analytic.soft_nodes.groups import COLUMNS
from pipeline.analytic.soft_nodes.nodes import BLOCK_NODES, GROUP_FAMILY, LINES, RULE_X, RULE_Y, START, SoftNodeTable
from pipeline.analytic.soft_nodes.scratch import Scratch, SoftQuery
from pipeline.analytic.soft_nodes.seen_areas import angle_of, write_areas
from pipeline.analytic.soft_nodes.shade import (
    NodeHorizons,
    directions,
    shade_fixed,
    shade_fixed_behind,
    shade_gaps,
    shares_of,
    write_freed,
    write_sums,
)
from pipeline.analytic.soft_nodes.waves import HIGHEST, TOGETHER, faintest
from pipeline.compiled.arrays import Float32, Mask
from pipeline.compiled.decorators import inlined_fast_kernel, inlined_kernel, kernel
from pipeline.compiled.float32 import remaining
from pipeline.truth.footprint.mixture import COARSE_LINE, line_points
from pipeline.truth.geometry.heightfield import ALPHA, BLEND, WEFT

NARROW: Final = 0.25
"""Deviation, in yarn spacings, below which fixed nodes are too far apart: a footprint places its own."""

RESOLVED: Final = 0.12
"""Least deviation whose density fixed nodes resolve; narrower footprints are widened to it."""

_REACH = np.float32(REACH)
_SHORTEST_RUN = np.float32(1e-6)
_0, _HALF, _1, _2 = np.float32(0.0), np.float32(0.5), np.float32(1.0), np.float32(2.0)


@inlined_fast_kernel
def axis_densities(
    places: Float32,
    weights: Float32,
    centre: np.float32,
    deviation: np.float32,
    density: Float32,
    touched: Mask,
    found: npt.NDArray[np.uint32],
) -> int:
    """Write the Gaussian at the nodes of all rules, times their weights, in the cells of one axis; list those touched.

    `places` and `weights` (n,) are rules within a cell, one after another: a single loop for the vector units. Writes
    `density` (cells, n), `touched` (cells,) and the list of touched cells, `found`; returns their number.
    """
    cells = len(touched)
    reach = _REACH * deviation
    inverse = _1 / deviation
    first, last = int(np.floor(centre - reach)), int(np.floor(centre + reach))
    count = 0
    touched[:] = False
    cell = first % cells
    for column in range(first, last + 1):
        here = density[cell]
        if not touched[cell]:
            touched[cell] = True
            found[count] = cell
            count += 1
            here[:] = _0
        middle = centre - np.float32(column)
        for k in range(len(here)):
            d = (places[k] - middle) * inverse
            here[k] += weights[k] * remaining(_HALF * d * d)
        cell = cell + 1 if cell + 1 < cells else 0
    return count


_TURN = np.float32(2.0 * math.pi)
_DAMPING = np.float32(2.0 * math.pi**2)
_FAINTEST = np.float32(faintest(1.0) ** 2)


@kernel
def waves_kept(size: Float32, narrowest: np.float32) -> int:
    """Return how many waves are not faint under a Gaussian of a least deviation, a multiple of TOGETHER."""
    last, count = _FAINTEST / (narrowest * narrowest), 0
    while count < len(size) and size[count] < last:
        count += TOGETHER
    return count


@inlined_fast_kernel
def wave_weights(table: SoftNodeTable, scratch: Scratch, look: SoftQuery, count: int) -> None:
    """Write the weights of all nodes as a sum of the first `count` waves, a multiple of TOGETHER."""
    waves, repeat, turns, phases, weight = table.waves, table.repeat, scratch.turns, scratch.phases, scratch.weight
    ends, picks = np.float32(repeat[0]), np.float32(repeat[1])
    x, y = np.float32(look.x), np.float32(look.y)
    for axis in range(2):
        angle = _TURN * (x / ends if axis == 0 else y / picks)
        cosine, sine = np.cos(angle), np.sin(angle)
        turns[2 * axis, 0], turns[2 * axis + 1, 0] = _1, _0
        for m in range(HIGHEST):
            p, q = turns[2 * axis, m], turns[2 * axis + 1, m]
            turns[2 * axis, m + 1], turns[2 * axis + 1, m + 1] = p * cosine - q * sine, p * sine + q * cosine
    for h in range(count):
        m, n = waves[h, 0], waves[h, 1]
        of_x, of_y = np.float32(m) / ends * look.dx, np.float32(n) / picks * look.dy
        damping = remaining(_DAMPING * (of_x * of_x + of_y * of_y + _2 * look.rho * of_x * of_y))
        cos_x, sin_x, cos_y, sin_y = turns[0, m], turns[1, m], turns[2, abs(n)], turns[3, abs(n)]
        sin_y = -sin_y if n < 0 else sin_y
        own_phase, at = phases[h // TOGETHER], 2 * (h % TOGETHER)
        own_phase[at] = damping * (cos_x * cos_y - sin_x * sin_y)
        own_phase[at + 1] = damping * (sin_x * cos_y + cos_x * sin_y)
    for b in range(len(weight)):
        for k in range(BLOCK_NODES):
            weight[b, k] = _1
        # Several waves at a time: sums stay in registers.
        own = weight[b]
        for g in range(count // TOGETHER):
            part, phase = table.wave_nodes[b, g], phases[g]
            p0, p1, p2, p3, p4, p5, p6, p7 = (
                phase[0], phase[1], phase[2], phase[3], phase[4], phase[5], phase[6], phase[7]
            )  # fmt: skip
            for k in range(BLOCK_NODES):
                own[k] += (
                    p0 * part[0, k] + p1 * part[1, k] + p2 * part[2, k] + p3 * part[3, k]
                    + p4 * part[4, k] + p5 * part[5, k] + p6 * part[6, k] + p7 * part[7, k]
                )  # fmt: skip
        for k in range(BLOCK_NODES):
            weight[b, k] = max(weight[b, k], _0) * table.evenly[b, k]


@inlined_fast_kernel
def product_weights(table: SoftNodeTable, scratch: Scratch, columns: int, rows: int, share: np.float32) -> None:
    """Add `share` times the weights of all nodes: outer products over a group's touched cells.

    `columns` and `rows` are the numbers of touched cells along both axes.
    """
    ends, groups, weight = table.repeat[0], table.groups, scratch.lines
    for pick in scratch.rows[:rows]:
        for end in scratch.columns[:columns]:
            cell = pick * np.uint32(ends) + end
            for c in range(table.group_starts[cell], table.group_starts[cell + np.uint32(1)]):
                group = groups[table.cell_groups[np.uint32(c)]]
                # Rules follow each other, COLUMNS numbers each.
                at_x, at_y = group[RULE_X] * np.uint32(COLUMNS), group[RULE_Y] * np.uint32(COLUMNS)
                across = scratch.density_x[end, at_x : at_x + COLUMNS]
                along = scratch.density_y[pick, at_y : at_y + COLUMNS]
                if group[GROUP_FAMILY] == WEFT:
                    along, across = across, along
                start = group[START] // np.uint32(COLUMNS)
                for j in range(group[LINES]):
                    factor, own = share * along[j], weight[start + j]
                    for k in range(COLUMNS):
                        own[k] += factor * across[k]


@inlined_fast_kernel
def _density(x: np.float32, y: np.float32, of_xx: np.float32, of_yy: np.float32, of_xy: np.float32) -> np.float32:
    """Return exp(-(of_xx x^2 + of_xy x y + of_yy y^2))."""
    return remaining(of_xx * x * x + (of_yy * y + of_xy * x) * y)


@inlined_fast_kernel
def _add_densities(
    places: Float32, x: np.float32, y: np.float32, of_xx: np.float32, of_yy: np.float32, of_xy: np.float32,
    density: Float32,
) -> None:  # fmt: skip
    """Add the density of a Gaussian around (x, y) at a line of nodes, places (2, COLUMNS)."""
    # Sums first: a loop that stores what it reads is kept from the vector units.
    d0, d1, d2, d3 = (
        _density(places[0, 0] - x, places[1, 0] - y, of_xx, of_yy, of_xy),
        _density(places[0, 1] - x, places[1, 1] - y, of_xx, of_yy, of_xy),
        _density(places[0, 2] - x, places[1, 2] - y, of_xx, of_yy, of_xy),
        _density(places[0, 3] - x, places[1, 3] - y, of_xx, of_yy, of_xy),
    )
    d4, d5, d6, d7 = (
        _density(places[0, 4] - x, places[1, 4] - y, of_xx, of_yy, of_xy),
        _density(places[0, 5] - x, places[1, 5] - y, of_xx, of_yy, of_xy),
        _density(places[0, 6] - x, places[1, 6] - y, of_xx, of_yy, of_xy),
        _density(places[0, 7] - x, places[1, 7] - y, of_xx, of_yy, of_xy),
    )
    density[0] += d0
    density[1] += d1
    density[2] += d2
    density[3] += d3
    density[4] += d4
    density[5] += d5
    density[6] += d6
    density[7] += d7


@inlined_fast_kernel
def displaced_weights(table: SoftNodeTable, scratch: Scratch, look: SoftQuery) -> None:
    """Write the weights of all nodes: the density of a footprint of rays where the viewer sees each of them.

    A node of height h is displaced by d = 2 g T / (1 + sqrt(1 + 2 kappa T^2 g)) towards the viewer (view_lines).
    """
    run = np.sqrt(look.ox * look.ox + look.oy * look.oy)
    ex, ey = (look.ox / run, look.oy / run) if run > _SHORTEST_RUN else (_1, _0)
    run = run / look.oz
    bent, plane = _2 * look.bend_o * run * run, np.float32(table.plane)
    dx, dy, rho = max(look.dx, np.float32(RESOLVED)), max(look.dy, np.float32(RESOLVED)), look.rho
    scale = _1 / (_1 - rho * rho)
    of_xx, of_yy, of_xy = _HALF * scale / (dx * dx), _HALF * scale / (dy * dy), -rho * scale / (dx * dy)
    nearest, farthest = table.shown[0] - plane, table.shown[1] - plane
    nearest = _2 * nearest * run / (_1 + np.sqrt(max(_1 + bent * nearest, _0)))
    farthest = _2 * farthest * run / (_1 + np.sqrt(max(_1 + bent * farthest, _0)))
    x_low, x_high = min(nearest * ex, farthest * ex) - _REACH * dx, max(nearest * ex, farthest * ex) + _REACH * dx
    y_low, y_high = min(nearest * ey, farthest * ey) - _REACH * dy, max(nearest * ey, farthest * ey) + _REACH * dy
    ends, picks, weight, groups = table.repeat[0], table.repeat[1], scratch.lines, table.groups
    weight[:, :] = _0
    seen = scratch.seen
    for line in range(len(seen)):
        spot, own = table.spots[line], seen[line]
        for k in range(COLUMNS):
            over = spot[3, k] - plane
            shift = over * run
            if bent > _0:
                shift *= _2 / (_1 + np.sqrt(max(_1 + bent * over, _0)))
            own[0, k], own[1, k] = spot[0, k] - shift * ex, spot[1, k] - shift * ey
    for row in range(math.floor(look.y + y_low), math.floor(look.y + y_high) + 1):
        middle_y = np.float32(look.y - row)
        for column in range(math.floor(look.x + x_low), math.floor(look.x + x_high) + 1):
            middle_x = np.float32(look.x - column)
            cell = (row % picks) * ends + column % ends
            for c in range(table.group_starts[cell], table.group_starts[cell + 1]):
                group = groups[table.cell_groups[c]]
                start = group[START] // np.uint32(COLUMNS)
                for j in range(group[LINES]):
                    _add_densities(seen[start + j], middle_x, middle_y, of_xx, of_yy, of_xy, weight[start + j])
    for line in range(len(weight)):
        for k in range(COLUMNS):
            weight[line, k] *= table.spots[line, 2, k]


_POINTS: Final = COARSE_LINE.points
# Nanoseconds, of which only the ratios count: of waves, of each in a block of nodes; of densities, of each in a cell of
# an axis, of a line of nodes in a cell.
_WAVES: Final = 200.0
_WAVE: Final = 2.3
_DENSITIES: Final = 100.0
_DENSITY: Final = 0.25
_PRODUCT: Final = 6.0


@inlined_kernel
def _mix_densities(table: SoftNodeTable, scratch: Scratch, look: SoftQuery, widest: float) -> None:
    """Write the weights of all nodes as products of densities along both axes, a mixture for a rotated footprint."""
    rho = look.rho
    blur = np.sqrt(_1 - abs(rho))
    # Beyond `widest` an axis is even; the images of a huge footprint are not to be counted.
    across_x = np.float32(min(max(blur * look.dx, RESOLVED), widest))
    across_y = np.float32(min(max(blur * look.dy, RESOLVED), widest))
    line_x = np.sqrt(abs(rho)) * look.dx
    line_y = np.copysign(np.sqrt(abs(rho)) * look.dy, rho)
    scratch.lines[:, :] = _0
    for point in range(line_points(float(rho), COARSE_LINE, scratch.line_places, scratch.line_shares)):
        columns = axis_densities(
            table.places_x, table.weights_x, np.float32(look.x + scratch.line_places[point] * line_x), across_x,
            scratch.density_x, scratch.touched_x, scratch.columns,
        )  # fmt: skip
        rows = axis_densities(
            table.places_y, table.weights_y, np.float32(look.y + scratch.line_places[point] * line_y), across_y,
            scratch.density_y, scratch.touched_y, scratch.rows,
        )  # fmt: skip
        product_weights(table, scratch, columns, rows, scratch.line_shares[point])


@kernel
def _waves_pay(table: SoftNodeTable, look: SoftQuery, widest: float) -> bool:
    """Return whether waves take less time than densities."""
    waves = _WAVES + _WAVE * waves_kept(table.wave_size, look.narrowest) * len(table.evenly)
    blur = np.sqrt(_1 - abs(look.rho))
    columns = 1.0 + 2.0 * REACH * min(blur * look.dx, widest)
    rows = 1.0 + 2.0 * REACH * min(blur * look.dy, widest)
    touched = min(columns, table.repeat[0]) * min(rows, table.repeat[1])
    densities = _DENSITIES + _DENSITY * (columns * len(table.places_x) + rows * len(table.places_y))
    products = _PRODUCT * touched * table.lines_per_cell
    return bool(waves < (densities + products) * (1 if look.rho == _0 else _POINTS))


@inlined_kernel
def sum_fixed(table: SoftNodeTable, scratch: Scratch, look: SoftQuery, widest: float, result: Float32) -> np.float32:
    """Write the sums of each kind of yarn (K, NODE_SUMS), and return the area seen through gaps.

    `widest` is the deviation from which on an axis is even.
    """
    shares = scratch.weight
    if look.narrowest >= table.uniform:
        shares = table.evenly
    elif table.parallax:
        displaced_weights(table, scratch, look)
    elif look.narrowest >= table.waves_from and _waves_pay(table, look, widest):
        wave_weights(table, scratch, look, waves_kept(table.wave_size, look.narrowest))
    else:
        _mix_densities(table, scratch, look, widest)
    of_warp, kinds = table.kinds[0], table.kinds[0] + table.kinds[1]
    mean, low_i, high_i, low_o, high_o = table.mean, look.low_i, look.high_i, look.low_o, look.high_o
    if look.bend_o > _0:
        bend_rows(mean, table.falls, low_o, high_o, look.turn_o, bend_of(look.bend_o), scratch.curved[1])
        if look.iz > _0:
            bend_rows(mean, table.falls, low_i, high_i, look.turn_i, bend_of(look.bend_i), scratch.curved[0])
        mean, low_i, high_i, low_o, high_o = scratch.curved, 0, 0, 1, 1
    near_i = look.high_i if look.turn_i > _HALF else look.low_i
    near_o = look.high_o if look.turn_o > _HALF else look.low_o
    if table.parallax:
        step, part = angle_of(look.oz)
        write_areas(table.areas, look.low_o, look.high_o, look.turn_o, step, part, scratch.areas)
        if look.bend_o > _0:
            bent = NodeHorizons(mean[low_o], mean[high_o], table.sharpness[near_o], look.turn_o)
            flat = NodeHorizons(table.mean[look.low_o], table.mean[look.high_o], table.sharpness[near_o], look.turn_o)
            write_freed(bent, flat, look.oz, scratch.freed)
        else:
            scratch.freed[:] = _0
    for kind in range(kinds):
        family = 0 if kind < of_warp else 1
        a, b = table.starts[kind], table.starts[kind + 1]
        d = directions(look.ix, look.iy, look.iz, look.ox, look.oy, look.oz, family)
        alpha, blend = table.yarn[family, ALPHA], table.yarn[family, BLEND]
        nodes, own, thickness = table.nodes[a:b], shares[a:b], np.float32(table.thickness)
        areas, freed = scratch.areas[a:b], scratch.freed[a:b]
        viewer = NodeHorizons(mean[low_o, a:b], mean[high_o, a:b], table.sharpness[near_o, a:b], look.turn_o)
        if look.iz < _0:
            behind, sharpness = table.behind_mean, table.behind_sharpness[near_i, a:b]
            light = NodeHorizons(behind[look.low_i, a:b], behind[look.high_i, a:b], sharpness, look.turn_i)
            if table.parallax:
                sums = shade_fixed_behind(nodes, own, light, viewer, areas, freed, d, alpha, thickness, blend)
            else:
                sums = shade_fixed_behind(nodes, own, light, viewer, None, freed, d, alpha, thickness, blend)
            write_sums(sums, result[kind])
        else:
            light = NodeHorizons(mean[low_i, a:b], mean[high_i, a:b], table.sharpness[near_i, a:b], look.turn_i)
            if table.parallax:
                write_sums(
                    shade_fixed(nodes, own, light, viewer, areas, freed, d, alpha, thickness, blend), result[kind]
                )
            else:
                write_sums(
                    shade_fixed(nodes, own, light, viewer, None, freed, d, alpha, thickness, blend), result[kind]
                )
    a, b = table.starts[kinds], table.starts[kinds + 1]
    if b == a:
        return _0
    if table.parallax:
        return shares_of(shares[a:b], scratch.areas[a:b])
    return shade_gaps(
        shares[a:b], mean[low_o, a:b], mean[high_o, a:b], table.sharpness[near_o, a:b],
        look.turn_o, look.oz,
    )  # fmt: skip
