"""Golden vectors: queries of every kind of footprint with the answers of pipeline.analytic.soft_nodes.

Cells of grids and numbers of nodes are integers: a query may lie so near a step that the last digit of its place
decides. No implementation can be right or wrong on such a query, so it is not golden: the answer may change by at most
STEADY, as a share of the range of its column, if the last digits of its footprint change.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Final, NamedTuple

import numpy as np

from pipeline.analytic.soft_nodes.answer import SMALLEST
from pipeline.analytic.soft_nodes.features import read_queries
from pipeline.analytic.soft_nodes.nodes import Table
from pipeline.compiled.arrays import Float32, Mask
from pipeline.truth.footprint.mixture import deviations
from pipeline.truth.query import Queries

ROWS: Final = 128
"""Golden queries of a fabric."""

COLUMNS: Final = ("u", "v", "deviation_x", "deviation_y", "correlation", "wi_x", "wi_y", "wi_z", "wo_x", "wo_y", "wo_z")
"""Columns of a query as the shader takes it."""

STEADY: Final = 1e-5
"""Largest change of a golden answer if the last digits of its footprint change, as a share of the range."""

_SEED = 20
_TRIALS = 4
_LEAST_RISE = 0.05  # of light and viewer
# Deviations of the longer axis, and ratios of the axes, of one kind of footprint after another: points, narrow, wide,
# wider than the repeat; thin ellipses, long and short, and thick ones.
_KINDS = (
    ((0.01, 0.1), (1.0, 1.0)),
    ((0.1, 0.25), (1.0, 1.0)),
    ((0.25, 0.6), (1.0, 1.0)),
    ((0.6, 8.0), (1.0, 1.0)),
    ((0.1, 0.7), (1.6, 6.0)),
    ((0.75, 2.0), (4.0, 8.0)),
    ((0.4, 3.0), (1.1, 2.5)),
)


class Golden(NamedTuple):
    """Queries with their answers.

    Attributes
    ----------
    rows : float32 (N, 11)
        COLUMNS.
    components, bounds : float32 (N, 4)
        Answers, and the same without shadows of the light.
    steady : float
        Share of the queries tried that are steady.
    """

    rows: Float32
    components: Float32
    bounds: Float32
    steady: float


def rows_of(queries: Queries) -> Float32:
    """Return N queries as the shader takes them, float32 (N, 11)."""
    columns = (queries.u, queries.v, *deviations(queries, SMALLEST), queries.wi, queries.wo)
    return np.column_stack(columns).astype(np.float32)


Answering = Callable[[Queries], Float32]
"""Components and bounds of N queries, (N, 8)."""


def golden(table: Table, count: int = ROWS) -> Golden:
    """Return `count` golden queries of a table."""
    return golden_of(partial(_read, table), (int(table.repeat[0]), int(table.repeat[1])), count)


def golden_of(read: Answering, repeat: tuple[int, int], count: int = ROWS, stretched: bool = True) -> Golden:
    """Return `count` golden queries of a model, over a repeat (ends, picks); all round if not `stretched`."""
    rng = np.random.default_rng(_SEED)
    queries = _candidates(repeat, rng, 2 * count)
    if not stretched:
        queries = queries._replace(sigma_minor=queries.sigma)
    steady, answer = _steady(read, queries, rng)
    chosen = np.flatnonzero(steady)[:count]
    kept = queries.take(chosen)
    return Golden(rows_of(kept), answer[chosen, :4], answer[chosen, 4:], float(steady.mean()))


def _candidates(repeat: tuple[int, int], rng: np.random.Generator, count: int) -> Queries:
    """Return queries of every kind by turns, anywhere in the repeat, light and viewer anywhere in front."""
    kinds = np.array(_KINDS)[np.arange(count) % len(_KINDS)]
    drawn = np.exp(np.log(kinds[:, :, 0]) + rng.random((count, 2)) * np.log(kinds[:, :, 1] / kinds[:, :, 0]))
    sigma, ratio = drawn[:, 0], drawn[:, 1]
    place = rng.random((count, 2)) * repeat
    # Half of the ellipses lie along the yarns.
    angle = np.where(rng.random(count) < 0.5, 0.0, rng.uniform(-0.5, 0.5, count)) * np.pi
    columns = (place[:, 0], place[:, 1], sigma, _front(rng, count), _front(rng, count), sigma / ratio, angle)
    return Queries(*(np.asarray(column, np.float32) for column in (*columns, np.zeros(count))))


def _front(rng: np.random.Generator, count: int) -> Float32:
    """Return unit vectors, even over the directions in front, (N, 3)."""
    z, turn = rng.uniform(_LEAST_RISE, 1.0, count), rng.uniform(0.0, 2.0 * np.pi, count)
    level = np.sqrt(1.0 - z * z)
    return np.column_stack([level * np.cos(turn), level * np.sin(turn), z]).astype(np.float32)


def _steady(read: Answering, queries: Queries, rng: np.random.Generator) -> tuple[Mask, Float32]:
    """Return which queries are steady, and components and bounds of all, (N, 8)."""
    answer = read(queries)
    span = np.ptp(answer, axis=0)
    change = np.zeros(len(answer))
    for _ in range(_TRIALS):
        moved = queries._replace(
            u=_next(queries.u, rng), v=_next(queries.v, rng), sigma=_next(queries.sigma, rng),
            sigma_minor=_next(queries.sigma_minor, rng),
        )  # fmt: skip
        change = np.maximum(change, (np.abs(read(moved) - answer) / span).max(axis=1))
    return np.asarray(change <= STEADY), answer


def _next(values: Float32, rng: np.random.Generator) -> Float32:
    """Return the numbers above or below, at random."""
    towards = np.where(rng.random(len(values)) < 0.5, np.float32(-np.inf), np.float32(np.inf))
    return np.nextafter(values, towards, dtype=np.float32)


def _read(table: Table, queries: Queries) -> Float32:
    found = read_queries(table, queries)
    return np.concatenate([found.components, found.bounds], axis=1)
