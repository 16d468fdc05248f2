"""Loops that do nothing but evaluate points, for `reports.truth.throughput` to time."""

from __future__ import annotations

import numpy as np

from pipeline.compiled.arrays import Float32
from pipeline.compiled.decorators import allocating_kernel, fast_kernel
from pipeline.truth.cloth import ClothSide, Columns
from pipeline.truth.geometry.azimuths import azimuth_rows
from pipeline.truth.geometry.heightfield import ALPHA, BLEND
from pipeline.truth.node_table.answer import bounded_slope
from pipeline.truth.node_table.build import COLUMNS, FAMILY, FINE_START, ROWS, START, Table
from pipeline.truth.node_table.kernels import reflected, weigh

OPERATIONS = {"specular": (74, 2, 1), "everything": (112, 2, 1)}
"""Arithmetic instructions, square roots and divisions of a point, counted in `reflected` and `weigh`.

A multiplication with an addition is one; so is a maximum, a comparison or a choice. 1 - exp(-x) is 17 of them.
"""


@allocating_kernel
def evaluate_points(model: ClothSide, table: Table, columns: Columns, visibility: bool) -> tuple[float, int]:
    """Evaluate all nodes for every query: specular, and with `visibility` all else; return their sum and count."""
    nodes = table.normal.shape[1]
    buffers = np.ones((6, nodes), np.float32)
    total, points = np.float64(0.0), 0
    one = np.float32(1.0)
    thickness = np.float32(model.front.thickness)
    for row in range(len(columns.u)):
        wi, wo = columns.wi[row], columns.wo[row]
        ix, iy, iz = np.float32(wi[0]), np.float32(wi[1]), np.float32(wi[2])
        ox, oy, oz = np.float32(wo[0]), np.float32(wo[1]), np.float32(wo[2])
        i0, i1, turn_i = azimuth_rows(wi[0], wi[1], len(table.slope))
        o0, o1, turn_o = azimuth_rows(wo[0], wo[1], len(table.slope))
        slope_i, slope_o = (
            np.float32(bounded_slope(wi[0], wi[1], wi[2])),
            np.float32(bounded_slope(wo[0], wo[1], wo[2])),
        )
        for p in range(len(table.pieces)):
            piece = table.pieces[p]
            start, count, family = piece[START], piece[COLUMNS] * piece[ROWS], min(piece[FAMILY], 1)
            stop, f0 = start + count, piece[FINE_START]
            f1 = f0 + count
            yarn = model.front.yarn[family]
            nx, ny, nz, inverse = (
                table.normal[0, start:stop],
                table.normal[1, start:stop],
                table.normal[2, start:stop],
                table.normal[3, start:stop],
            )
            if visibility:
                area, diffuse = weigh(
                    nx, ny, nz, inverse, table.evenly[start:stop], ix, iy, iz, ox, oy, oz,
                    slope_i, table.slope[i0, start:stop], table.slope[i1, start:stop], np.float32(turn_i),
                    slope_o, table.slope[o0, start:stop], table.slope[o1, start:stop], np.float32(turn_o),
                    np.float32(yarn[BLEND]), buffers[0, start:stop], buffers[1, start:stop], buffers[2, start:stop],
                    buffers[3, start:stop], buffers[4, start:stop],
                )  # fmt: skip
                total += area + diffuse
            total += reflected(
                nx, ny, nz, inverse, table.fine[4, f0:f1], table.fine[5, f0:f1], table.fine[6, f0:f1],
                ix, iy, iz, ox, oy, oz, np.float32(yarn[ALPHA] ** 2), thickness, one, one,
                buffers[0, start:stop], buffers[5, start:stop],
            )  # fmt: skip
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
