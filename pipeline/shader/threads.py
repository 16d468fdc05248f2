"""Colours of single ends and picks: factors on the mean colours of their yarns, and what a footprint sees of them.

Where a footprint does not cover the weave evenly, every thread near it has its own sums. Where it does, all threads of
a family send alike, each by the mass of the footprint on it:

    1 + 1/sigma integral z g(z) F(c + sigma z) dz,   F(x) the integral of the factors less 1 from thread 0 to x

by Gauss's rule, which the shader has for its lines of nodes.
"""

import math
from typing import Any, Final

import numpy as np

from pipeline.analytic.soft_nodes.answer import LONGEST, query_sums
from pipeline.analytic.soft_nodes.groups import COLUMNS
from pipeline.analytic.soft_nodes.nodes import BLOCK_NODES, SoftNodeTable
from pipeline.analytic.soft_nodes.shade import DIFFUSE, SPECULAR
from pipeline.analytic.soft_nodes.view_lines import GAUSS_PLACES, GAUSS_WEIGHTS, MOST_GAUSS
from pipeline.compiled.arrays import Float32, Float64, Index
from pipeline.truth.footprint.mixture import footprints, narrow_axis
from pipeline.truth.query import Queries
from weaves.fabric import Fabric

TINT_COLUMNS: Final = 18
"""Columns of a thread: factors on k_s, k_d and k_dt, then their integrals less 1 from thread 0 to its near border."""

SPREAD_OUT: Final = 0.8  # in repeats of the colours: a Gaussian this wide covers them evenly, to 6e-6
BELL_ENDS: Final = 3.0  # deviations at which the Gaussian across threads is cut off
_NEAR: Final = 64  # threads that have sums of their own, at least


def thread_tints(fabric: Fabric) -> tuple[Float32, Float32]:
    """Return the factors of the ends and of the picks after which colours repeat, each (n, TINT_COLUMNS)."""
    rows = []
    for colours in fabric.thread_colours():
        own = np.concatenate(colours, axis=1)
        mean = own.mean(axis=0)
        tints = np.divide(own, mean, out=np.ones_like(own), where=mean > 0.0)
        until = np.cumsum(tints - 1.0, axis=0) - (tints - 1.0)
        rows.append(np.concatenate([tints, until], axis=1).astype(np.float32))
    return rows[0], rows[1]


