"""Nodes on view lines: what is drafted of each in `view_lines`, and the sums over them.

A draft holds where a node lies on its line, the curve of the yarn along the line, and its float. Height, place and
weight follow from it in the loop that shades the nodes: stores between two loops would keep both from the vector units.
What a footprint of rays sees is cut out before, so every node is seen; the light has soft horizons as elsewhere.
"""

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from pipeline.analytic.soft_horizons import Bend, above, ramp
from pipeline.analytic.soft_nodes import shade
from pipeline.analytic.soft_nodes.nodes import LEVELS, UPPER
from pipeline.analytic.soft_nodes.scratch import DRAFT_ROWS
from pipeline.analytic.soft_nodes.shade import Behind, GridHorizons, NodeFrame, Six, YarnDirections
from pipeline.analytic.torus_frame import Fibre, bend, normal, tangent, turning
from pipeline.compiled.arrays import Float32
from pipeline.compiled.decorators import fast_kernel, inlined_fast_kernel
from pipeline.compiled.float32 import arcsine, remaining
from pipeline.truth.geometry.heightfield import BETA, COS_TWIST, RADIUS, SIN_TWIST, WARP

AT, LENGTH, ACROSS, BY_ACROSS, ALONG_FROM, BY_ALONG, DENSITY, APART = range(8)
"""Angle across the yarn, or place along the line; length, negative of the latter and 0 at a rim; place across and along
the yarn at s = 0, and their changes with s; greatest density of the line, or a rim's weight; distance of the lines."""

FLOAT_BEND, FLOAT_HALF, FLOAT_DROP, BENDING, STEEPEST_SINE, ROWS_FROM, ROWS_PER = range(8, DRAFT_ROWS)
"""Bend radius of the float, negative beneath and 0 if drawn flat, half length and drop; curve and largest sine as in
`SoftNodeTable.bounds`; row of the grid for b = 0 and rows for each unit of b."""

Falls = tuple[npt.NDArray[np.uint8], Bend] | None
"""Falls of the horizons over curved cloth (soft_horizons), and the curvature; None on flat cloth, which has a loop of
its own."""


_0, _1, _2, _HALF = np.float32(0.0), np.float32(1.0), np.float32(2.0), np.float32(0.5)
_RIGHT = np.float32(1.7)  # more than any angle across
_VERTICAL = np.float32(0.99999)
_NEAR_END = np.float32(0.02)  # cells of a grid
_GRAZING = np.float32(1e-3)  # least cosine, over that from above, by which areas are divided
_FAR, _LEVELS, _GAUSS = np.float32(1e9), np.float32(LEVELS), np.float32(1.0 / math.sqrt(3.0))
_INVERSE_PI = np.float32(1.0 / math.pi)


class LineRays(NamedTuple):
    """How the rays of a footprint sink, and its deviation along lines."""

    run: np.float32  # distance in the plane for each unit of height, T
    plane: np.float32  # height of the reference plane
    bent: np.float32  # 2 kappa T^2
    inverse: np.float32  # 1 / deviation of the footprint along the lines


@fast_kernel
def _sine(v: np.float32) -> np.float32:
    """Return the sine of |v| <= pi/2."""
    w = v * v
    series = np.float32(-1 / 5040) + w * np.float32(1 / 362880)
    sine = v * (_1 + w * (np.float32(-1 / 6) + w * (np.float32(1 / 120) + w * series)))
    return min(max(sine, -_VERTICAL), _VERTICAL)


