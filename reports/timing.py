"""What a query costs: methods side by side in one process.

All methods answer the same queries; they take turns, so that whatever else the machine does falls on all alike. Each is
called a few times before the clock counts. A GPU is waited for before both readings of the clock. One call answers the
queries of several fabrics in turn, because the cost of the point model depends on the weave. Numbers of different
machines are never compared.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from pipeline.truth.query import Queries
from weaves.fabric import Fabric

Predict = Callable[[Fabric, Queries], object]


class Contender(NamedTuple):
    """A method and the questions it is timed on."""

    predict: Predict
    """Answers queries about a fabric."""
    questions: Sequence[tuple[Fabric, Queries]]
    """Fabrics it covers, each with its queries; one timed call answers them all."""


class Timing(NamedTuple):
    """Cost of a query in nanoseconds over the repeats."""

    median: float
    first_quartile: float
    third_quartile: float
    repeats: int
    rows: int
    """Queries in each timed call."""


def time_side_by_side(
    contenders: Sequence[Contender],
    repeats: int,
    warm_up: int = 3,
    threads: int = 1,
    clock: Callable[[], int] = time.perf_counter_ns,
) -> list[Timing]:
    """Time methods in turns.

    Parameters
    ----------
    contenders : sequence of Contender
        What to time.
    repeats : int
        Timed calls of each.
    warm_up : int
        Calls of each before that.
    threads : int
        Threads that torch and numba may use.
    clock : callable
        Returns nanoseconds.

    Returns
    -------
    list of Timing
        One a contender, in their order.
    """
    set_threads(threads)
    for _ in range(warm_up):
        for contender in contenders:
            _call(contender)
    elapsed: list[list[int]] = [[] for _ in contenders]
    for _ in range(repeats):
        for contender, readings in zip(contenders, elapsed, strict=True):
            synchronise()
            start = clock()
            _call(contender)
            synchronise()
            readings.append(clock() - start)
    return [_timing(contender, readings) for contender, readings in zip(contenders, elapsed, strict=True)]


def set_threads(threads: int) -> None:
    """Tell torch and numba how many threads they may use, if a method has loaded them."""
    if (torch := sys.modules.get("torch")) is not None:
        torch.set_num_threads(threads)
    if (numba := sys.modules.get("numba")) is not None:
        numba.set_num_threads(min(threads, numba.config.NUMBA_NUM_THREADS))


def synchronise() -> None:
    """Wait for the GPU, if a method has loaded torch and there is one."""
    if (torch := sys.modules.get("torch")) is not None and torch.cuda.is_available():
        torch.cuda.synchronize()


def _call(contender: Contender) -> None:
    for fabric, queries in contender.questions:
        contender.predict(fabric, queries)


def _timing(contender: Contender, elapsed: Sequence[int]) -> Timing:
    rows = sum(len(queries.u) for _, queries in contender.questions)
    low, median, high = (float(q) for q in np.percentile(np.array(elapsed) / rows, [25, 50, 75]))
    return Timing(median, low, high, len(elapsed), rows)
