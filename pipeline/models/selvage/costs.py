"""Seconds of each answer by kind of query: a case of `errors` and a range of sizes, in which times hardly differ.

For a wished error they are `USUAL_SECONDS`, so that the choice depends on no machine: ratios count, and errors hardly
depend on them. For a wished time they are measured, once for a cloth in a process.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from functools import partial
from threading import Lock
from typing import Final

import numpy as np

from pipeline.compiled.arrays import Float64, Index
from pipeline.models.selvage.errors import CASES, SIZE_LIMITS, cases_of
from pipeline.per_fabric import PerFabric
from pipeline.shards.queries import QueryOptions, draw_queries
from pipeline.truth.query import Queries
from weaves.fabric import Fabric

Answer = Callable[[Fabric, Queries, int], object]
"""Answers queries about a fabric, with a seed."""

_ENDS: Final = (0.03, *SIZE_LIMITS, 10.0)  # of standard deviations, in yarn spacings
_SIZES: Final = len(_ENDS) - 1
_MICROSECONDS: Final = [
    [3.6, 4.4, 4.6, 5.6, 167.0],
    [3.8, 6.8, 8.4, 11.7, 139.0],
    [2.5, 5.1, 15.8, 21.5, 75.0],
    [2.1, 3.0, 4.8, 8.1, 40.0],
    [0.76, 0.96, 1.4, 2.35, 20.0],
]
USUAL_SECONDS: Final = 1e-6 * np.array(_MICROSECONDS * CASES)
"""Seconds of a query by kind and answer: ratios of processor times, geometric means of denim, twill 4/4 and gauze."""

_ROWS: Final = (1024, 1024, 1024, 1024, 64)  # queries a timed call, by answer
_CALLS: Final = 3  # after one that loads kernels and tables; the fastest counts
_SEED: Final = 0x5EC5
_LOCK = Lock()


def kinds_of(queries: Queries) -> Index:
    """Return the kinds of N queries, (N,), rows of `seconds_of`."""
    sizes = np.searchsorted(_ENDS[1:-1], np.sqrt(queries.sigma * queries.sigma_minor))
    return np.asarray(_SIZES * cases_of(queries) + sizes, np.int64)


def seconds_of(kinds: Index, answers: Sequence[Answer], fabric: Fabric) -> Float64:
    """Return the seconds of a query of some kinds by answer, (all kinds, answers); NaN of other kinds.

    The answers are those of soft nodes, and the fallback if it is at hand.
    """
    result = np.full((_SIZES * CASES, len(answers)), np.nan)
    with _LOCK:
        known = _KNOWN.of(fabric)
        for kind in np.unique(kinds).tolist():
            if len(known.get(kind, ())) < len(answers):
                known[kind] = _measure(kind, answers, fabric)
            result[kind] = known[kind][: len(answers)]
    return result


_KNOWN: Final = PerFabric[dict[int, Float64]](lambda fabric: {})  # seconds by kind, measured one by one


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
    """Return the processor time of this thread in a call: other work on the machine does not count."""
    start = time.thread_time()
    call()
    return time.thread_time() - start
