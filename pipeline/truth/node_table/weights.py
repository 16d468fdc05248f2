"""Weights: the share of a footprint that falls on each node of a table."""

from __future__ import annotations

import math

import numpy as np

from pipeline.compiled.arrays import Float32, Mask
from pipeline.compiled.decorators import fast_kernel, kernel
from pipeline.truth.cloth import Columns
from pipeline.truth.footprint.masses import interval_masses
from pipeline.truth.footprint.mixture import Line, along_axes, line_points
from pipeline.truth.geometry.march import wrap
from pipeline.truth.node_table.build import COLUMNS, KIND_X, KIND_Y, ROWS, START, Table

_0, _1 = np.float32(0.0), np.float32(1.0)


@kernel
def fill_weights(
    table: Table,
    shape: int,
    columns: Columns,
    row: int,
    scratch: Float32,
    touched: Mask,
    line: Line,
    points: Float32,
    weight: Float32,
) -> None:
    """Write the share of a footprint that falls on each node and its copies; a rotated one by a `line` (mixture).

    `scratch` is (2, cells, kinds, n), `touched` (2, cells, kinds): the shares along x and y, and whether there are any;
    `points` (2, line.points) is scratch too.
    """
    weight[:] = _0
    u, v, sigma_x, sigma_y = columns.u[row], columns.v[row], columns.sigma[row], columns.sigma_minor[row]
    if columns.angle[row] == 0.0:
        _add(table, shape, u, v, sigma_x, sigma_y, _1, scratch, touched, weight)
        return
    sigma_x, sigma_y, correlation = along_axes(sigma_x, sigma_y, columns.angle[row])
    blur, shift = math.sqrt(1.0 - abs(correlation)), math.sqrt(abs(correlation))
    shift_x, shift_y = shift * sigma_x, math.copysign(shift, correlation) * sigma_y
    for point in range(line_points(correlation, line, points[0], points[1])):
        z = points[0, point]
        _add(
            table, shape, u + z * shift_x, v + z * shift_y, blur * sigma_x, blur * sigma_y, points[1, point], scratch,
            touched, weight,
        )  # fmt: skip


@kernel
def _add(
    table: Table,
    shape: int,
    u: float,
    v: float,
    sigma_x: float,
    sigma_y: float,
    share: np.float32,
    scratch: Float32,
    touched: Mask,
    weight: Float32,
) -> None:
    """Add `share` of a footprint along the axes."""
    kinds, ends, picks = len(table.edges), table.repeat[0], table.repeat[1]
    for axis in range(2):
        centre, sigma, cells = u, sigma_x, ends
        if axis == 1:
            centre, sigma, cells = v, sigma_y, picks
        centre = wrap(centre, float(cells))
        for cell in range(cells):
            for kind in range(kinds):
                touched[axis, cell, kind] = interval_masses(
                    shape, centre, sigma, float(cells), table.edges[kind], float(cell), scratch[axis, cell, kind]
                )
    for p in range(len(table.pieces)):
        piece = table.pieces[p]
        start, across, lines = piece[START], piece[COLUMNS], piece[ROWS]
        for c in range(table.copies.shape[1]):
            end, pick = table.copies[p, c, 0], table.copies[p, c, 1]
            if touched[0, end, piece[KIND_X]] and touched[1, pick, piece[KIND_Y]]:
                along_x, along_y = scratch[0, end, piece[KIND_X]], scratch[1, pick, piece[KIND_Y]]
                _add_product(along_x[:across], along_y[:lines], share, weight[start : start + across * lines])


@fast_kernel
def _add_product(along_x: Float32, along_y: Float32, share: np.float32, weight: Float32) -> None:
    """Add `share` of the products of the shares along x and along y to the nodes of a grid."""
    across = len(along_x)
    for j in range(len(along_y)):
        if along_y[j] > _0:
            line, factor = weight[j * across : (j + 1) * across], share * along_y[j]
            for i in range(across):
                line[i] += factor * along_x[i]


@fast_kernel
def any_weight(share: Float32) -> bool:
    """Return whether any of the shares is above 0."""
    total = _0
    for k in range(len(share)):
        total += share[k]
    return bool(total > _0)
