"""Which answer each query gets: one price of time for all queries, by the wished error or the wished time.

Of all choices with a given sum of expected squared errors, that one takes least time in which every query takes the
answer of least

    E[e^2] + price * seconds

For a wished error the price is the highest at which the root mean square over random queries, footprints of all sizes
(`cloth_numbers.probes`), is at most the wished error: a curve over prices, once for each cloth and case. A query's
answer then depends on the query, the cloth and the wish alone. For a wished time it is the least at which the mean time
of these queries is at most the wished one.

Seconds are by kind of query: a case of `errors` and a range of sizes. For a wished error they are the usual ones
(`errors.EXPECTED`), so that the choice depends on no machine: ratios count, and errors hardly depend on them. For a
wished time they are measured, once for a cloth in a process.
"""

from collections.abc import Callable, Sequence
from functools import partial
from threading import Lock
from time import thread_time
from timeit import repeat
from typing import Final

import numpy as np
import numpy.typing as npt

from pipeline.compiled.arrays import Float32, Float64, Index
from pipeline.compiled.decorators import allocating_kernel
from pipeline.models.selvage.errors import CASES, RANGES, SIZE_LIMITS
from pipeline.per_fabric import PerFabric
from pipeline.shards.queries import QueryOptions, draw_queries
from pipeline.truth.query import Queries
from weaves.fabric import Fabric

Chosen = npt.NDArray[np.uint8]
"""Answers of N queries, (N,): numbers of levels from the cheapest on, then of the fallback."""

PRICES: Final[Float64] = np.concatenate([[0.0], np.geomspace(1e-3, 1e7, 400)])  # prices of a second, in squared errors
_SAMPLE: Final = 512  # queries that the price of a wished time is found on

Answer = Callable[[Fabric, Queries, int], object]  # answers queries about a fabric, with a seed

_ENDS: Final = (0.03, *SIZE_LIMITS, 10.0)  # of standard deviations, in yarn spacings
_TIMED_ROWS: Final = (1024, 1024, 1024, 1024, 1024, 64)  # queries a timed call, by answer
_CALLS: Final = 3  # after one that loads kernels and tables; the fastest counts
_SEED: Final = 0x5EC5
_LOCK = Lock()


def error_curve(squares: Float32, kinds: Index, seconds: Float64) -> Float64:
    """Return the mean expected squared error of some queries at all PRICES; columns as for `within_time`."""
    rows, choices = np.arange(len(kinds)), (choose_at(squares, kinds, price * seconds) for price in PRICES)
    return np.maximum.accumulate([squares[chosen, rows].mean(dtype=np.float64) for chosen in choices])


def price_of(curve: Float64, error: float) -> float:
    """Return the highest price at which the root mean square is at most `error`; 0, the best answers, if none is."""
    return float(PRICES[max(0, int(np.searchsorted(curve, error**2, side="right")) - 1)])


def within_time(squares: Float32, kinds: Index, seconds: Float64, time: float) -> Chosen:
    """Return the answers of least summed squared error whose mean time is at most `time`, which is possible.

    `squares` (answers, N) are expected squared errors, `kinds` (N,) rows of `seconds` (kinds, answers), the time of an
    answer; `time` is the mean of a query, at least that of the cheapest answers.
    """
    if not len(kinds):
        return np.empty(0, np.uint8)
    every, low, high = max(1, len(kinds) // _SAMPLE), 0, len(PRICES) - 1
    sample, some = np.ascontiguousarray(squares[:, ::every]), np.ascontiguousarray(kinds[::every])
    while high - low > 1:
        middle = (low + high) // 2
        over = seconds[some, choose_at(sample, some, PRICES[middle] * seconds)].mean() > time
        low, high = (middle, high) if over else (low, middle)
    for price in PRICES[low:]:  # all queries may take longer than the sample did
        chosen = choose_at(squares, kinds, price * seconds)
        if seconds[kinds, chosen].mean() <= time:
            return chosen
    return np.asarray(seconds[kinds].argmin(axis=1), np.uint8)  # an error that no price outweighs


@allocating_kernel
def choose_at(squares: Float32, kinds: Index, priced: Float64) -> Chosen:
    """Return the answer of each query with the least squared error plus price of its kind, (kinds, answers)."""
    chosen = np.zeros(len(kinds), np.uint8)
    for n in range(len(kinds)):
        least, kind = np.inf, kinds[n]
        for answer in range(len(squares)):
            value = squares[answer, n] + priced[kind, answer]
            if value < least:
                least, chosen[n] = value, answer
    return chosen


def seconds_of(kinds: Index, answers: Sequence[Answer], fabric: Fabric) -> Float64:
    """Return the seconds of a query of some kinds by answer, (all kinds, answers); NaN of other kinds."""
    result = np.full((RANGES * CASES, len(answers)), np.nan)
    with _LOCK:
        known = _KNOWN.of(fabric)
        for kind in np.flatnonzero(np.bincount(kinds)).tolist():
            if len(known.get(kind, ())) < len(answers):
                known[kind] = _measure(kind, answers, fabric)
            result[kind] = known[kind][: len(answers)]
    return result


_KNOWN: Final = PerFabric[dict[int, Float64]](lambda fabric: {})  # seconds by kind, measured one by one


def _measure(kind: int, answers: Sequence[Answer], fabric: Fabric) -> Float64:
    """Return the seconds of a query of one kind by answer, (answers,)."""
    case, size = divmod(kind, RANGES)
    curvature = (0.01, 0.5) if case >= 2 else (0.0, 0.0)
    options = QueryOptions(sigma=_ENDS[size : size + 2], behind=float(case % 2), stretch=2.0, curvature=curvature)
    result = np.empty(len(answers))
    for index, answer in enumerate(answers):
        queries = draw_queries(options, fabric.weave.repeat, _SEED, 0, _TIMED_ROWS[index])
        call = partial(answer, fabric, queries, 0)
        call()
        # The processor time of this thread: other work on the machine does not count.
        result[index] = min(repeat(call, timer=thread_time, repeat=_CALLS, number=1)) / _TIMED_ROWS[index]
    return result
