"""Gauss-Legendre nodes on every piece of yarn, in single precision: few of them, with soft shadows.

A wide footprint weighs fixed nodes, a tensor rule on every piece of each different cell (x = r sin v across a yarn);
their weights are the Gaussian at the node, summed over all cells alike and over all images of the repeat, a product
of one sum an axis. Each node represents a box: its horizon is the mean of the map over that box, and its visibility
is a ramp as wide as the spread of the horizon there. For a narrow footprint nodes are placed in the part of each piece
that it covers.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from pipeline.analytic.axis_densities import NARROW, axis_densities
from pipeline.analytic.gauss_nodes.footprint_nodes import BANDS, REACH, place_nodes
from pipeline.analytic.gauss_nodes.nodes import GaussNodes, gauss_nodes
from pipeline.analytic.gauss_nodes.weights import even_densities, product_weights
from pipeline.analytic.horizon_points.horizon_map import HorizonMap, horizon_map, locate
from pipeline.analytic.horizon_points.rows import (
    AREA,
    BOTH,
    DIFFUSE,
    INTEGERS,
    IX,
    OX,
    ROWS,
    SEEN,
    SIZE,
    SPECULAR,
    STEEPNESS,
    WARPNESS,
    WEFTNESS,
    WEIGHT,
)
from pipeline.analytic.horizon_points.shading import fill_points, gather, plain_sum, query_rows, shade, shade_all
from pipeline.analytic.soft_horizons import SoftHorizons, above, azimuths_apart, ramp, seen_and_lit, sharpness_of_points
from pipeline.compiled.arrays import Float32, Mask
from pipeline.compiled.decorators import allocating_kernel, fast_kernel, inlined_fast_kernel, kernel
from pipeline.truth.cloth import cloth_side
from pipeline.truth.footprint.mixture import COARSE_LINE, deviations, line_points
from pipeline.truth.footprint.place import EVENLY
from pipeline.truth.geometry.azimuths import azimuth_rows
from pipeline.truth.options import TruthOptions
from pipeline.truth.query import HIDDEN_SHARE, Queries
from weaves.fabric import Fabric

_0, _1, _HALF = np.float32(0.0), np.float32(1.0), np.float32(0.5)
_POINTS = COARSE_LINE.points

Footprints = tuple[Float32, Float32, Float32, Float32, Float32]


class GaussNodesTable:
    """A fabric's nodes, tabulated once.

    Parameters
    ----------
    fabric : Fabric
        The cloth.
    across, along : int
        Nodes across a yarn and along a cell.
    shadows, soft : bool
        Whether points hide one another, and whether by ramps instead of steps.
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
        model = cloth_side(fabric, TruthOptions())
        self.shadows, self.soft, self.across, self.along = shadows, soft, across, along
        self.map = horizon_map(model.front, model.back, grid, azimuths)
        self.nodes = gauss_nodes(model.front, self.map, across, along)

    def answer(self, queries: Queries) -> Float32:
        """Return the components (N, 4); queries are flat and lit from the front."""
        u, v, wi, wo = (
            np.ascontiguousarray(column, np.float32) for column in (queries.u, queries.v, queries.wi, queries.wo)
        )
        footprints, finest = (u, v, *deviations(queries)), np.float32(min(NARROW, 1.0 / self.across))
        return _answer(self.map, self.nodes, footprints, wi, wo, self.along, finest, self.shadows, self.soft)

    def bytes_stored(self) -> int:
        """Return the bytes of map and nodes."""
        return self.map.bytes_stored() + sum(array.nbytes for array in self.nodes)


class _Scratch(NamedTuple):
    """Memory that each query overwrites; `flat_x` and `flat_y` are that of `of_x` and `of_y`, rule after rule.

    `positions` and `weights` are those of the fixed nodes, flat too.
    """

    wide: Float32
    weight: Float32
    values: Float32
    shared: npt.NDArray[np.int32]
    narrow: Float32
    places: npt.NDArray[np.int32]
    of_x: Float32
    of_y: Float32
    flat_x: Float32
    flat_y: Float32
    touched_x: Mask
    touched_y: Mask
    cells: npt.NDArray[np.uint32]
    line: Float32
    line_places: Float32
    line_shares: Float32
    positions: Float32
    weights: Float32


