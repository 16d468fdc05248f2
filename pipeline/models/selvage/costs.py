"""Seconds of each answer by kind of query: a case of `errors` and a range of sizes, in which times hardly differ.

For a wished error they are `USUAL_SECONDS` ones, so that the choice depends on no machine: ratios count, and errors hardly
depend on them. For a wished time they are measured, once in a process.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from functools import partial
from threading import Lock
from typing import Final

import numpy as np

from pipeline.compiled.arrays import Float64, Index
from pipeline.models.selvage.errors import CASES, cases_of
from pipeline.shards.queries import QueryOptions, draw_queries
from pipeline.truth.query import Queries
from weaves.fabric import Fabric

Answer = Callable[[Fabric, Queries, int], object]
"""Answers queries about a fabric, with a seed."""

_ENDS: Final = (0.03, 0.1, 0.3, 1.0, 3.0, 10.0)  # of standard deviations, in yarn spacings
_SIZES: Final = len(_ENDS) - 1
USUAL_SECONDS: Final = np.array(
    [
        [7.0e-6, 7.6e-6, 9.2e-6, 1.0e-5, 2.4e-4],
        [6.7e-6, 1.0e-5, 1.2e-5, 1.9e-5, 2.7e-4],
        [2.0e-6, 7.1e-6, 2.4e-5, 3.5e-5, 9.2e-5],
        [1.8e-6, 4.1e-6, 8.0e-6, 1.5e-5, 6.1e-5],
        [7.3e-7, 8.5e-7, 1.2e-6, 2.0e-6, 1.6e-5],
    ]
    * CASES
)
"""Seconds of a query on one core of 2026, by kind and answer, for light in front of flat cloth."""

_ROWS: Final = (1024, 1024, 1024, 1024, 64)  # queries a timed call, by answer
_CALLS: Final = 3  # after one that loads kernels and tables; the fastest counts
_SEED: Final = 0x5EC5
_LOCK = Lock()
_KNOWN: dict[int, Float64] = {}


def kinds_of(queries: Queries) -> Index:
    """Return the kinds of N queries, (N,), rows of `seconds_of`."""
    sizes = np.searchsorted(_ENDS[1:-1], np.sqrt(queries.sigma * queries.sigma_minor))
    return np.asarray(_SIZES * cases_of(queries) + sizes, np.int64)


def seconds_of(kinds: Index, answers: Sequence[Answer], fabric: Fabric) -> Float64:
    """Return the seconds of a query of some kinds by answer, (all kinds, answers), those of the first fabric.

    The answers are those of soft nodes, and the fallback if it is at hand.
    """
    result = np.full((_SIZES * CASES, len(answers)), np.nan)
    with _LOCK:
        for kind in np.unique(kinds).tolist():
            if len(_KNOWN.get(kind, ())) < len(answers):
                _KNOWN[kind] = _measure(kind, answers, fabric)
            result[kind] = _KNOWN[kind][: len(answers)]
    return result


def _measure(kind: int, answers: Sequence[Answer], fabric: Fabric) -> Float64:
    """Return the seconds of a query of one kind by answer, (answers,)."""
    case, size = divmod(kind, _SIZES)
    curvature = (0.01, 0.5) if case >= 2 else (0.0, 0.0)
    options = QueryOptions(sigma=_ENDS[size : size + 2], behind=float(case % 2), stretch=2.0, curvature=curvature)
    result = np.empty(len(answers))
    for index, answer in enumerate(answers):
        queries = draw_queries(options, fabric.weave.repeat, _SEED, 0, _ROWS[index])
        call = partial(answer, fabric, queries, 0)
        call()
        result[index] = min(_seconds(call) for _ in range(_CALLS)) / _ROWS[index]
    return result


def _seconds(call: Callable[[], object]) -> float:
    start = time.perf_counter()
    call()
    return time.perf_counter() - start
