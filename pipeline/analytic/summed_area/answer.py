"""The components of queries: four reads of each cluster's tables, and one evaluation of the point model.

A footprint has the nearest level, read bilinearly; one smaller than those of the first level, a sixteenth of a yarn or
more (tables), is answered as that. A long one is the mean of up to `MOST_TAPS` round ones along its longer axis.
Components are sums over clusters, divided by the seen area, as those of points are; patches of which hardly anything is
seen fade to 0, as in the truth. With parallax, these sums are over layers of height as well, each read at its own place
(layers).
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np

from pipeline.analytic.gauss_rules import taps
from pipeline.analytic.soft_horizons import around, ramp
from pipeline.analytic.soft_nodes.shade import YarnDirections, directions
from pipeline.analytic.summed_area.layers import HeightLayer, layers_of
from pipeline.analytic.summed_area.shade import CORNERS, Azimuth, Slots, corner, over_horizon, sum_clusters
from pipeline.analytic.summed_area.tables import OCTAVE_STEPS, TEXEL_AZIMUTHS, ClusterTables
from pipeline.compiled.arrays import Float32, Float64, Index
from pipeline.compiled.decorators import inlined_kernel, kernel
from pipeline.truth.query import Queries

MOST_TAPS: Final = 12
"""Most round footprints in place of a long one."""

_PLACES: Final = taps(MOST_TAPS)
_DENSE = 1.5  # round footprints a ratio of the axes of 1
_ROUND = 1.02  # ratio of the axes up to which a footprint is round

_0, _1, _HALF = np.float32(0.0), np.float32(1.0), np.float32(0.5)
_INVERSE_PI = np.float32(1.0 / math.pi)
_TINY = np.float32(1e-18)
_FADED = np.float32(2e-3)  # seen share of the area at which components have faded to a half


class Rounds(NamedTuple):
    """N footprints as round ones along a line."""

    u: Float32
    v: Float32
    sigma: Float32
    cosine: Float32
    sine: Float32
    """Centre, deviation of each round one, direction of the line, (N,)."""
    readings: Index
    spread: Float32
    """Number of round ones, standard deviation of their places, int64 (N,), float32 (N,)."""
    wi: Float32
    wo: Float32
    """Directions, (N, 3)."""


def rounds(queries: Queries) -> Rounds:
    """Return the footprints of queries as round ones."""
    major, minor = queries.sigma.astype(np.float64), queries.sigma_minor.astype(np.float64)
    major, minor = np.maximum(major, minor), np.minimum(major, minor)
    angle = queries.angle + np.where(queries.sigma < queries.sigma_minor, 0.5 * math.pi, 0.0)
    minor = np.maximum(minor, major * (_DENSE / MOST_TAPS))
    ratio = major / minor
    count = np.where(ratio > _ROUND, np.clip(np.ceil(_DENSE * ratio), 2, MOST_TAPS), 1).astype(np.int64)
    spread = np.where(count > 1, np.sqrt(np.maximum(major**2 - minor**2, 0.0)), 0.0)
    columns = (queries.u, queries.v, np.where(count > 1, minor, np.sqrt(major * minor)), np.cos(angle), np.sin(angle))
    u, v, sigma, cosine, sine, spread, wi, wo = (
        np.ascontiguousarray(column, np.float32) for column in (*columns, spread, queries.wi, queries.wo)
    )
    return Rounds(u, v, sigma, cosine, sine, count, spread, wi, wo)


def answer(tables: ClusterTables, queries: Queries) -> Float32:
    """Return the components of N queries about flat cloth, light and viewer in front, (N, 4)."""
    footprints = rounds(queries)
    layers = layers_of(tables, footprints.sigma, queries.wo)
    result = np.zeros((len(layers), 4), np.float32)
    window = np.zeros(CORNERS, np.int64), np.zeros(CORNERS, np.float32)
    slots = np.zeros((tables.slots.shape[1] + 1, CORNERS), np.uint32)
    _answer_rows(tables, footprints, _PLACES, layers, window, slots, result)
    return result


@inlined_kernel
def azimuth(x: np.float32, y: np.float32) -> Azimuth:
    """Return the azimuths around a direction."""
    fine, _, turn = around(x, y)
    low = fine >> 1
    turn = _HALF * (np.float32(fine & 1) + turn)
    high = low + 1 if low + 1 < TEXEL_AZIMUTHS else 0
    return Azimuth(low, high, high if turn > _HALF else low, turn)


@inlined_kernel
def _level_of(tables: ClusterTables, sigma: np.float32) -> int:
    """Return the level nearest to a deviation, by ratio."""
    octaves = math.log2(max(np.float64(sigma), tables.finest) / tables.finest)
    return min(int(octaves * OCTAVE_STEPS + 0.5), len(tables.levels) - 1)


@inlined_kernel
def find(
    tables: ClusterTables, level: int, x: float | np.float32, y: float | np.float32, texels: Index, weights: Float32
) -> None:
    """Write the texels around a place, (CORNERS,), and their weights."""
    first, n, shift = tables.levels[level, 0], tables.levels[level, 1], tables.levels[level, 2]
    weights[:] = _0
    if n == 0:
        texels[:] = first
        weights[0] = _1
        return
    columns, rows = tables.repeat[0] * n, tables.repeat[1] * n
    x, y = (
        (x - tables.repeat[0] * math.floor(x / tables.repeat[0])) * n - 0.5,
        (y - tables.repeat[1] * math.floor(y / tables.repeat[1])) * n - 0.5,
    )
    left, low = math.floor(x), math.floor(y)
    right, up = np.float32(x - left), np.float32(y - low)
    for dy in range(2):
        row = low + dy
        row = row + rows if row < 0 else (row - rows if row >= rows else row)
        pick = row >> shift
        for dx in range(2):
            column = left + dx
            column = column + columns if column < 0 else (column - columns if column >= columns else column)
            end = column >> shift
            cell = tables.cells[pick * tables.repeat[0] + end]
            texels[2 * dy + dx] = first + (cell * n + row - pick * n) * n + column - end * n
            weights[2 * dy + dx] = (right if dx == 1 else _1 - right) * (up if dy == 1 else _1 - up)


@inlined_kernel
def touched(
    tables: ClusterTables, texels: Index, first: int, last: int, slots: Slots, layer: HeightLayer | None
) -> int:
    """List the blocks from `first` to `last` that any texel has, of a layer those in it: (n, CORNERS); return how many.

    A thin cluster has shares of the layers below and above.
    """
    count = 0
    for block in range(first, last):
        some = False
        for c in range(CORNERS):
            slot = tables.slots[texels[c], block]
            slots[count, c] = slot
            if layer is None:
                some |= slot != np.uint32(0)
            else:
                low, high = layer.middle - layer.half - layer.half, layer.middle + layer.half + layer.half
                some |= slot != np.uint32(0) and tables.extent[slot, 0] < high and tables.extent[slot, 1] > low
        if some:
            count += 1
    return count


@inlined_kernel
def _gap_area(
    tables: ClusterTables, texels: Index, weights: Float32, o: Azimuth, oz: np.float32
) -> tuple[np.float32, np.float32]:
    """Return area and seen area of gaps, over that of the cloth."""
    area, low, width = _0, _0, _0
    for c in range(CORNERS):
        slot = tables.slots[texels[c], tables.starts[2]]
        if slot != np.uint32(0):
            found = corner(tables.surface, tables.horizon, slot, 0, weights[c], o, o)
            area += found[0]
            low += found[7]
            width += found[8]
    return area * oz, area * oz * ramp(over_horizon(oz, low, width, _1 / max(area, _TINY)))


@kernel
def _answer_rows(
    tables: ClusterTables,
    queries: Rounds,
    places: Float64,
    layers: Index,
    window: tuple[Index, Float32],
    slots: Slots,
    result: Float32,
) -> None:
    """Write the components of all queries; `window` (texels and weights) and `slots` are scratch memory."""
    texels, weights = window
    for n in range(len(queries.u)):
        ix, iy, iz = queries.wi[n, 0], queries.wi[n, 1], queries.wi[n, 2]
        ox, oy, oz = queries.wo[n, 0], queries.wo[n, 1], queries.wo[n, 2]
        i, o = azimuth(ix, iy), azimuth(ox, oy)
        by_family = directions(ix, iy, iz, ox, oy, oz, 0), directions(ix, iy, iz, ox, oy, oz, 1)
        level = _level_of(tables, queries.sigma[n])
        count = queries.readings[n] if level < len(tables.levels) - 1 else 1
        area, bare = _0, _0
        for tap in range(count):
            along = queries.spread[n] * places[count, tap]
            x, y = queries.u[n] + along * queries.cosine[n], queries.v[n] + along * queries.sine[n]
            if layers[n] > 1:
                seen, whole = _add_layers(
                    tables, level, x, y, (ox / oz, oy / oz, oz), layers[n], i, o, by_family, window, slots, result[n]
                )
                area += seen
                bare += whole
                continue
            find(tables, level, x, y, texels, weights)
            four = weights[0], weights[1], weights[2], weights[3]
            for family in range(2):
                found = touched(tables, texels, tables.starts[family], tables.starts[family + 1], slots, None)
                if found == 0:
                    continue
                seen, diffuse, specular, whole = sum_clusters(
                    tables, slots, found, four, i, o, by_family[family], tables.yarn[family], None
                )
                area += seen
                bare += whole
                result[n, family] += specular
                result[n, 2 + family] += diffuse
            open_area, open_seen = _gap_area(tables, texels, weights, o, oz)
            area += open_seen
            bare += open_area
        divide(result[n], area, bare)


@inlined_kernel
def _add_layers(
    tables: ClusterTables, level: int, x: float, y: float, seen_from: tuple[np.float32, np.float32, np.float32],
    layers: int, i: Azimuth, o: Azimuth, by_family: tuple[YarnDirections, YarnDirections],
    window: tuple[Index, Float32], slots: Slots, sums: Float32,
) -> tuple[np.float32, np.float32]:  # fmt: skip
    """Add the components under a round footprint of rays, times its seen area; return that and the bare area.

    `seen_from` is the run of the rays along x and y for each unit of height, and their cosine.
    """
    texels, weights = window
    run_x, run_y, oz = seen_from
    lowest, highest = tables.extent[0, 0], tables.extent[0, 1]
    apart = (highest - lowest) / np.float32(layers - 1)
    area, bare = _0, _0
    for number in range(layers):
        layer = HeightLayer(lowest + apart * np.float32(number), _HALF * apart)
        find(tables, level, x + layer.middle * run_x, y + layer.middle * run_y, texels, weights)
        four = weights[0], weights[1], weights[2], weights[3]
        for family in range(2):
            blocks = touched(tables, texels, tables.starts[family], tables.starts[family + 1], slots, layer)
            if blocks == 0:
                continue
            seen, diffuse, specular, whole = sum_clusters(
                tables, slots, blocks, four, i, o, by_family[family], tables.yarn[family], layer
            )
            area += seen
            bare += whole
            sums[family] += specular
            sums[2 + family] += diffuse
    find(tables, level, x - tables.plane * run_x, y - tables.plane * run_y, texels, weights)
    open_area, open_seen = _gap_area(tables, texels, weights, o, oz)
    return area + open_seen, bare + open_area


@kernel
def divide(sums: Float32, area: np.float32, bare: np.float32) -> None:
    """Turn the sums of a query into its components."""
    share = area / (bare + _TINY)
    faded = share * share / (share * share + _FADED * _FADED) / (area + _TINY)
    sums[0] *= faded
    sums[1] *= faded
    sums[2] *= faded * _INVERSE_PI
    sums[3] *= faded * _INVERSE_PI
