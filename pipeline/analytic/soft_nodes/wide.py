"""Sums of a wide footprint over the fixed nodes of the cloth."""

from __future__ import annotations

from typing import Final

import numpy as np

from pipeline.analytic.axis_densities import axis_densities
from pipeline.analytic.curved_horizons import bend_of, bend_rows
from pipeline.analytic.soft_nodes.footprint_nodes import REACH
from pipeline.analytic.soft_nodes.look import Look
from pipeline.analytic.soft_nodes.nodes import Table
from pipeline.analytic.soft_nodes.scratch import Scratch
from pipeline.analytic.soft_nodes.shade import (
    SUMS,
    Horizons,
    directions,
    shade_fixed,
    shade_fixed_behind,
    shade_gaps,
)
from pipeline.analytic.soft_nodes.weights import product_weights, wave_weights, waves_kept
from pipeline.compiled.arrays import Float32
from pipeline.compiled.decorators import inlined_kernel, kernel
from pipeline.truth.footprint.mixture import COARSE_LINE, line_points
from pipeline.truth.geometry.heightfield import ALPHA, BLEND

RESOLVED: Final = 0.12
"""Least deviation whose density fixed nodes resolve; narrower footprints are widened to it."""

_POINTS: Final = COARSE_LINE.points
# Nanoseconds, of which only the ratios count: of waves, of each in a block of nodes; of densities, of each in a cell of
# an axis, of a line of nodes in a cell.
_WAVES: Final = 200.0
_WAVE: Final = 2.3
_DENSITIES: Final = 100.0
_DENSITY: Final = 0.25
_PRODUCT: Final = 6.0
_0, _1, _HALF = np.float32(0.0), np.float32(1.0), np.float32(0.5)


@inlined_kernel
def _mix_densities(table: Table, scratch: Scratch, look: Look, widest: float) -> None:
    """Write the weights of all nodes as products of densities along both axes, a mixture for a rotated footprint."""
    ends, rho = table.repeat[0], look.rho
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
            np.float32(REACH), scratch.density_x, scratch.touched_x, scratch.columns,
        )  # fmt: skip
        rows = axis_densities(
            table.places_y, table.weights_y, np.float32(look.y + scratch.line_places[point] * line_y), across_y,
            np.float32(REACH), scratch.density_y, scratch.touched_y, scratch.rows,
        )  # fmt: skip
        product_weights(
            table.group_starts, table.cell_groups, table.groups, scratch.density_x, scratch.density_y,
            scratch.columns[:columns], scratch.rows[:rows], ends, scratch.line_shares[point], scratch.lines,
        )  # fmt: skip


@kernel
def _waves_pay(table: Table, look: Look, widest: float) -> bool:
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
def sum_fixed(table: Table, scratch: Scratch, look: Look, widest: float, result: Float32) -> np.float32:
    """Write the sums of each kind of yarn (K, SUMS), and return the area seen through gaps.

    Parameters
    ----------
    table, scratch : Table, Scratch
        The cloth, and memory for its queries.
    look : Look
        The query.
    widest : float
        Deviation from which on an axis is even.
    result : float32 (K, SUMS)
        Written.
    """
    shares = scratch.weight
    if look.narrowest >= table.uniform:
        shares = table.evenly
    elif look.narrowest >= table.waves_from and _waves_pay(table, look, widest):
        wave_weights(
            table.waves, table.wave_nodes, table.evenly, look, waves_kept(table.wave_size, look.narrowest),
            table.repeat, scratch.turns, scratch.phases, scratch.weight,
        )  # fmt: skip
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
    for kind in range(kinds):
        family = 0 if kind < of_warp else 1
        a, b = table.starts[kind], table.starts[kind + 1]
        d = directions(look.ix, look.iy, look.iz, look.ox, look.oy, look.oz, family)
        alpha, blend = table.yarn[family, ALPHA], table.yarn[family, BLEND]
        if look.iz < _0:
            light = Horizons(
                table.behind_mean[look.low_i, a:b], table.behind_mean[look.high_i, a:b],
                table.behind_sharpness[near_i, a:b], look.turn_i,
            )  # fmt: skip
            viewer = Horizons(mean[low_o, a:b], mean[high_o, a:b], table.sharpness[near_o, a:b], look.turn_o)
            through = shade_fixed_behind(
                table.nodes[a:b], shares[a:b], light, viewer, d, alpha, np.float32(table.thickness), blend
            )
            for q in range(len(through)):
                result[kind, q] = through[q]
            continue
        found = shade_fixed(
            table.nodes[a:b], shares[a:b], mean[low_i, a:b], mean[high_i, a:b],
            table.sharpness[near_i, a:b], look.turn_i, mean[low_o, a:b], mean[high_o, a:b],
            table.sharpness[near_o, a:b], look.turn_o, d, alpha, np.float32(table.thickness), blend,
        )  # fmt: skip
        for q in range(SUMS):
            result[kind, q] = found[q]
    a, b = table.starts[kinds], table.starts[kinds + 1]
    if b == a:
        return _0
    return shade_gaps(
        shares[a:b], mean[low_o, a:b], mean[high_o, a:b], table.sharpness[near_o, a:b],
        look.turn_o, look.oz,
    )  # fmt: skip
