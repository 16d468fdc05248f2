"""Queries answered from a table of nodes, with the error that the table states of itself.

What a sum over nodes gets wrong is mostly where borders of shadows cross nodes. How far a border between two nodes lies
from half-way says how far the sum is off; borders where the horizon jumps stay in doubt, and so does a small share of
every node and of the whole (`lanes.SMOOTH`, `refine.UNSEEN`), fitted once to converged answers about random fabrics.
Where the error asked for is not reached, the nodes on borders are sampled (refine).
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from pipeline.compiled.arrays import Float64, Index
from pipeline.compiled.decorators import kernel
from pipeline.truth.cloth import Columns, Model
from pipeline.truth.footprint.mixture import Line
from pipeline.truth.footprint.place import GAUSSIAN
from pipeline.truth.footprint.sequences import derive
from pipeline.truth.geometry.azimuths import azimuth_rows
from pipeline.truth.geometry.heightfield import ALPHA, BLEND, GAP
from pipeline.truth.monte_carlo import query_scene
from pipeline.truth.node_table.build import COLUMNS, FAMILY, FINE, FINE_START, ROWS, START, Table
from pipeline.truth.node_table.kernels import borders, crossing, reflected, transmitted, weigh
from pipeline.truth.node_table.refine import UNSEEN, refine
from pipeline.truth.node_table.weights import any_weight, fill_weights
from pipeline.truth.query import HIDDEN_SHARE

_SUBDIVISIONS: Final = (2, 4)

_0 = np.float32(0.0)
_STEEPEST = 1e4


@kernel
def bounded_slope(x: float, y: float, z: float) -> float:
    """Return the rise of a direction with z > 0, bounded."""
    return min(z / max(math.sqrt(x * x + y * y), 1e-9), _STEEPEST)


@kernel
def sum_rows(
    model: Model,
    table: Table,
    columns: Columns,
    index: Index,
    relative_error: float,
    absolute_error: float,
    seed: np.uint64,
    line: Line,
) -> tuple[Float64, Float64, Index]:
    """Answer every row: means and standard errors (N, 5), and nodes visited; ellipses at an angle by a `line`.

    Footprints are Gaussian or lie along the axes, the cloth is flat, cosines go to the ply normal, points hide one
    another, and light comes from behind only if the table has horizons there.
    """
    rows, front = len(columns.u), model.front
    means, errors, counts = np.zeros((rows, 5)), np.zeros((rows, 5)), np.zeros(rows, np.int64)
    nodes = table.normal.shape[1]
    weight, lit = np.zeros(nodes, np.float32), np.zeros(nodes, np.float32)
    areas, diffuses, speculars = np.zeros(nodes, np.float32), np.zeros(nodes, np.float32), np.zeros(nodes, np.float32)
    margins, lit_margins = np.zeros(nodes, np.float32), np.zeros(nodes, np.float32)
    cells = max(table.repeat[0], table.repeat[1])
    scratch = np.zeros((2, cells, len(table.edges), table.edges.shape[1] - 1), np.float32)
    touched = np.zeros((2, cells, len(table.edges)), np.bool_)
    points = np.zeros((2, 2 * line.half + 1), np.float32)
    azimuths = len(table.slope)
    moved, known, known_error = np.zeros(5), np.zeros(5), np.zeros(5)
    thickness = np.float32(front.thickness)
    for row in range(rows):
        wi, wo = columns.wi[row], columns.wo[row]
        behind = wi[2] < 0.0
        sign = -1.0 if behind else 1.0
        ix, iy, iz = np.float32(sign * wi[0]), np.float32(sign * wi[1]), np.float32(sign * wi[2])
        ox, oy, oz = np.float32(wo[0]), np.float32(wo[1]), np.float32(wo[2])
        # Light from behind travels in its own azimuth, not in that of -wi.
        i0, i1, turn_i = azimuth_rows(wi[0], wi[1], azimuths)
        o0, o1, turn_o = azimuth_rows(wo[0], wo[1], azimuths)
        b0, b1, turn_b = azimuth_rows(-wo[0], -wo[1], azimuths)
        ti, to, tb = np.float32(turn_i), np.float32(turn_o), np.float32(turn_b)
        slope_i, slope_o = (
            np.float32(bounded_slope(wi[0], wi[1], abs(wi[2]))),
            np.float32(bounded_slope(wo[0], wo[1], wo[2])),
        )
        horizon_i = table.slope_behind if behind else table.slope
        half = (wi[0] + wo[0]) ** 2 + (wi[1] + wo[1]) ** 2 + (wi[2] + wo[2]) ** 2
        size = np.float32(1.0 / max(half, 1e-12))

        even = model.shape == GAUSSIAN and min(columns.sigma[row], columns.sigma_minor[row]) >= table.uniform
        if not even:
            fill_weights(table, model.shape, columns, row, scratch, touched, line, points, weight)
        shares = table.evenly if even else weight

        area, area_error, moved_area = np.float64(0.0), np.float64(0.0), np.float64(0.0)
        moved[:] = 0.0
        sums, squares = means[row], errors[row]
        for p in range(len(table.pieces)):
            piece = table.pieces[p]
            start, across, count, family = piece[START], piece[COLUMNS], piece[COLUMNS] * piece[ROWS], piece[FAMILY]
            stop = start + count
            share = shares[start:stop]
            if not any_weight(share):
                continue
            counts[row] += count
            yarn = front.yarn[min(family, 1)]
            # What passes a gap must clear both sides of the cloth on its straight way: it is lit by its own ray.
            gap = family == GAP
            a, c = weigh(
                table.normal[0, start:stop],
                table.normal[1, start:stop],
                table.normal[2, start:stop],
                table.normal[3, start:stop],
                share,
                -ox if gap else ix,
                -oy if gap else iy,
                oz if gap else iz,
                ox,
                oy,
                oz,
                slope_o if gap else slope_i,
                table.slope_behind[b0, start:stop] if gap else horizon_i[i0, start:stop],
                table.slope_behind[b1, start:stop] if gap else horizon_i[i1, start:stop],
                tb if gap else ti,
                slope_o,
                table.slope[o0, start:stop],
                table.slope[o1, start:stop],
                to,
                np.float32(yarn[BLEND]),
                lit[start:stop],
                areas[start:stop],
                diffuses[start:stop],
                margins[start:stop],
                lit_margins[start:stop],
            )
            speculars[start:stop] = _0
            if gap:
                areas[start:stop] = oz * lit[start:stop]
                margins[start:stop] = lit_margins[start:stop]
                a = c / oz
                sums[4] += a
            else:
                square = np.float32(yarn[ALPHA] ** 2)
                f0 = piece[FINE_START]
                f1 = f0 + count
                sums[4] += crossing(
                    table.normal[0, start:stop],
                    table.normal[1, start:stop],
                    table.normal[2, start:stop],
                    table.fine[4, f0:f1],
                    table.fine[5, f0:f1],
                    table.fine[6, f0:f1],
                    ox,
                    oy,
                    oz,
                    square,
                    thickness,
                    areas[start:stop],
                )
            area += a
            if not gap and c > 0.0:
                sums[2 + family] += c / math.pi
                counts[row] += count * (piece[FINE] - 1)
                scale = np.float32(yarn[ALPHA] ** 3 / (4.0 * math.pi * piece[FINE]))
                for _ in range(piece[FINE]):
                    parts = (
                        table.fine[0, f0:f1],
                        table.fine[1, f0:f1],
                        table.fine[2, f0:f1],
                        table.fine[3, f0:f1],
                        table.fine[4, f0:f1],
                        table.fine[5, f0:f1],
                        table.fine[6, f0:f1],
                    )
                    if behind:
                        sums[family] += transmitted(
                            *parts,
                            ix,
                            iy,
                            iz,
                            ox,
                            oy,
                            oz,
                            square,
                            thickness,
                            size,
                            scale,
                            lit[start:stop],
                            speculars[start:stop],
                        )
                    else:
                        sums[family] += reflected(
                            *parts,
                            ix,
                            iy,
                            iz,
                            ox,
                            oy,
                            oz,
                            square,
                            thickness,
                            size,
                            scale,
                            lit[start:stop],
                            speculars[start:stop],
                        )
                    f0, f1 = f1, f1 + count
            a1, _, a2, _ = borders(areas[start:stop], areas[start:stop], margins[start:stop], across)
            c1, s1, c2, s2 = borders(diffuses[start:stop], speculars[start:stop], lit_margins[start:stop], across)
            moved_area += a1
            area_error += a2
            if not gap:
                moved[family] += s1
                moved[2 + family] += c1 / math.pi
                squares[family] += s2
                squares[2 + family] += c2 / (math.pi * math.pi)

        # Ratios: what borders between nodes move, what they leave in doubt, and what nothing here can see.
        below = wo[2] if model.projected else area
        if area < HIDDEN_SHARE * wo[2]:
            means[row], errors[row] = 0.0, 0.0
            continue
        squares[4] = area_error * (sums[4] / area) ** 2
        squared, doubts = np.float64(0.0), np.float64(0.0)
        for q in range(5):
            mean = sums[q] / below
            inner = 0.0 if model.projected else mean
            shift = moved[q] - inner * moved_area
            doubt = squares[q] + inner * inner * area_error
            means[row, q] = mean
            errors[row, q] = math.sqrt(shift * shift + doubt) / below + UNSEEN * mean
            if q < 4:
                squared += mean * mean
                doubts += errors[row, q] ** 2
        target = max(relative_error**2 * float(squared), absolute_error**2)
        if doubts > target:
            known[:], known_error[:] = means[row], errors[row]
            query, key = query_scene(columns, row), derive(seed, index[row])
            for side in _SUBDIVISIONS:
                means[row], errors[row] = known, known_error
                counts[row] += refine(
                    model,
                    table,
                    query,
                    key,
                    side,
                    shares,
                    areas,
                    diffuses,
                    speculars,
                    margins,
                    lit_margins,
                    below,
                    means[row],
                    errors[row],
                )
                doubts = np.float64(0.0)
                for q in range(4):
                    doubts += errors[row, q] ** 2
                if doubts <= target:
                    break
    return means, errors, counts