@inlined_fast_kernel
def _node(
    draft: Float32, k: int, rays: LineRays, radius: np.float32, fibre: Fibre, size: np.float32, d: YarnDirections
) -> tuple[NodeFrame, np.float32, np.float32, np.float32, np.float32, np.float32]:  # fmt: skip
    """Return a drafted node: surface, changes of the half vector's cosine with the tangent in its box, weight, cell.

    The changes are along and across the yarn, the cell is row and column of the grid.
    """
    # Place across and along the yarn.
    at, length, across, by_across = draft[AT, k], draft[LENGTH, k], draft[ACROSS, k], draft[BY_ACROSS, k]
    turned, rim = length > _0, length == _0
    of_angle = _sine(min(max(at, -_RIGHT), _RIGHT))
    sine = of_angle if turned else min(max((across + at * by_across) / radius, -_VERTICAL), _VERTICAL)
    cosine = np.sqrt((_1 - sine) * (_1 + sine))
    part_a, part_b = abs(by_across), abs(draft[BY_ALONG, k])
    s = (radius * sine - across) / by_across if turned else at
    length = length * radius * cosine / part_a if turned else -length
    b = draft[ALONG_FROM, k] + s * draft[BY_ALONG, k]
    # Height, and the density where the viewer sees it.
    bends, half, drop = draft[FLOAT_BEND, k], draft[FLOAT_HALF, k], draft[FLOAT_DROP, k]
    beneath, big = bends < _0, abs(bends)
    ring = big - radius * cosine if beneath else big + radius * cosine
    limit = ring * half / big if beneath else _FAR
    on_arc = min(max(b, -limit), limit) if big > _0 else _0
    root = np.sqrt(max((ring - on_arc) * (ring + on_arc), _0))
    over = fibre.beta * (drop - root + abs(b - on_arc) * half / drop if beneath else root - drop) - rays.plane
    fall = np.sqrt(max(_1 + rays.bent * over, _0))
    q = (s - _2 * over * rays.run / (_1 + fall)) * rays.inverse
    weight = draft[DENSITY, k] * length * remaining(_HALF * q * q)
    # Surface.
    angles, inner = bend(sine, cosine, radius, b, draft[BENDING, k], draft[STEEPEST_SINE, k])
    nx, ny, nz = normal(angles, fibre.beta)
    # A(wo) is that of straight rays: dq / ds of the bent ones in its place.
    steep = -(nx * by_across + ny * draft[BY_ALONG, k]) / nz * rays.run
    weight *= (fall - steep) / (fall * max(_1 - steep, _GRAZING)) if rays.bent > _0 else _1
    weight = draft[DENSITY, k] / max(_1 - steep, _GRAZING) if rim else weight
    t = tangent(angles, fibre)
    by_u, by_v = turning(d.ix + d.ox, d.iy + d.oy, d.iz + d.oz, t, angles, fibre)
    half_v = min(_HALF * (length * part_a + draft[APART, k] * part_b) / (radius * cosine), _HALF)
    half_along = _HALF * (length * part_b + draft[APART, k] * part_a)
    last = size - np.float32(0.01)
    return (
        NodeFrame(nx, ny, nz, _1 / nz, t.x, t.y, t.z),
        half_along * inner / angles.cos_u * _GAUSS * by_u,
        half_v * _GAUSS * by_v,
        weight,
        min(max(draft[ROWS_FROM, k] + b * draft[ROWS_PER, k] + UPPER, _0), last),
        min(max((arcsine(sine) * _INVERSE_PI + _HALF) * size + UPPER, _0), last),
    )


@inlined_fast_kernel
def _lit(
    light: GridHorizons, bent: Falls, cell: np.uint32, level: np.float32, sharpness: np.float32
) -> np.float32:  # fmt: skip
    """Return the share of a node that the light reaches."""
    grid, first, last, turn = light.grid, cell + light.low, cell + light.high, light.turn
    over = above(level, np.float32(grid[first]), np.float32(grid[last]), turn, sharpness)
    if bent is not None:
        falls, fall = bent
        little, much = np.float32(falls[fall.low, first]), np.float32(falls[fall.high, first])
        little += turn * (np.float32(falls[fall.low, last]) - little)
        much += turn * (np.float32(falls[fall.high, last]) - much)
        over += (fall.of_low * little + fall.of_high * much) * sharpness
    return ramp(over)


@fast_kernel
def shade_lines(
    draft: Float32, firsts: npt.NDArray[np.uint32], rays: LineRays, light: GridHorizons, bent: Falls,
    sharpness: np.float32, d: YarnDirections, yarn: Float32, family: int, thickness: np.float32, behind: Behind,
    hidden_ends: bool = False,
) -> Six:  # fmt: skip
    """Return the sums over drafted nodes of one family; `firsts` are the first cells of their grids.

    With the light behind, `light` has the horizons of the back. With `hidden_ends` the back then shows, at the rim
    where a float ends, the upright edge of a crossing yarn: light from the float's side does not reach it.
    """
    radius, fibre = yarn[RADIUS], Fibre(yarn[SIN_TWIST], yarn[COS_TWIST], yarn[BETA])
    layer = shade.yarn_layer(yarn, thickness)
    size = light.size
    step_a, step_b = (1, size) if family == WARP else (size, 1)
    level, sharp = (d.iz if behind is None else -d.iz) * _LEVELS, sharpness / _LEVELS
    near_end = _NEAR_END if hidden_ends else -_1
    total = (_0, _0, _0, _0, _0, _0)
    for k in range(len(firsts)):
        frame, along, across, weight, row, column = _node(draft, k, rays, radius, fibre, np.float32(size), d)
        cell = firsts[k] + np.uint32(int(column) * step_a + int(row) * step_b)
        lit = _lit(light, bent, cell, level, sharp)
        if behind is not None and draft[LENGTH, k] == _0:
            inwards = d.iy * draft[ROWS_PER, k]
            inwards = -inwards if row > np.float32(size) - near_end else (inwards if row < near_end else -_1)
            lit = _0 if inwards > _0 else lit
        own = shade.shade_node(d, frame, along, across, _1, lit, weight, layer, behind)
        total = shade.added(total, own)
    return total
