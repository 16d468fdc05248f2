"""Gauss-Legendre nodes on every piece of yarn, in single precision: few of them, with soft shadows.

A wide footprint weighs fixed nodes, a tensor rule on every piece of each different cell (x = r sin v across a yarn);
their weights are the Gaussian at the node, summed over all cells alike and over all images of the repeat, a product
of one sum an axis. A node stands for a box: its horizon is the mean of the map's over that box, and what hides it is
a ramp as wide as the horizon spreads there. A narrow footprint places the nodes anew in what it covers of each piece.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from pipeline.truth.cloth import model_of
from pipeline.truth.flat_points import (
    AREA,
    BOTH,
    CURVATURE,
    DIFFUSE,
    DISTANCE,
    INTEGERS,
    IX,
    IY,
    IZ,
    LIMIT,
    NODE,
    OX,
    OY,
    OZ,
    ROWS,
    SEEN,
    SINE,
    SIZE,
    SPECULAR,
    STEEPNESS,
    STEP_V,
    STEP_Y,
    WARPNESS,
    WEFTNESS,
    WEIGHT,
    X,
    Y,
    azimuth_rows,
    fill_lanes,
    gather,
    locate,
    plain_sum,
    query_rows,
    shade,
    shade_all,
)  # fmt: skip
from pipeline.truth.heightfield import GAP, RADIUS, WARP, WEFT, HeightField
from pipeline.truth.horizon_map import HorizonMap, Single, horizon_map, slots
from pipeline.truth.kernel import fast_kernel, kernel
from pipeline.truth.options import TruthOptions
from pipeline.truth.query import HIDDEN_SHARE, Queries
from pipeline.truth.single import remaining
from pipeline.truth.table import orbits
from weaves.fabric import Fabric

NARROW: Final = 0.25
"""Standard deviation, in yarn spacings, below which nodes are placed in the footprint."""

EVENLY: Final = 0.6
"""Standard deviation, in repeats, from which on an axis counts as even."""

_REACH: Final = 3.0  # standard deviations at which a footprint is cut
_SLIVER: Final = 0.05  # pieces of a footprint thinner than so many deviations are left out
_LEAST: Final = 0.02  # least deviation of a horizon, in sines: what a map of nearest nodes does not know
_RAMP, _RAMP_SIGMA = np.float32(0.02), np.float32(0.4)  # width of the ramp in a narrow footprint
_BANDS: Final = 49  # of yarns and gaps that a narrow footprint reaches into, at most: seven an axis

_0, _1, _HALF = np.float32(0.0), np.float32(1.0), np.float32(0.5)
_THIRD = np.float32(1.0 / math.sqrt(3.0))

# Rows of `GaussNodes.pieces`: first node, nodes along x and y, rules along x and y, first copy and number of copies.
FIRST, COUNT_X, COUNT_Y, RULE_X, RULE_Y, COPY, COPIES = range(7)


class GaussNodes(NamedTuple):
    """Fixed nodes of one repeat.

    Attributes
    ----------
    lanes : float32 (ROWS, N)
        What `locate` finds at the nodes, and half the extents of their boxes; other rows are the query's.
    mean, steepness : float32 (azimuths, N)
        Mean sine of the horizon's elevation over the node's box, and the ramp's steepness.
    evenly : float32 (N,)
        Share of the area.
    pieces : int64 (P, 7)
        See above.
    copies : int64 (C, 2)
        End and pick of the cells in which pieces lie.
    positions, weights : float32 (R, n)
        Rules: positions within the cell and weights; unused places weigh nothing.
    own_positions, own_weights : float32 (2, n)
        The rule on [-1, 1], across and along.
    """

    lanes: Single
    mean: Single
    steepness: Single
    evenly: Single
    pieces: npt.NDArray[np.int64]
    copies: npt.NDArray[np.int64]
    positions: Single
    weights: Single
    own_positions: Single
    own_weights: Single


class GaussQuadrature:
    """A fabric's nodes, tabulated once.

    Parameters
    ----------
    fabric : Fabric
        What is asked about.
    across, along : int
        Nodes across a yarn and along a cell.
    shadows, soft : bool
        Whether anything hides anything, and whether softly.
    grid, azimuths : int
        Resolution of the horizon map.
    """

    def __init__(
        self,
        fabric: Fabric,
        across: int,
        along: int,
        shadows: bool = True,
        soft: bool = True,
        grid: int = 16,
        azimuths: int = 32,
    ) -> None:
        model = model_of(fabric, TruthOptions())
        self.shadows, self.soft, self.along = shadows, soft, along
        self.map = horizon_map(model.front, model.back, grid, azimuths)
        self.nodes = gauss_nodes(model.front, self.map, across, along)

    def answer(self, queries: Queries) -> npt.NDArray[np.float32]:
        """Return the components (N, 4); queries are round, flat and lit from the front."""
        u, v, sigma, wi, wo = (np.ascontiguousarray(column, np.float32) for column in queries[:5])
        return _answer(self.map, self.nodes, u, v, sigma, wi, wo, self.along, self.shadows, self.soft)

    def bytes_stored(self) -> int:
        """Return the bytes of map and nodes."""
        return self.map.bytes_stored() + sum(array.nbytes for array in self.nodes)


def gauss_nodes(field: HeightField, table: HorizonMap, across: int, along: int) -> GaussNodes:
    """Place `across` x `along` nodes on every piece of every different cell."""
    picks, ends = field.top.shape
    rules: dict[tuple[float, float, bool, float], int] = {}
    rows: list[tuple[int, ...]] = []
    copies: list[tuple[int, int]] = []
    evenly, means, deviations, xs, ys, steps_v, steps_y = [], [], [], [], [], [], []
    first = 0

    def rule(low: float, high: float, bent: bool, radius: float) -> int:
        return rules.setdefault((low, high, bent, radius), len(rules))

    for orbit in orbits(field.top):
        pick, end = orbit[0]
        for slot, family, low, high in slots(field, pick, end):
            corners = [(low, high)]
            sides = [(low, high)]
            if family == GAP:
                top = int(field.top[pick, end])
                margin, gap = (max(0.0, 0.5 - float(field.yarn[f, RADIUS])) for f in (top, 1 - top))
                wide, deep = (margin, gap) if top == WARP else (gap, margin)
                corners, sides = [(0.0, wide), (1.0 - wide, 1.0)], [(0.0, deep), (1.0 - deep, 1.0)]
            for x_low, x_high in corners:
                for y_low, y_high in sides:
                    radius = 0.0 if family == GAP else float(field.yarn[family, RADIUS])
                    edge = (0.5 - radius, 0.5 + radius)
                    x_range, y_range = (x_low, x_high), (y_low, y_high)
                    if family == WARP:
                        x_range = edge
                    elif family == WEFT:
                        y_range = edge
                    nx, ny = (across if family == f else along for f in (WARP, WEFT))
                    if family == GAP:
                        nx, ny = 1, 1
                    x, wx, bx = _rule(*x_range, nx, family == WARP)
                    y, wy, by = _rule(*y_range, ny, family == WEFT)
                    rx = rule(*x_range, family == WARP, nx)
                    ry = rule(*y_range, family == WEFT, ny)
                    rows.append((first, nx, ny, rx, ry, len(copies), len(orbit)))
                    copies += [(e, p) for p, e in orbit]
                    evenly.append(np.outer(wy, wx).ravel() * len(orbit) / (ends * picks))
                    xs.append(end + np.tile(x, ny))
                    ys.append(pick + np.repeat(y, nx))
                    half_x, half_y = np.tile(np.diff(bx) / 2, ny), np.repeat(np.diff(by) / 2, nx)
                    long = high - low
                    step_v, step_y = (half_x, half_y * long) if family != WEFT else (half_y, half_x * long)
                    steps_v.append(step_v * math.pi / math.sqrt(3.0))
                    steps_y.append(step_y / math.sqrt(3.0))
                    block = table.blocks.reshape(picks, ends, -1)[pick, end, slot]
                    size = table.grid**2 * table.azimuths
                    horizon = table.horizon[block : block + size].reshape(table.azimuths, table.grid, table.grid)
                    if family == WEFT:
                        horizon = horizon.transpose(0, 2, 1)
                    over_x, over_y = _overlap(bx, table.grid), _overlap(by, table.grid)
                    mean = np.einsum("ayx,jy,ix->aji", horizon, over_y, over_x).reshape(table.azimuths, -1)
                    square = np.einsum("ayx,jy,ix->aji", horizon**2, over_y, over_x).reshape(table.azimuths, -1)
                    means.append(mean)
                    deviations.append(np.sqrt(np.maximum(square - mean**2, 0.0)))
                    first += nx * ny
    count = first
    lanes, places = np.zeros((ROWS, count), np.float32), np.zeros((INTEGERS, count), np.int32)
    lanes[X], lanes[Y] = np.concatenate(xs), np.concatenate(ys)
    locate(
        count, lanes[X], lanes[Y], np.int32(ends), np.float32(ends - 1), np.float32(picks - 1), table.top,
        table.pieces.ravel(), table.blocks, np.int32(table.grid), table.yarn[0, 0], table.yarn[1, 0], lanes[SINE],
        lanes[DISTANCE], lanes[CURVATURE], lanes[LIMIT], lanes[WARPNESS], lanes[WEFTNESS], places[NODE],
    )  # fmt: skip
    lanes[STEP_V], lanes[STEP_Y] = np.concatenate(steps_v), np.concatenate(steps_y)
    positions, weights = np.zeros((len(rules), max(across, along))), np.zeros((len(rules), max(across, along)))
    for (low, high, bent, n), index in rules.items():
        positions[index, : int(n)], weights[index, : int(n)], _ = _rule(low, high, int(n), bent)
    own = np.zeros((2, 2, max(across, along)))
    for axis, n in enumerate((across, along)):
        own[0, axis, :n], own[1, axis, :n] = np.polynomial.legendre.leggauss(n)
    spread = np.maximum(np.concatenate(deviations, axis=1), _LEAST)
    return GaussNodes(
        lanes=lanes,
        mean=np.ascontiguousarray(np.concatenate(means, axis=1), np.float32),
        steepness=np.ascontiguousarray(1.0 / (math.sqrt(12.0) * spread), np.float32),
        evenly=np.concatenate(evenly).astype(np.float32),
        pieces=np.array(rows, np.int64),
        copies=np.array(copies, np.int64),
        positions=positions.astype(np.float32),
        weights=weights.astype(np.float32),
        own_positions=own[0].astype(np.float32),
        own_weights=own[1].astype(np.float32),
    )


def _rule(
    low: float, high: float, count: int, bent: bool
) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """Return positions, weights (their sum high - low), and the boxes' borders as shares of what the rule covers."""
    s, w = np.polynomial.legendre.leggauss(count)
    borders = np.concatenate([[0.0], np.cumsum(w) / 2.0])
    if not bent:
        return 0.5 * (low + high) + 0.5 * (high - low) * s, 0.5 * (high - low) * w, borders
    v = 0.5 * math.pi * s
    weight = w * np.cos(v)
    return 0.5 + 0.5 * (high - low) * np.sin(v), (high - low) * weight / weight.sum(), borders


