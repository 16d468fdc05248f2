"""Sums of a narrow footprint over nodes that it places itself.

A patch that is almost hidden shows the tail of its footprint: there nodes are placed a second time, finer and farther
out. What is seen of less than `HIDDEN_SHARE` counts as hidden, as it does in the truth.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from pipeline.analytic.soft_horizons import AZIMUTHS, bend_cells, bend_of, sharpness_of_points
from pipeline.analytic.soft_nodes.ellipse_nodes import MOST, Ellipse, place_ellipse, sharpness_of
from pipeline.analytic.soft_nodes.footprint_nodes import (
    MOST_ACROSS,
    REACH,
    CoveredPart,
    Footprint,
    fill_block,
    gap_area,
    place_nodes,
)
from pipeline.analytic.soft_nodes.line_nodes import LineRays, shade_lines, shade_lines_behind
from pipeline.analytic.soft_nodes.nodes import BLOCK, FAMILY, X_HIGH, X_LOW, Y_HIGH, Y_LOW, SoftNodeTable
from pipeline.analytic.soft_nodes.scratch import Scratch, SoftQuery
from pipeline.analytic.soft_nodes.shade import (
    AREA,
    BARE_AREA,
    DIFFUSE,
    OPEN_DIFFUSE,
    OPEN_SPECULAR,
    SPECULAR,
    GridHorizons,
    directions,
    shade_footprint,
    shade_footprint_behind,
    write_sums,
)
from pipeline.analytic.soft_nodes.view_lines import ViewRay, place_on_view_lines
from pipeline.analytic.soft_nodes.wide import NARROW
from pipeline.compiled.arrays import Float32
from pipeline.compiled.decorators import inlined_kernel, kernel
from pipeline.truth.geometry.heightfield import GAP
from pipeline.truth.query import HIDDEN_SHARE

LONG: Final = 0.75
"""Largest deviation along the wider axis for which nodes are placed in a footprint that is narrow along the other axis.
This bounds the number of nodes."""

_HIDDEN = np.float32(0.05)  # share of the bare area seen, below which nodes are placed again:
_PARTS = 2  # in so many parts of the footprint along each axis,
_FAR = 4.3  # to so many deviations
# Cells touched by the parts of a footprint of deviations LONG and NARROW, their pieces, and the nodes of these.
_MOST_CELLS = (_PARTS + 1 + math.ceil(2 * _FAR * LONG)) * (_PARTS + 1 + math.ceil(2 * _FAR * NARROW))
MOST_OF_FOOTPRINT: Final = max(3 * _MOST_CELLS * MOST_ACROSS**2, MOST)
"""Most nodes of a kind of yarn that a footprint places."""

_LEAST = 0.1  # of a deviation, that a footprint must cover of a piece
_0, _1 = np.float32(0.0), np.float32(1.0)
_FROM_ABOVE = np.float32(1e-6)
_JUST = 0.5 - 1e-7  # a half, less what rounding takes: the height at which rays turn has a root
_BETWEEN = np.float32(0.1)  # deviation of the box of a node on a line


@kernel
def _offsets(table: SoftNodeTable, low: int, high: int) -> tuple[np.uint32, np.uint32]:
    """Return what leads from a node's cell to its horizons at two azimuths."""
    per_azimuth = table.grid.shape[2] * table.grid.shape[3]
    return np.uint32(low * per_azimuth), np.uint32(high * per_azimuth)


