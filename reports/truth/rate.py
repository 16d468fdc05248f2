"""Loops that do nothing but evaluate points, for `reports.truth.throughput` to time."""

from __future__ import annotations

import numpy as np

from pipeline.compiled.arrays import Float32
from pipeline.compiled.decorators import allocating_kernel, fast_kernel
from pipeline.truth.cloth import ClothSide, Columns
from pipeline.truth.geometry.heightfield import ALPHA, BLEND
from pipeline.truth.node_table.build import COLUMNS, FAMILY, FINE_START, ROWS, START, Table
from pipeline.truth.node_table.directions import node_directions
from pipeline.truth.node_table.kernels import Horizons, Layer, Normals, Tangents, reflected, weigh
from pipeline.truth.node_table.shares import NodeShares, no_shares

OPERATIONS = {"specular": (74, 2, 1), "everything": (112, 2, 1)}
"""Arithmetic instructions, square roots and divisions of a point, counted in `reflected` and `weigh`.

A multiplication with an addition is one; so is a maximum, a comparison or a choice. 1 - exp(-x) is 17 of them.
"""


@allocating_kernel
def evaluate_points(model: ClothSide, table: Table, columns: Columns, visibility: bool) -> tuple[float, int]:
    """Evaluate all nodes for every query: specular, and with `visibility` all else; return their sum and count."""
    nodes = table.normal.shape[1]
    shares = no_shares(nodes)
    shares.lit[:] = np.float32(1.0)
    total, points = np.float64(0.0), 0
    thickness, one = np.float32(model.front.thickness), np.float32(1.0)
    for row in range(len(columns.u)):
        towards = node_directions(columns.wi[row], columns.wo[row], len(table.slope))
        light, viewer = towards.light, towards.viewer
        for p in range(len(table.pieces)):
            piece = table.pieces[p]
            start, count, family = piece[START], piece[COLUMNS] * piece[ROWS], min(piece[FAMILY], 1)
            stop, f0 = start + count, piece[FINE_START]
            f1 = f0 + count
            yarn = model.front.yarn[family]
            normal = Normals(
                table.normal[0, start:stop],
                table.normal[1, start:stop],
                table.normal[2, start:stop],
                table.normal[3, start:stop],
            )
            own = NodeShares(
                table.evenly[start:stop],
                shares.lit[start:stop],
                shares.areas[start:stop],
                shares.diffuses[start:stop],
                shares.speculars[start:stop],
                shares.margins[start:stop],
                shares.lit_margins[start:stop],
                shares.undecided[start:stop],
            )
            if visibility:
                area, diffuse = weigh(
                    normal,
                    light,
                    Horizons(table.slope[light.first, start:stop], table.slope[light.second, start:stop]),
                    viewer,
                    Horizons(table.slope[viewer.first, start:stop], table.slope[viewer.second, start:stop]),
                    np.float32(yarn[BLEND]),
                    own,
                )
                total += area + diffuse
            tangent = Tangents(table.fine[4, f0:f1], table.fine[5, f0:f1], table.fine[6, f0:f1])
            layer = Layer(np.float32(yarn[ALPHA] ** 2), thickness, one)
            total += reflected(normal, tangent, light, viewer, one, layer, own.lit, own.speculars)
            points += count
    return total, points


@fast_kernel
def multiply_adds(values: Float32, rounds: int) -> np.float32:
    """Run chains of multiply-adds over an array: what arithmetic alone can do on this core."""
    total = np.float32(0.0)
    for _ in range(rounds):
        for k in range(len(values)):
            # A quadratic map: no compiler can run its steps in one.
            a = values[k]
            b = a + a
            for _ in range(16):
                a, b = a * a + b, b * b + a
            total += a + b
    return total


MULTIPLY_ADDS = 2 * 16
"""Multiply-adds that `multiply_adds` does to a value."""