def _overlap(borders: npt.NDArray[np.float64], grid: int) -> npt.NDArray[np.float64]:
    """Return which share of each box lies in each of `grid` even cells, (boxes, grid)."""
    edges = np.linspace(0.0, 1.0, grid + 1)
    share = np.minimum(borders[1:, None], edges[None, 1:]) - np.maximum(borders[:-1, None], edges[None, :-1])
    share = np.maximum(share, 0.0)
    total: npt.NDArray[np.float64] = share / share.sum(axis=1, keepdims=True)
    return total


@kernel
def _answer(
    table: HorizonMap,
    fixed: GaussNodes,
    u: Single,
    v: Single,
    sigma: Single,
    wi: Single,
    wo: Single,
    along: int,
    shadows: bool,
    soft: bool,
) -> npt.NDArray[np.float32]:
    rows, count = len(u), len(fixed.evenly)
    result = np.zeros((rows, 4), np.float32)
    ends, picks = table.repeat[0], table.repeat[1]
    nodes = table.grid * table.grid
    flat = table.pieces.reshape(table.pieces.size)
    wide, own_weight = fixed.lanes.copy(), np.zeros(count, np.float32)
    values, shared = np.zeros((9, 1), np.float32), np.zeros((4, 1), np.int32)
    kinds, most = fixed.positions.shape
    room = _BANDS * fixed.own_positions.shape[1] ** 2
    narrow, places = np.zeros((ROWS, room), np.float32), np.zeros((INTEGERS, room), np.int32)
    of_x, of_y = np.zeros((ends, kinds, most), np.float32), np.zeros((picks, kinds, most), np.float32)
    touched_x, touched_y = np.zeros(ends, np.bool_), np.zeros(picks, np.bool_)
    line = np.zeros((4, most), np.float32)
    # Rows of the fixed nodes, taken once: counting references to slices would cost more than few nodes do.
    ix, iy, iz, ox, oy, oz, size = wide[IX], wide[IY], wide[IZ], wide[OX], wide[OY], wide[OZ], wide[SIZE]
    sine, distance, curvature, limit = wide[SINE], wide[DISTANCE], wide[CURVATURE], wide[LIMIT]
    warpness, weftness, step_v, step_y = wide[WARPNESS], wide[WEFTNESS], wide[STEP_V], wide[STEP_Y]
    seen, both, areas, diffuse, specular = wide[SEEN], wide[BOTH], wide[AREA], wide[DIFFUSE], wide[SPECULAR]
    warp, weft, thickness = table.yarn[0], table.yarn[1], table.thickness
    positions, weights, pieces, copies = fixed.positions, fixed.weights, fixed.pieces, fixed.copies
    mean, steepness, evenly = fixed.mean, fixed.steepness, fixed.evenly
    azimuths, sharpness = table.azimuths, np.float32(1.0 if soft else 1e9)
    for row in range(rows):
        s = sigma[row]
        x = np.float32(u[row] - ends * np.floor(np.float64(u[row]) / ends))
        y = np.float32(v[row] - picks * np.floor(np.float64(v[row]) / picks))
        if s >= np.float32(NARROW):
            weight = own_weight
            even_x, even_y = s >= np.float32(EVENLY * ends), s >= np.float32(EVENLY * picks)
            if even_x and even_y:
                weight = evenly
            else:
                _density(positions, weights, x, s, even_x, of_x, touched_x)
                _density(positions, weights, y, s, even_y, of_y, touched_y)
                _weigh(pieces, copies, of_x, of_y, touched_x, touched_y, weight)
            ix[:], iy[:], iz[:], ox[:], oy[:], oz[:] = (
                wi[row, 0],
                wi[row, 1],
                wi[row, 2],
                wo[row, 0],
                wo[row, 1],
                wo[row, 2],
            )
            dot = wi[row, 0] * wo[row, 0] + wi[row, 1] * wo[row, 1]
            size[:] = _HALF / max(_1 + dot + wi[row, 2] * wo[row, 2], np.float32(1e-6))
            if shadows:
                i0, i1, turn_i = azimuth_rows(wi[row, 0], wi[row, 1], azimuths)
                o0, o1, turn_o = azimuth_rows(wo[row, 0], wo[row, 1], azimuths)
                sines = (wi[row, 0] ** 2 + wi[row, 1] ** 2) * (wo[row, 0] ** 2 + wo[row, 1] ** 2)
                alike = dot / np.sqrt(max(sines, np.float32(1e-20)))
                _uncover(
                    mean[i0], mean[i1], np.float32(turn_i), wi[row, 2], mean[o0], mean[o1], np.float32(turn_o),
                    wo[row, 2], steepness[i0], steepness[o0], sharpness, max(alike, _0), max(-alike, _0), seen, both,
                )  # fmt: skip
            else:
                seen[:], both[:] = _1, _1
            shade(
                count, weight, ix, iy, iz, ox, oy, oz, size, sine, distance, curvature, limit, warpness, weftness, seen,
                both, step_v, step_y, warp, weft, thickness, areas, diffuse, specular,
            )  # fmt: skip
            total_weight = plain_sum(weight, count)
            area, a, b, c, d = gather(count, 0, areas, diffuse, specular, warpness, weftness)
        else:
            lanes = narrow
            total = _place(table, fixed, x, y, s, along, line, lanes)
            lanes[STEEPNESS, :total] = _1 / (_RAMP + _RAMP_SIGMA * s) if soft else np.float32(1e9)
            query_rows(wi[row], wo[row], azimuths, nodes, values, shared, 0)
            fill_lanes(lanes, places, values, shared, 1, total)
            locate(
                total, lanes[X], lanes[Y], np.int32(ends), np.float32(ends - 1), np.float32(picks - 1), table.top, flat,
                table.blocks, np.int32(table.grid), table.yarn[0, 0], table.yarn[1, 0], lanes[SINE], lanes[DISTANCE],
                lanes[CURVATURE], lanes[LIMIT], lanes[WARPNESS], lanes[WEFTNESS], places[NODE],
            )  # fmt: skip
            shade_all(table, total, lanes, places, shadows)
            total_weight = plain_sum(lanes[WEIGHT], total)
            area, a, b, c, d = gather(
                total, 0, lanes[AREA], lanes[DIFFUSE], lanes[SPECULAR], lanes[WARPNESS], lanes[WEFTNESS]
            )
        if area > np.float32(HIDDEN_SHARE) * wo[row, 2] * total_weight:
            inverse = _1 / area
            result[row, 0], result[row, 1], result[row, 2], result[row, 3] = (
                a * inverse,
                b * inverse,
                c * inverse,
                d * inverse,
            )
    return result