@allocating_kernel
def _scratch_for(table: HorizonMap, fixed: GaussNodes) -> _Scratch:
    """Return what the queries of a call need."""
    ends, picks = table.repeat[0], table.repeat[1]
    kinds, most = fixed.positions.shape
    room = BANDS * fixed.own_positions.shape[1] ** 2
    of_x, of_y = np.zeros((ends, kinds, most), np.float32), np.zeros((picks, kinds, most), np.float32)
    return _Scratch(
        fixed.points.copy(),
        np.zeros(len(fixed.evenly), np.float32),
        np.zeros((9, 1), np.float32),
        np.zeros((4, 1), np.int32),
        np.zeros((ROWS, room), np.float32),
        np.zeros((INTEGERS, room), np.int32),
        of_x,
        of_y,
        of_x.reshape((ends, kinds * most)),
        of_y.reshape((picks, kinds * most)),
        np.zeros(ends, np.bool_),
        np.zeros(picks, np.bool_),
        np.zeros(max(ends, picks), np.uint32),
        np.zeros((4, most), np.float32),
        np.zeros(_POINTS, np.float32),
        np.zeros(_POINTS, np.float32),
        fixed.positions.reshape(kinds * most),
        fixed.weights.reshape(kinds * most),
    )


@allocating_kernel
def _answer(
    table: HorizonMap,
    fixed: GaussNodes,
    footprints: Footprints,
    wi: Float32,
    wo: Float32,
    along: int,
    finest: np.float32,
    shadows: bool,
    soft: bool,
) -> Float32:
    """Answer every row; `footprints` has the columns u and v, the deviations along x and y, and their correlation."""
    result = np.zeros((len(wi), 4), np.float32)
    _answer_rows(table, fixed, footprints, wi, wo, along, finest, shadows, soft, _scratch_for(table, fixed), result)
    return result


