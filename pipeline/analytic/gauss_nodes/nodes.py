"""The fixed nodes of a repeat: a tensor rule on every piece of each different cell, and horizons over their boxes."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np

from pipeline.analytic.gauss_rules import Rule, gauss_rule, overlap
from pipeline.analytic.horizon_points.horizon_map import SLOTS, HorizonMap, locate, slot_of
from pipeline.analytic.horizon_points.rows import (
    INTEGERS,
    ROWS,
    STEP_V,
    STEP_Y,
    X,
    Y,
)
from pipeline.analytic.soft_horizons import over_boxes
from pipeline.compiled.arrays import Float32, Float64, Index
from pipeline.truth.geometry.heightfield import GAP, WEFT, HeightField
from pipeline.truth.geometry.pieces import Piece, cell_pieces
from pipeline.truth.geometry.symmetry import orbits

_LEAST: Final = 0.02  # least deviation of a horizon, in sines: below the resolution of a map of nearest nodes

# Columns of `GaussNodes.pieces`: first node, nodes along x and y, rules along x and y, first copy and number of copies.
FIRST, COUNT_X, COUNT_Y, RULE_X, RULE_Y, COPY, COPIES = range(7)


class GaussNodes(NamedTuple):
    """Fixed nodes of one repeat.

    Attributes
    ----------
    points : float32 (ROWS, N)
        Rows of `locate` at the nodes, and half the extents of their boxes; the other rows depend on the query.
    mean, steepness : float32 (azimuths, N)
        Mean sine of the horizon's elevation over the node's box, and the ramp's steepness.
    evenly : float32 (N,)
        Share of the area.
    pieces : int64 (P, 7)
        Columns FIRST to COPIES.
    copies : int64 (C, 2)
        End and pick of the cells in which pieces lie.
    positions, weights : float32 (R, n)
        Rules: positions within the cell and weights; unused places weigh nothing.
    own_positions, own_weights : float32 (2, n)
        The rule on [-1, 1], across and along.
    """

    points: Float32
    mean: Float32
    steepness: Float32
    evenly: Float32
    pieces: Index
    copies: Index
    positions: Float32
    weights: Float32
    own_positions: Float32
    own_weights: Float32


def gauss_nodes(field: HeightField, table: HorizonMap, across: int, along: int) -> GaussNodes:
    """Place `across` x `along` nodes on every piece of every different cell."""
    picks, ends = field.top.shape
    found = [(orbit, piece) for orbit in orbits(field) for piece in cell_pieces(field, *orbit[0])]
    axes = [_axes(piece, across, along) for _, piece in found]
    rules = list({id(rule): rule for pair in axes for rule in pair}.values())
    number = {id(rule): index for index, rule in enumerate(rules)}
    rows: list[tuple[int, ...]] = []
    copies: list[tuple[int, int]] = []
    parts: list[list[Float64]] = []
    first = 0
    for (orbit, piece), (x, y) in zip(found, axes, strict=True):
        (pick, end), nx, ny = orbit[0], len(x.places), len(y.places)
        rows.append((first, nx, ny, number[id(x)], number[id(y)], len(copies), len(orbit)))
        copies += [(e, p) for p, e in orbit]
        first += nx * ny
        share = np.outer(y.weights, x.weights).ravel() * len(orbit) / (ends * picks)
        # Half boxes, at the points of the Gauss rule of two nodes: in v across the yarn, in yarn spacings along it.
        half_x, half_y = np.tile(np.diff(x.shares) / 2.0, ny), np.repeat(np.diff(y.shares) / 2.0, nx)
        half_v, half_y = (half_y, half_x) if piece.family == WEFT else (half_x, half_y)
        step_v, step_y = half_v * math.pi / math.sqrt(3.0), half_y * (piece.along[1] - piece.along[0]) / math.sqrt(3.0)
        at = end + np.tile(x.places, ny), pick + np.repeat(y.places, nx)
        parts.append([*at, step_v, step_y, share, *_soft_horizons(table, pick * ends + end, piece, x, y)])
    xs, ys, steps_v, steps_y, evenly, mean, spread = (
        np.concatenate(part, axis=-1) for part in zip(*parts, strict=True)
    )
    points, places = np.zeros((ROWS, first), np.float32), np.zeros((INTEGERS, first), np.int32)
    points[X], points[Y] = xs, ys
    locate(table, first, points, places)
    points[STEP_V], points[STEP_Y] = steps_v, steps_y
    own = [np.polynomial.legendre.leggauss(count) for count in (across, along)]
    most = max(across, along)
    return GaussNodes(
        points=points,
        mean=np.ascontiguousarray(mean, np.float32),
        steepness=np.ascontiguousarray(1.0 / (math.sqrt(12.0) * np.maximum(spread, _LEAST)), np.float32),
        evenly=evenly.astype(np.float32),
        pieces=np.array(rows, np.int64),
        copies=np.array(copies, np.int64),
        positions=_filled([rule.places for rule in rules], most),
        weights=_filled([rule.weights for rule in rules], most),
        own_positions=_filled([places for places, _ in own], most),
        own_weights=_filled([weights for _, weights in own], most),
    )


def _axes(piece: Piece, across: int, along: int) -> tuple[Rule, Rule]:
    """Return the rules of a piece along x and y; a gap has one node."""
    if piece.family == GAP:
        across, along = 1, 1
    rules = gauss_rule(*piece.across, across, piece.radius), gauss_rule(*piece.along, along, 0.0)
    return (rules[1], rules[0]) if piece.family == WEFT else rules


def _soft_horizons(table: HorizonMap, cell: int, piece: Piece, x: Rule, y: Rule) -> tuple[Float64, Float64]:
    """Return mean and standard deviation of the horizon over each node's box, (azimuths, nodes)."""
    block = table.blocks[cell * SLOTS + slot_of(piece)]
    shape = (table.azimuths, table.grid, table.grid)
    horizon = table.horizon[block : block + math.prod(shape)].reshape(shape)
    if piece.family == WEFT:
        horizon = horizon.transpose(0, 2, 1)
    edges = np.linspace(0.0, 1.0, table.grid + 1)
    mean, variance = over_boxes(horizon, horizon**2, overlap(y.shares, edges), overlap(x.shares, edges))
    return mean, np.sqrt(variance)


def _filled(rows: list[Float64], count: int) -> Float32:
    """Return rows of `count` numbers, shorter ones filled with 0."""
    return np.array([np.pad(row, (0, count - len(row))) for row in rows], np.float32)
