"""Fit SMOOTH and UNSEEN, the two constants in the errors that a node table reports.

Command: ``python tests/fits/fit_node_table_error.py [--fabrics 10] [--queries 500] [--points 32768]``

A query is covered if the norm of its true error lies within three reported ones; the error of the reference counts too.
Each constant is fitted with the other at its value in use: the smallest value with which 99 % of the queries are
covered. Fabrics are random (seed 77), most with gaps; queries are those of the default distribution (seed 78).
What was seen is in reports/LOG.md.
"""

import math
from collections.abc import Callable

import cyclopts
import numpy as np

from pipeline.shards.queries import QueryOptions, draw_queries
from pipeline.truth.cloth import cloth_side, columns_of
from pipeline.truth.estimator import WIDE, estimate
from pipeline.truth.footprint.mixture import FINE_LINE
from pipeline.truth.geometry.heightfield import GAP
from pipeline.truth.node_table.answer import sum_pieces
from pipeline.truth.node_table.build import FIRST_NODE, NODES_X, NODES_Y, PIECE_FAMILY
from pipeline.truth.node_table.kernels import SMOOTH, no_shares, node_directions
from pipeline.truth.node_table.refine import UNSEEN
from pipeline.truth.node_table.tables import COARSE, FINE
from pipeline.truth.node_table.weights import fill_weights, weight_room
from pipeline.truth.options import TruthOptions
from pipeline.truth.query import Queries
from weaves.fabric import Fabric
from weaves.population import Population, Ranges, population_fabrics

COVERED = 0.99

ROUGH = {"roughness_warp": (0.01, 0.8), "roughness_weft": (0.01, 0.8)}
WILD = Ranges(relief=(0.3, 2.0), bend=(5.0, 60.0), twist=(-35.0, 35.0), width=(0.7, 1.0), **ROUGH)


def curvature_terms(fabric: Fabric, queries: Queries) -> np.ndarray:
    """Return what SMOOTH is multiplied by in the squared error of each component, (N, 4)."""
    cloth, columns = cloth_side(fabric, TruthOptions()), columns_of(queries)
    result = np.zeros((len(queries.u), 4))
    for row in range(len(queries.u)):
        wide = min(columns.sigma[row], columns.sigma_minor[row]) >= WIDE
        table = (COARSE if wide else FINE).table(cloth, False)
        own = no_shares(table.normal.shape[1])
        if columns.sigma[row] >= table.uniform:
            own = own._replace(weight=table.evenly)
        else:
            room = weight_room(table, FINE_LINE)
            fill_weights(table, cloth.shape, columns, row, FINE_LINE, room, own.weight)
        sums, moved, squares = np.zeros(5), np.zeros(5), np.zeros(5)
        towards = node_directions(columns.wi[row], columns.wo[row], len(table.slope))
        area, *_ = sum_pieces(cloth, table, towards, own, sums, moved, squares)
        if area <= 0.0:
            continue
        below, parts = 0.0, np.zeros(4)
        for piece in table.pieces:
            # The nodes that `borders` visits: all rows but the first and the last two.
            first = piece[FIRST_NODE] + piece[NODES_X]
            nodes = slice(first, first + max(piece[NODES_X] * (piece[NODES_Y] - 3), 0))
            below += float(np.square(own.areas[nodes].astype(np.float64)).sum())
            if piece[PIECE_FAMILY] != GAP:
                parts[piece[PIECE_FAMILY]] += float(np.square(own.speculars[nodes].astype(np.float64)).sum())
                parts[2 + piece[PIECE_FAMILY]] += float(np.square(own.diffuses[nodes] / math.pi).sum())
        result[row] = (parts + (sums[:4] / area) ** 2 * below) / area**2
    return result


def smallest(covered: Callable[[float], float], values: np.ndarray) -> float:
    """Return the first of rising values that covers `COVERED` of the queries; NaN if none does."""
    return next((float(value) for value in values if covered(value) >= COVERED), math.nan)


def main(fabrics: int = 10, queries: int = 500, points: int = 32768) -> None:
    """Print both constants as fitted and in use."""
    population = Population(count=fabrics, seed=77, plain=WILD, twill=WILD, satin=WILD)
    many = {"min_count": points, "max_count": points}
    converged = TruthOptions(estimator="owen", parallax=False, relative_error=1e-9, absolute_error=0.0, **many)
    columns = []
    for fabric in population_fabrics(population):
        drawn = draw_queries(QueryOptions(sigma=(0.1, 50.0)), fabric.weave.repeat, 78, 0, queries)
        answers = estimate(fabric, drawn, TruthOptions(estimator="node_table", parallax=False), 1)
        exact = estimate(fabric, drawn, converged, 2)
        mean, error = answers.mean.astype(np.float64), answers.standard_error.astype(np.float64)
        wrong, reference = (np.linalg.norm(v, axis=1) for v in (mean - exact.mean, exact.standard_error))
        columns.append((wrong, reference, mean, error - UNSEEN * mean, curvature_terms(fabric, drawn)))
    wrong, reference, mean, base, terms = (np.concatenate(parts) for parts in zip(*columns, strict=True))

    def covered(smooth: float, unseen: float) -> float:
        squared = np.maximum(np.square(base) + (smooth - float(SMOOTH)) * terms, 0.0)
        reported = np.linalg.norm(np.sqrt(squared) + unseen * mean, axis=1)
        return float(np.mean(wrong <= 3.0 * np.hypot(reported, reference) + 1e-7))

    in_use = float(SMOOTH), float(UNSEEN)
    print(f"{len(wrong)} queries; covered with the values in use: {covered(*in_use):.2%}")
    smooth = smallest(lambda value: covered(value, in_use[1]), np.concatenate([[0.0], np.logspace(-6, -1, 101)]))
    print(f"SMOOTH: fitted {smooth:.2g}, in use {in_use[0]:.2g}; without it {covered(0.0, in_use[1]):.2%}")
    unseen = smallest(lambda value: covered(in_use[0], value), np.concatenate([[0.0], np.logspace(-5, -1, 81)]))
    print(f"UNSEEN: fitted {unseen:.2g}, in use {in_use[1]:.2g}; without it {covered(in_use[0], 0.0):.2%}")


if __name__ == "__main__":
    cyclopts.run(main)