# Not in `_answer`: what allocates counts references to every slice.
@kernel
def _answer_rows(
    table: HorizonMap,
    fixed: GaussNodes,
    footprints: Footprints,
    wi: Float32,
    wo: Float32,
    along: int,
    finest: np.float32,
    shadows: bool,
    soft: bool,
    scratch: _Scratch,
    result: Float32,
) -> None:
    """Write the components of every row."""
    u, v, deviation_x, deviation_y, correlation = footprints
    ends, picks = table.repeat[0], table.repeat[1]
    nodes, count = table.grid * table.grid, len(fixed.evenly)
    wide, own_weight, values, shared = scratch.wide, scratch.weight, scratch.values, scratch.shared
    narrow, places, line = scratch.narrow, scratch.places, scratch.line
    of_x, of_y, touched_x, touched_y = scratch.of_x, scratch.of_y, scratch.touched_x, scratch.touched_y
    line_places, line_shares = scratch.line_places, scratch.line_shares
    seen, both, areas, diffuse, specular = wide[SEEN], wide[BOTH], wide[AREA], wide[DIFFUSE], wide[SPECULAR]
    warpness, weftness = wide[WARPNESS], wide[WEFTNESS]
    weights, pieces, copies = fixed.weights, fixed.pieces, fixed.copies
    mean, steepness, evenly = fixed.mean, fixed.steepness, fixed.evenly
    azimuths, sharpness = table.azimuths, np.float32(1.0 if soft else 1e9)
    for row in range(len(u)):
        dx, dy, rho = deviation_x[row], deviation_y[row], correlation[row]
        # Narrow footprints that are not round count as round ones of the same area.
        s = dx if dx == dy and rho == _0 else np.sqrt(dx * dy * np.sqrt(_1 - rho * rho))
        x = np.float32(u[row] - ends * np.floor(np.float64(u[row]) / ends))
        y = np.float32(v[row] - picks * np.floor(np.float64(v[row]) / picks))
        if s >= np.float32(NARROW):
            weight = own_weight
            blur, line_x = np.sqrt(_1 - abs(rho)), np.sqrt(abs(rho)) * dx
            line_y = np.copysign(np.sqrt(abs(rho)) * dy, rho)
            # Of a footprint that is not round an axis may be narrower than the nodes are apart.
            blur_x, blur_y = max(blur * dx, finest), max(blur * dy, finest)
            even_x, even_y = blur_x >= np.float32(EVENLY * ends), blur_y >= np.float32(EVENLY * picks)
            if even_x and even_y:
                weight = evenly
            else:
                weight[:] = _0
                for point in range(line_points(rho, COARSE_LINE, line_places, line_shares)):
                    z, share = line_places[point], line_shares[point]
                    _densities(scratch, weights, x + z * line_x, blur_x, even_x, of_x, scratch.flat_x, touched_x)
                    _densities(scratch, weights, y + z * line_y, blur_y, even_y, of_y, scratch.flat_y, touched_y)
                    product_weights(pieces, copies, of_x, of_y, touched_x, touched_y, share, weight)
            for axis in range(3):
                wide[IX + axis], wide[OX + axis] = wi[row, axis], wo[row, axis]
            dot = wi[row, 0] * wo[row, 0] + wi[row, 1] * wo[row, 1]
            wide[SIZE] = _HALF / max(_1 + dot + wi[row, 2] * wo[row, 2], np.float32(1e-6))
            if shadows:
                i0, i1, turn_i = azimuth_rows(wi[row, 0], wi[row, 1], azimuths)
                o0, o1, turn_o = azimuth_rows(wo[row, 0], wo[row, 1], azimuths)
                alike, right, opposite = azimuths_apart(wi[row, 0], wi[row, 1], wo[row, 0], wo[row, 1])
                light = SoftHorizons(mean[i0], mean[i1], np.float32(turn_i), wi[row, 2], steepness[i0])
                viewer = SoftHorizons(mean[o0], mean[o1], np.float32(turn_o), wo[row, 2], steepness[o0])
                _uncover(light, viewer, sharpness, alike, right, opposite, seen, both)
            else:
                seen[:], both[:] = _1, _1
            shade(table, count, weight, wide)
            total_weight = plain_sum(weight, count)
            area, a, b, c, d = gather(count, 0, areas, diffuse, specular, warpness, weftness)
        else:
            points = narrow
            total = place_nodes(table, fixed, x, y, s, along, line, points)
            points[STEEPNESS, :total] = sharpness_of_points(s) if soft else np.float32(1e9)
            query_rows(wi[row], wo[row], azimuths, nodes, values, shared, 0)
            fill_points(points, places, values, shared, 1, total)
            locate(table, total, points, places)
            shade_all(table, total, points, places, shadows)
            total_weight = plain_sum(points[WEIGHT], total)
            area, a, b, c, d = gather(
                total, 0, points[AREA], points[DIFFUSE], points[SPECULAR], points[WARPNESS], points[WEFTNESS]
            )
        if area > np.float32(HIDDEN_SHARE) * wo[row, 2] * total_weight:
            inverse = _1 / area
            result[row, 0], result[row, 1] = a * inverse, b * inverse
            result[row, 2], result[row, 3] = c * inverse, d * inverse


@inlined_fast_kernel
def _densities(
    scratch: _Scratch,
    weights: Float32,
    centre: np.float32,
    s: np.float32,
    even: bool,
    out: Float32,
    flat: Float32,
    touched: Mask,
) -> None:
    """Write the footprint's densities in all cells of one axis; `flat` is the memory of `out`."""
    if even:
        touched[:] = True
        even_densities(weights, s, out)
    else:
        axis_densities(scratch.positions, scratch.weights, centre, s, np.float32(REACH), flat, touched, scratch.cells)


@fast_kernel
def _uncover(
    light: SoftHorizons,
    viewer: SoftHorizons,
    sharpness: np.float32,
    alike: np.float32,
    right: np.float32,
    opposite: np.float32,
    seen: Float32,
    both: Float32,
) -> None:
    """Write which share of each node's box is seen, and which is seen and lit."""
    for k in range(len(seen)):
        o = ramp(above(viewer.z, viewer.first[k], viewer.second[k], viewer.turn, viewer.steepness[k]) * sharpness)
        i = ramp(above(light.z, light.first[k], light.second[k], light.turn, light.steepness[k]) * sharpness)
        seen[k], both[k] = o, seen_and_lit(o, i, alike, right, opposite)