@fast_kernel
def _uncover(
    low_i: Single,
    high_i: Single,
    turn_i: np.float32,
    iz: np.float32,
    low_o: Single,
    high_o: Single,
    turn_o: np.float32,
    oz: np.float32,
    steep_i: Single,
    steep_o: Single,
    sharpness: np.float32,
    together: np.float32,
    apart: np.float32,
    seen: Single,
    both: Single,
) -> None:
    """Write which share of each node's box is seen, and which is seen and lit.

    Light and viewer in one azimuth are hidden by the same things (the less), in opposite ones by different things (what
    both leave), and in between as if by chance (the product).
    """
    even = _1 - together - apart
    for k in range(len(seen)):
        o = min(max(_HALF + (oz - low_o[k] - turn_o * (high_o[k] - low_o[k])) * steep_o[k] * sharpness, _0), _1)
        i = min(max(_HALF + (iz - low_i[k] - turn_i * (high_i[k] - low_i[k])) * steep_i[k] * sharpness, _0), _1)
        seen[k] = o
        both[k] = together * min(i, o) + even * i * o + apart * max(i + o - _1, _0)


@fast_kernel
def _density(
    positions: Single,
    weights: Single,
    centre: np.float32,
    s: np.float32,
    even: bool,
    out: Single,
    touched: npt.NDArray[np.bool_],
) -> None:
    """Write the Gaussian at all rules' nodes in all cells of one axis, images summed, times the nodes' weights."""
    cells = len(out)
    touched[:] = even
    if even:
        share = s * np.float32(math.sqrt(2.0 * math.pi)) / np.float32(cells)
        for c in range(cells):
            out[c] = weights * share
        return
    inverse = _1 / s
    reach = np.float32(_REACH) * s
    first, last = int(np.floor(centre - reach)), int(np.floor(centre + reach))
    for column in range(first, last + 1):
        here = out[column % cells]
        if not touched[column % cells]:
            here[:, :] = _0
            touched[column % cells] = True
        middle = centre - np.float32(column)
        for r in range(len(positions)):
            for k in range(positions.shape[1]):
                d = (positions[r, k] - middle) * inverse
                here[r, k] += weights[r, k] * remaining(_HALF * d * d)