def family_heights(table: SoftNodeTable) -> tuple[float, float]:
    """Return the mean heights of warp and weft as seen from above; the reference plane if none is seen."""
    shares = table.evenly.reshape(-1, COLUMNS).astype(np.float64)
    starts = table.starts * (BLOCK_NODES // COLUMNS)

    def height(lines: slice) -> float:
        whole = shares[lines].sum()
        return float((shares[lines] * table.spots[lines, 3]).sum() / whole) if whole > 0.0 else table.plane

    return height(slice(starts[0], starts[1])), height(slice(starts[1], starts[2]))


class SeenTints:
    """Mean factors of the threads that footprints of viewers in front see on one side of a cloth."""

    def __init__(self, table: SoftNodeTable, tints: tuple[Float32, Float32]) -> None:
        self._table, self._tints = table, tints
        self._near = by_copy(table)

    def __call__(self, queries: Queries) -> Float64:
        """Return mean factors of the components of N queries, (N, 4, 3); NaN where too many threads are near."""
        u, v, dx, dy, rho = (np.asarray(column, np.float64) for column in footprints(queries))
        narrowest = np.array([narrow_axis(*row) for row in zip(dx, dy, rho, strict=True)])
        even, through = narrowest >= self._table.uniform, queries.wi[:, 2] < 0.0
        wo = queries.raised().wo.astype(np.float64)
        run = np.hypot(wo[:, 0], wo[:, 1]) / wo[:, 2]
        sums, _ = query_sums(self._near, queries)
        sizes = [int(size) for size in self._near.repeat]
        parts, result = np.split(sums.astype(np.float64), [sizes[0]], axis=1), np.empty((len(u), 4, 3))
        heights, columns = family_heights(self._table), ((u, dx), (v, dy))
        for family, (own, size, (centre, deviation)) in enumerate(zip(parts, sizes, columns, strict=True)):
            rows = self._tints[family].astype(np.float64)
            threads = np.arange(size) + size * np.rint((centre[:, None] - np.arange(size) - 0.5) / size).astype(int)
            across = _across(rows, centre + _moved(self._table, queries, heights[family])[:, family], deviation)
            reach = BELL_ENDS * np.minimum(deviation, LONGEST) + run * (self._table.highest - self._table.lowest) + 2.0
            for kind, (place, first) in enumerate(((SPECULAR, 0), (DIFFUSE, 3))):
                column = np.where(through & (kind == 1), 6, first)[:, None] + np.arange(3)
                light = own[:, :, place, None]
                factors = np.take_along_axis(rows[threads % len(rows)], column[:, None], 2)
                mean = (light * factors).sum(axis=1) / np.maximum(light.sum(axis=1), 1e-30)
                mean[reach > 0.5 * size] = np.nan
                result[:, 2 * kind + family] = np.where(even[:, None], np.take_along_axis(across, column, 1), mean)
        return result


def _moved(table: SoftNodeTable, queries: Queries, height: float) -> Float64:
    """Return by how much places of a height are displaced towards the viewers of N queries, (N, 2)."""
    wo = queries.raised().wo.astype(np.float64)
    level = np.hypot(wo[:, 0], wo[:, 1])
    run, over = level / wo[:, 2], height - table.plane
    bent = 2.0 * run * run * (queries.curvature if len(table.falls) else 0.0)
    length = 2.0 * over * run / (1.0 + np.sqrt(np.maximum(1.0 + bent * over, 0.0)))
    return np.asarray((length / np.maximum(level, 1e-9))[:, None] * wo[:, :2])


def _across(rows: Float64, centre: Float64, sigma: Float64) -> Float64:
    """Return the mean factors of a family under Gaussians across its threads, (N, 9)."""
    z = 0.5 * BELL_ENDS * (1.0 + GAUSS_PLACES[MOST_GAUSS, :MOST_GAUSS].astype(np.float64))
    weight = GAUSS_WEIGHTS[MOST_GAUSS, :MOST_GAUSS] * z * np.exp(-0.5 * z * z)

    def until(place: Float64) -> Float64:
        thread = np.floor(place)
        own = rows[thread.astype(int) % len(rows)]
        return np.asarray(own[..., 9:] + (place - thread)[..., None] * (own[..., :9] - 1.0))

    sums = sum(w * (until(centre + sigma * x) - until(centre - sigma * x)) for w, x in zip(weight, z, strict=True))
    means = 1.0 + sums / (sigma * 2.0 * (weight * z).sum())[:, None]
    return np.asarray(np.where((sigma < SPREAD_OUT * len(rows))[:, None], means, 1.0))


def by_copy(table: SoftNodeTable) -> SoftNodeTable:
    """Return a table of _NEAR ends and picks or more, each thread a kind of its own; nothing covers it evenly."""
    ends, picks = (int(n) for n in table.repeat)
    wide, high = ends * -(-_NEAR // ends), picks * -(-_NEAR // picks)
    pick, end = np.indices((high, wide)).reshape(2, -1)
    cells = pick % picks * ends + end % ends

    of_pieces, piece_starts = _ranges(table.piece_starts, cells)
    of_groups, group_starts = _ranges(table.group_starts.astype(np.int64), cells)
    groups, own = table.cell_groups[of_groups].astype(np.int64), np.repeat(np.arange(len(cells)), np.diff(group_starts))
    kinds = np.choose(table.groups[groups, 2].astype(int), [end[own], wide + pick[own], np.full(len(own), wide + high)])
    known, cell_groups = np.unique(kinds * len(table.groups) + groups, return_inverse=True)

    lines: list[int] = []
    rows, starts = [], [0]
    per_block = BLOCK_NODES // COLUMNS
    for kind in range(wide + high + 1):
        for group in known[known // len(table.groups) == kind] % len(table.groups):
            first, count, family = table.groups[group]
            rows.append((COLUMNS * len(lines), count, family))
            lines.extend(range(first // COLUMNS, first // COLUMNS + count))
        lines.extend([-1] * (-len(lines) % per_block))
        starts.append(len(lines) // per_block)
    chosen = np.maximum(lines, 0)
    spots = table.spots[chosen].copy()
    spots[np.array(lines) < 0] = 0.0

    def of_nodes(values: Float32) -> Float32:
        by_line = values.reshape(*values.shape[:-2], values.shape[-2] * per_block, COLUMNS)
        kept = by_line[..., chosen if values.shape[-2] else chosen[:0], :]
        return np.ascontiguousarray(kept.reshape(*kept.shape[:-2], kept.shape[-2] // per_block, BLOCK_NODES))

    nodes = np.ascontiguousarray(of_nodes(table.nodes.transpose(1, 0, 2)).transpose(1, 0, 2))
    names = ("evenly", "mean", "sharpness", "behind_mean", "behind_sharpness", "falls", "areas", "end_walls")
    columns: dict[str, Any] = {name: of_nodes(getattr(table, name)) for name in names}
    columns |= {name: getattr(table, name)[of_pieces] for name in ("pieces", "bounds", "floats", "crowns")}
    return table._replace(
        repeat=np.array([wide, high]), kinds=np.array([wide, high]), starts=np.array(starts), nodes=nodes, spots=spots,
        uniform=math.inf, groups=np.array(rows, np.uint32), group_starts=group_starts.astype(np.uint32),
        cell_groups=cell_groups.ravel().astype(np.uint32), piece_starts=piece_starts,
        **columns,
    )  # fmt: skip


def _ranges(starts: Index, cells: Index) -> tuple[Index, Index]:
    """Return the members of cells one after another, given where those of each begin, and where they begin now."""
    counts = np.diff(starts)[cells]
    first = np.concatenate([[0], np.cumsum(counts)])
    return np.arange(first[-1]) - np.repeat(first[:-1], counts) + np.repeat(starts[:-1][cells], counts), first
