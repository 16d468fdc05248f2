"""Sums over soft nodes for each query: fixed nodes for a wide footprint of view rays, nodes on lines for a narrow one.

least deviation, of any direction            nodes
below `SoftNodeTable.view_lines`, twice
    that where rays rise again               placed on lines along view rays, unless they were too many
at least `SoftNodeTable.uniform`             fixed ones, which cover the cloth evenly
else                                         fixed ones, by the footprint's density where the viewer sees each of them
"""

import math
from typing import Final

import numpy as np

from pipeline.analytic.soft_horizons import around
from pipeline.analytic.soft_nodes.nodes import SoftNodeTable
from pipeline.analytic.soft_nodes.scratch import MOST_ON_LINES, Scratch, SoftQuery, scratch_for
from pipeline.analytic.soft_nodes.shade import NODE_SUMS
from pipeline.analytic.soft_nodes.view_lines import nodes_on_lines, sum_view_lines
from pipeline.analytic.soft_nodes.wide import sum_fixed
from pipeline.compiled.arrays import Float32
from pipeline.compiled.decorators import kernel
from pipeline.truth.footprint.mixture import Footprints, footprints, narrow_axis
from pipeline.truth.query import Queries
from pipeline.truth.scattering.point import directions_of

LONGEST: Final = 48.0
"""Largest deviation, in yarn spacings, of a footprint that does not cover the cloth evenly across: longer ones see the
same, up to stripes of yarns almost along them, and would touch thousands of cells."""

_0 = np.float32(0.0)
_TINY = 1e-12  # keeps a quotient finite


def query_sums(table: SoftNodeTable, queries: Queries) -> tuple[Float32, Float32]:
    """Return the sums of N queries, the viewer in front, and the areas seen through gaps, (N,).

    The sums (N, K, NODE_SUMS) are of each kind of yarn (`SoftNodeTable.kinds`), five with the light behind. The light
    is behind only if the table knows it; without falls in the table, all cloth counts as flat. Viewers count as no
    lower than LOWEST_VIEWER.
    """
    looks = queries.raised()
    wi, wo, curvature = (np.ascontiguousarray(part, np.float32) for part in (looks.wi, looks.wo, looks.curvature))
    result = np.zeros((len(wi), table.kinds.sum(), NODE_SUMS), np.float32)
    gaps = np.zeros(len(wi), np.float32)
    patches, scratch = footprints(queries), scratch_for(table)
    # Compiled for True and for None, each kind of nodes alone: one kernel for both took a tenth more time.
    for lines in (True, None) if table.view_lines > 0.0 else (None,):
        _sum_rows(table, scratch, patches, wi, wo, curvature, lines, result, gaps)
    return result, gaps


@kernel
def shortened(
    deviation_x: np.float32, deviation_y: np.float32, correlation: np.float32, narrowest: np.float32
) -> tuple[np.float32, np.float32, np.float32]:
    """Return a footprint no longer than `LONGEST` along its own longer axis, as wide as before across."""
    xx, yy, across = np.float64(deviation_x) ** 2, np.float64(deviation_y) ** 2, np.float64(narrowest) ** 2
    along = xx + yy - across
    share = min((max(LONGEST * LONGEST, across) - across) / max(along - across, _TINY), 1.0)
    x, y = math.sqrt(across + share * max(xx - across, 0.0)), math.sqrt(across + share * max(yy - across, 0.0))
    return np.float32(x), np.float32(y), np.float32(share * correlation * deviation_x * deviation_y / (x * y))


@kernel
def _sum_rows(
    table: SoftNodeTable, scratch: Scratch, patches: Footprints, wi: Float32, wo: Float32, curvature: Float32,
    lines: bool | None, result: Float32, gaps: Float32,
) -> None:  # fmt: skip
    """Write sums and areas of the queries whose nodes are on `lines`, or of those whose nodes are fixed (None)."""
    u, v, deviation_x, deviation_y, correlation = patches
    ends, picks, last = table.repeat[0], table.repeat[1], -1
    for n in range(len(u)):
        # Reduced in double precision: single would lose the place of a far centre within the repeat.
        x = np.float64(u[n]) - ends * math.floor(np.float64(u[n]) / ends)
        y = np.float64(v[n]) - picks * math.floor(np.float64(v[n]) / picks)
        dx, dy, rho = deviation_x[n], deviation_y[n], correlation[n]
        narrowest = min(dx, dy)
        if rho != _0:
            narrowest = np.float32(narrow_axis(dx, dy, rho))
        if max(dx, dy) > LONGEST and narrowest < table.uniform:
            dx, dy, rho = shortened(dx, dy, rho, narrowest)
        low_i, high_i, turn_i = around(wi[n, 0], wi[n, 1])
        low_o, high_o, turn_o = around(wo[n, 0], wo[n, 1])
        bend_i, bend_o = _0, _0
        if curvature[n] > _0 and len(table.falls) > 0:
            towards = directions_of(
                np.float64(wi[n, 0]), np.float64(wi[n, 1]), np.float64(wi[n, 2]),
                np.float64(wo[n, 0]), np.float64(wo[n, 1]), np.float64(wo[n, 2]), np.float64(curvature[n]),
            )  # fmt: skip
            bend_i, bend_o = np.float32(towards.light.bend), np.float32(towards.viewer.bend)
        # Where rays rise before they have sunk to the least height that is seen, nodes are far from one another.
        flat, depth = wo[n, 0] * wo[n, 0] + wo[n, 1] * wo[n, 1], np.float32(table.plane) - table.shown[0]
        rises = wo[n, 2] * wo[n, 2] < np.float32(2.0) * bend_o * flat * depth
        narrow = narrowest < table.view_lines * (2.0 if rises else 1.0)
        if (narrow and nodes_on_lines(dx, dy, narrowest, table.spacing) <= MOST_ON_LINES) != (lines is not None):
            continue
        look = SoftQuery(
            x, y, dx, dy, rho, narrowest, wi[n, 0], wi[n, 1], wi[n, 2], wo[n, 0], wo[n, 1], wo[n, 2], low_i, high_i,
            turn_i, low_o, high_o, turn_o, bend_i, bend_o,
        )  # fmt: skip
        # Lights that follow each other at one place share its nodes.
        m, last = last, n
        again = (
            m >= 0 and u[n] == u[m] and v[n] == v[m] and deviation_x[n] == deviation_x[m]
            and deviation_y[n] == deviation_y[m] and correlation[n] == correlation[m] and curvature[n] == curvature[m]
            and wo[n, 0] == wo[m, 0] and wo[n, 1] == wo[m, 1] and wo[n, 2] == wo[m, 2]
        )  # fmt: skip
        if lines is None:
            gaps[n] = sum_fixed(table, scratch, look, again, result[n])
        else:
            gaps[n] = sum_view_lines(table, scratch, look, again, result[n])