@fast_kernel
def _weigh(
    pieces: npt.NDArray[np.int64],
    copies: npt.NDArray[np.int64],
    of_x: Single,
    of_y: Single,
    touched_x: npt.NDArray[np.bool_],
    touched_y: npt.NDArray[np.bool_],
    weight: Single,
) -> None:
    """Write each node's weight: products of both axes, summed over the cells that are alike."""
    weight[:] = _0
    for p in range(len(pieces)):
        first, nx, ny = pieces[p, FIRST], pieces[p, COUNT_X], pieces[p, COUNT_Y]
        for c in range(pieces[p, COPY], pieces[p, COPY] + pieces[p, COPIES]):
            end, pick = copies[c, 0], copies[c, 1]
            if touched_x[end] and touched_y[pick]:
                along_x, along_y = of_x[end, pieces[p, RULE_X]], of_y[pick, pieces[p, RULE_Y]]
                for j in range(ny):
                    line = weight[first + j * nx : first + (j + 1) * nx]
                    for i in range(len(line)):
                        line[i] += along_y[j] * along_x[i]


@kernel
def _place(
    table: HorizonMap,
    fixed: GaussNodes,
    x: np.float32,
    y: np.float32,
    s: np.float32,
    along: int,
    line: Single,
    lanes: Single,
) -> int:
    """Place nodes in what a narrow footprint covers of every piece; return how many."""
    ends, picks = table.repeat[0], table.repeat[1]
    reach, least = np.float32(_REACH) * s, np.float32(_SLIVER) * s
    warp_radius, weft_radius = table.yarn[0, 0], table.yarn[1, 0]
    most = fixed.own_positions.shape[1]
    across = 0
    while across < most and fixed.own_weights[0, across] > _0:
        across += 1
    total = 0
    for low_pick in range(int(np.floor(y - reach)), int(np.floor(y + reach)) + 1):
        pick = low_pick % picks
        for low_end in range(int(np.floor(x - reach)), int(np.floor(x + reach)) + 1):
            end = low_end % ends
            top = table.top[pick * ends + end]
            # Bands of the cell, in each axis: beside the yarn, on it, beside it.
            for band_y in range(3):
                y0, y1 = _band(band_y, weft_radius)
                y0, y1 = max(y0, y - reach - low_pick), min(y1, y + reach - low_pick)
                if y1 - y0 < least:
                    continue
                for band_x in range(3):
                    x0, x1 = _band(band_x, warp_radius)
                    x0, x1 = max(x0, x - reach - low_end), min(x1, x + reach - low_end)
                    if x1 - x0 < least:
                        continue
                    in_warp, in_weft = band_x == 1, band_y == 1
                    family = GAP
                    if in_warp and (top == 0 or not in_weft):
                        family = WARP
                    elif in_weft:
                        family = WEFT
                    nx = across if family == WARP else along
                    ny = across if family == WEFT else along
                    if total + nx * ny > lanes.shape[1]:
                        return total
                    _axis(fixed, x - low_end, s, x0, x1, warp_radius, family == WARP, nx, line[0], line[1])
                    _axis(fixed, y - low_pick, s, y0, y1, weft_radius, family == WEFT, ny, line[2], line[3])
                    half_x, half_y = _HALF * (x1 - x0), _HALF * (y1 - y0)
                    for j in range(ny):
                        for i in range(nx):
                            lanes[X, total] = line[0, i] + np.float32(end)
                            lanes[Y, total] = line[2, j] + np.float32(pick)
                            lanes[WEIGHT, total] = line[1, i] * line[3, j]
                            step_x, step_y = half_x * _THIRD / np.float32(nx), half_y * _THIRD / np.float32(ny)
                            lanes[STEP_V, total] = step_y / weft_radius if family == WEFT else step_x / warp_radius
                            lanes[STEP_Y, total] = step_x if family == WEFT else step_y
                            total += 1
    return total