@kernel
def _place_round(
    table: SoftNodeTable, scratch: Scratch, look: SoftQuery, dx: np.float32, dy: np.float32, reach: float, parts: int
) -> np.float32:  # fmt: skip
    """Place nodes in every piece that a footprint along the axes touches; return the area seen through gaps.

    The footprint ends at `reach` deviations and is cut into `parts` along each axis, which have nodes of their own. For
    gaps, which both sides of the cloth hide, it counts as flat.
    """
    ends, picks, size = table.repeat[0], table.repeat[1], table.grid.shape[2]
    of_warp, of_weft, per_azimuth = table.kinds[0], table.kinds[1], size * size
    viewer = GridHorizons(scratch.grid, *_offsets(table, look.low_o, look.high_o), look.turn_o)
    sharp, gaps = sharpness_of_points(max(dx, dy) / np.float32(parts)), _0
    wide, high, least = 2.0 * reach * dx / parts, 2.0 * reach * dy / parts, _LEAST / parts
    scratch.stops[:] = 0
    for cut in range(parts * parts):
        left, lower = look.x - reach * dx + (cut % parts) * wide, look.y - reach * dy + (cut // parts) * high
        right, upper = left + wide, lower + high
        for row in range(math.floor(lower), math.floor(upper) + 1):
            for column in range(math.floor(left), math.floor(right) + 1):
                cell = (row % picks) * ends + column % ends
                at = Footprint(np.float32(look.x - column), np.float32(look.y - row), dx, dy)
                for p in range(table.piece_starts[cell], table.piece_starts[cell + 1]):
                    bounds = table.bounds[p]
                    x_low, x_high = max(left - column, bounds[X_LOW]), min(right - column, bounds[X_HIGH])
                    y_low, y_high = max(lower - row, bounds[Y_LOW]), min(upper - row, bounds[Y_HIGH])
                    if x_high - x_low < least * dx or y_high - y_low < least * dy:
                        continue
                    family, first = table.pieces[p, FAMILY], table.pieces[p, BLOCK] * AZIMUTHS * per_azimuth
                    part = CoveredPart(np.float32(x_low), np.float32(x_high), np.float32(y_low), np.float32(y_high))
                    if family == GAP:
                        gaps += gap_area(bounds, first, size, viewer, sharp, look.oz, at, part, table.legendre)
                        continue
                    kind = column % of_warp if family == 0 else of_warp + row % of_weft
                    place_nodes(table, scratch, p, first, at, part, kind)
    return gaps


@inlined_kernel
def _shade(table: SoftNodeTable, scratch: Scratch, look: SoftQuery, sharp: np.float32, result: Float32) -> None:
    """Write the sums over the nodes that are placed, (K, NODE_SUMS)."""
    of_warp, kinds = table.kinds[0], table.kinds[0] + table.kinds[1]
    back = look.iz < _0
    grid = scratch.behind_grid if back else scratch.grid
    light = GridHorizons(grid, *_offsets(table, look.low_i, look.high_i), look.turn_i)
    viewer = GridHorizons(scratch.grid, *_offsets(table, look.low_o, look.high_o), look.turn_o)
    for kind in range(kinds):
        if scratch.stops[kind] == 0:
            continue
        family = 0 if kind < of_warp else 1
        yarn = table.yarn[family]
        count = fill_block(scratch.nodes[kind], scratch.cells[kind], scratch.stops[kind])
        d = directions(look.ix, look.iy, look.iz, look.ox, look.oy, look.oz, family)
        nodes, cells, thickness = scratch.nodes[kind], scratch.cells[kind, :count], np.float32(table.thickness)
        if look.bend_o > _0:
            _shade_curved(table, scratch, look, sharp, kind, count, result)
        elif back:
            write_sums(shade_footprint_behind(nodes, cells, light, viewer, sharp, d, yarn, thickness), result[kind])
        else:
            write_sums(shade_footprint(nodes, cells, light, viewer, sharp, d, yarn, thickness), result[kind])


# Not in `_shade`: flat cloth is not to wait for it.
@kernel
def _shade_curved(
    table: SoftNodeTable, scratch: Scratch, look: SoftQuery, sharp: np.float32, kind: int, count: int, result: Float32
) -> None:  # fmt: skip
    """Write the sums over the placed nodes of a kind of yarn, over curved cloth."""
    family = 0 if kind < table.kinds[0] else 1
    low_i, high_i = _offsets(table, look.low_i, look.high_i)
    low_o, high_o = _offsets(table, look.low_o, look.high_o)
    nodes, cells, thickness = scratch.nodes[kind], scratch.cells[kind, :count], np.float32(table.thickness)
    horizons, order, yarn = scratch.curved_narrow, scratch.order[:count], table.yarn[family]
    # Lights behind are hidden by the back, which counts as flat.
    grid, bend_i = (scratch.grid, look.bend_i) if look.iz > _0 else (scratch.behind_grid, _0)
    light, viewer = bend_of(bend_i), bend_of(look.bend_o)
    bend_cells(grid, scratch.grid_falls, cells, low_i, high_i, look.turn_i, light, horizons[:count])
    bend_cells(
        scratch.grid, scratch.grid_falls, cells, low_o, high_o, look.turn_o, viewer, horizons[count : 2 * count]
    )  # fmt: skip
    d = directions(look.ix, look.iy, look.iz, look.ox, look.oy, look.oz, family)
    of_light = GridHorizons(horizons, np.uint32(0), np.uint32(0), _0)
    of_viewer = GridHorizons(horizons, np.uint32(count), np.uint32(count), _0)
    if look.iz < _0:
        write_sums(shade_footprint_behind(nodes, order, of_light, of_viewer, sharp, d, yarn, thickness), result[kind])
    else:
        write_sums(shade_footprint(nodes, order, of_light, of_viewer, sharp, d, yarn, thickness), result[kind])


@inlined_kernel
def sum_ellipse(table: SoftNodeTable, scratch: Scratch, look: SoftQuery, shape: Ellipse, result: Float32) -> np.float32:
    """Write the sums of a thin ellipse (K, NODE_SUMS), and return the area seen through gaps."""
    viewer = GridHorizons(scratch.grid, *_offsets(table, look.low_o, look.high_o), look.turn_o)
    scratch.stops[:] = 0
    gaps = place_ellipse(table, shape, look.x, look.y, viewer, look.oz, scratch.nodes, scratch.cells, scratch.stops)
    _shade(table, scratch, look, sharpness_of(shape), result)
    return gaps


@inlined_kernel
def sum_round(
    table: SoftNodeTable, scratch: Scratch, look: SoftQuery, dx: np.float32, dy: np.float32, result: Float32
) -> np.float32:  # fmt: skip
    """Write the sums of a footprint along the axes (K, NODE_SUMS), and return the area seen through gaps.

    `dx` and `dy` are its deviations; for a rotated footprint those of one along the axes of the same area.
    """
    parts, gaps, seen = 1, _0, _0
    # One place that calls: two made every query slower by a sixth.
    while True:
        gaps = _place_round(table, scratch, look, dx, dy, REACH if parts == 1 else _FAR, parts)
        _shade(table, scratch, look, sharpness_of_points(max(dx, dy) / np.float32(parts)), result)
        seen, bare = gaps, gaps
        for kind in range(len(result)):
            seen += result[kind, AREA]
            bare += result[kind, BARE_AREA]
        if parts > 1 or seen >= _HIDDEN * bare:
            break
        parts = _PARTS
        result[:, :] = _0
    if parts > 1 and seen < np.float32(HIDDEN_SHARE) * look.oz:
        for q in (DIFFUSE, SPECULAR, OPEN_DIFFUSE, OPEN_SPECULAR):
            result[:, q] = _0
    return gaps


@inlined_kernel
def sum_view_lines(table: SoftNodeTable, scratch: Scratch, look: SoftQuery, result: Float32) -> np.float32:
    """Write the sums of a footprint of view rays (K, NODE_SUMS), and return the area seen through gaps."""
    run = np.hypot(look.ox, look.oy)
    dx, dy = (look.ox / run, look.oy / run) if run > _FROM_ABOVE else (_1, _0)
    run = run / look.oz
    bend, least = float(look.bend_o), table.lowest
    if bend > 0.0 and run > _FROM_ABOVE:
        least = max(least, table.plane - _JUST / (bend * float(run) ** 2))
    ray = ViewRay(float(dx), float(dy), float(run), bend, table.plane, least)
    gaps, inverse = place_on_view_lines(table, scratch, look, ray)
    rays = LineRays(run, np.float32(table.plane), np.float32(2.0) * look.bend_o * run * run, inverse)
    back, of_warp, size = look.iz < _0, table.kinds[0], table.grid.shape[2]
    grid = scratch.behind_grid if back else scratch.grid
    light = GridHorizons(grid, *_offsets(table, look.low_i, look.high_i), look.turn_i)
    sharp, thickness = sharpness_of_points(min(look.narrowest, _BETWEEN)), np.float32(table.thickness)
    falls, fall = scratch.grid_falls, bend_of(look.bend_i)
    for kind in range(len(result)):
        count = scratch.stops[kind]
        if count == 0:
            continue
        family = 0 if kind < of_warp else 1
        d = directions(look.ix, look.iy, look.iz, look.ox, look.oy, look.oz, family)
        draft, firsts, yarn, own = scratch.drafts[kind], scratch.firsts[kind, :count], table.yarn[family], result[kind]
        if back:
            sums = shade_lines_behind(draft, firsts, rays, light, None, fall, size, sharp, d, yarn, family, thickness)
            write_sums(sums, own)
        elif look.bend_i > _0:
            write_sums(
                shade_lines(draft, firsts, rays, light, falls, fall, size, sharp, d, yarn, family, thickness), own
            )
        else:
            write_sums(
                shade_lines(draft, firsts, rays, light, None, fall, size, sharp, d, yarn, family, thickness), own
            )
    return gaps
