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
from pipeline.compiled.arrays import Float32, Index, Mask
from pipeline.compiled.decorators import inlined_kernel, kernel
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
    on_lines = np.zeros(len(wi), np.bool_)
    if table.view_lines > 0.0:
        _choose(table, patches, wi, wo, curvature, on_lines)
    # A kernel each: in one, the compiler gives one kind's registers to the other, a tenth of the time.
    for sum_rows, rows in ((_sum_on_lines, np.flatnonzero(on_lines)), (_sum_fixed, np.flatnonzero(~on_lines))):
        if rows.size:
            sum_rows(table, scratch, patches, wi, wo, curvature, rows, result, gaps)
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


@inlined_kernel
def _look(table: SoftNodeTable, patches: Footprints, wi: Float32, wo: Float32, curvature: Float32, n: int) -> SoftQuery:
    """Return query n."""
    u, v, deviation_x, deviation_y, correlation = patches
    ends, picks = table.repeat[0], table.repeat[1]
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
    return SoftQuery(
        x, y, dx, dy, rho, narrowest, wi[n, 0], wi[n, 1], wi[n, 2], wo[n, 0], wo[n, 1], wo[n, 2], low_i, high_i,
        turn_i, low_o, high_o, turn_o, bend_i, bend_o,
    )  # fmt: skip


@inlined_kernel
def _alike(patches: Footprints, wo: Float32, curvature: Float32, n: int, m: int) -> bool:
    """Return whether two queries are of one place, seen from one side: they share its nodes."""
    u, v, deviation_x, deviation_y, correlation = patches
    return bool(
        u[n] == u[m] and v[n] == v[m] and deviation_x[n] == deviation_x[m] and deviation_y[n] == deviation_y[m]
        and correlation[n] == correlation[m] and curvature[n] == curvature[m] and wo[n, 0] == wo[m, 0]
        and wo[n, 1] == wo[m, 1] and wo[n, 2] == wo[m, 2]
    )  # fmt: skip


@kernel
def _choose(
    table: SoftNodeTable, patches: Footprints, wi: Float32, wo: Float32, curvature: Float32, on_lines: Mask
) -> None:
    """Write which queries have their nodes on lines."""
    for n in range(len(on_lines)):
        look = _look(table, patches, wi, wo, curvature, n)
        # Where rays rise before they have sunk to the least height that is seen, nodes are far from one another.
        flat, depth = look.ox * look.ox + look.oy * look.oy, np.float32(table.plane) - table.shown[0]
        rises = look.oz * look.oz < np.float32(2.0) * look.bend_o * flat * depth
        lines = table.view_lines * (2.0 if rises else 1.0)
        dx, dy, narrowest = float(look.dx), float(look.dy), float(look.narrowest)
        on_lines[n] = narrowest < lines and nodes_on_lines(dx, dy, narrowest, table.spacing) <= MOST_ON_LINES


@kernel
def _sum_on_lines(
    table: SoftNodeTable, scratch: Scratch, patches: Footprints, wi: Float32, wo: Float32, curvature: Float32,
    rows: Index, result: Float32, gaps: Float32,
) -> None:  # fmt: skip
    """Write sums and areas of the queries `rows`."""
    for i in range(len(rows)):
        n = rows[i]
        again = i > 0 and _alike(patches, wo, curvature, n, rows[i - 1])
        gaps[n] = sum_view_lines(table, scratch, _look(table, patches, wi, wo, curvature, n), again, result[n])


@kernel
def _sum_fixed(
    table: SoftNodeTable, scratch: Scratch, patches: Footprints, wi: Float32, wo: Float32, curvature: Float32,
    rows: Index, result: Float32, gaps: Float32,
) -> None:  # fmt: skip
    """Write sums and areas of the queries `rows`."""
    for i in range(len(rows)):
        n = rows[i]
        again = i > 0 and _alike(patches, wo, curvature, n, rows[i - 1])
        gaps[n] = sum_fixed(table, scratch, _look(table, patches, wi, wo, curvature, n), again, result[n])