@kernel
def _band(band: int, radius: np.float32) -> tuple[np.float32, np.float32]:
    if band == 0:
        return _0, _HALF - radius
    return (_HALF - radius, _HALF + radius) if band == 1 else (_HALF + radius, _1)


@kernel
def _axis(
    fixed: GaussNodes,
    centre: np.float32,
    s: np.float32,
    low: np.float32,
    high: np.float32,
    radius: np.float32,
    bent: bool,
    count: int,
    positions: Single,
    weights: Single,
) -> None:
    """Write positions and weights of one axis of a clipped piece: the rule, in v across a yarn, times the Gaussian."""
    rule = 0 if bent else 1
    if bent:
        first = np.float32(math.asin(min(max((low - _HALF) / radius, -_1), _1)))
        last = np.float32(math.asin(min(max((high - _HALF) / radius, -_1), _1)))
    else:
        first, last = low, high
    half, middle = _HALF * (last - first), _HALF * (last + first)
    inverse = _1 / s
    for k in range(count):
        place, weight = middle + half * fixed.own_positions[rule, k], half * fixed.own_weights[rule, k]
        if bent:
            weight *= radius * np.float32(math.cos(place))
            place = _HALF + radius * np.float32(math.sin(place))
        d = (place - centre) * inverse
        positions[k], weights[k] = place, weight * remaining(_HALF * d * d)
