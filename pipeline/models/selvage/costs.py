"""Seconds of each answer on this machine by kind of query, measured once in a process, when a time is first wished.

A kind is a case of `errors` and a range of sizes: within one of these the time of a query hardly changes.
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
    """Return the seconds of a query of some kinds by answer, (all kinds, answers), those of the first fabric asked of.

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
