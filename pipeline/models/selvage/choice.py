"""Which answer each query gets: one price of time for all queries, by the wished error or the wished time.

Of all choices with a given sum of expected squared errors, that one takes least time in which every query takes the
answer of least

    E[e^2] + price * seconds

For a wished error the price is the highest at which the root mean square over random queries, footprints of all sizes
(`cloth_numbers.probes`), is at most the wished error: a curve over prices, once for each cloth and case. A query's
answer then depends on the query, the cloth and the wish alone. For a wished time it is the least at which the mean time
of these queries is at most the wished one.
"""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

from pipeline.compiled.arrays import Float32, Float64, Index
from pipeline.compiled.decorators import kernel

Chosen = npt.NDArray[np.uint8]
"""Answers of N queries, (N,): numbers of levels from the cheapest on, then of the fallback."""

PRICES: Final[Float64] = np.concatenate([[0.0], np.geomspace(1e-3, 1e7, 400)])
"""Prices of a second, in squared errors."""

_SAMPLE: Final = 512  # queries that the price of a wished time is found on
_RAISE: Final = 1.02  # of the price, if all queries take longer at it than the sample did


def error_curve(squares: Float32, kinds: Index, seconds: Float64) -> Float64:
    """Return the mean expected squared error of some queries at all PRICES; columns as for `within_time`."""
    chosen, rows = np.empty(len(squares), np.uint8), np.arange(len(squares))
    curve = []
    for price in PRICES:
        choose_at(squares, kinds, price * seconds, chosen)
        curve.append(squares[rows, chosen].mean(dtype=np.float64))
    return np.maximum.accumulate(curve)


def price_of(curve: Float64, error: float) -> float:
    """Return the highest price at which the root mean square is at most `error`; 0, the best answers, if none is."""
    return float(PRICES[max(0, int(np.searchsorted(curve, error**2, side="right")) - 1)])


def within_time(squares: Float32, kinds: Index, seconds: Float64, time: float) -> Chosen:
    """Return the answers of least summed squared error whose mean time is at most `time`, which is possible.

    `squares` (N, answers) are expected squared errors, `kinds` (N,) rows of `seconds` (kinds, answers), the time of an
    answer; `time` is the mean of a query, at least that of the cheapest answers.
    """
    chosen, every = np.empty(len(squares), np.uint8), max(1, len(squares) // _SAMPLE)
    some = np.ascontiguousarray(squares[::every]), np.ascontiguousarray(kinds[::every])
    low, high = 0, len(PRICES) - 1
    while high - low > 1:
        middle = (low + high) // 2
        over = _mean_seconds(*some, seconds, PRICES[middle], chosen[: len(some[0])]) > time
        low, high = (middle, high) if over else (low, middle)
    price = PRICES[low]
    while _mean_seconds(squares, kinds, seconds, price, chosen) > time and price < np.inf:
        price = max(_RAISE * price, PRICES[1])
    return chosen


def _mean_seconds(squares: Float32, kinds: Index, seconds: Float64, price: float, chosen: Chosen) -> float:
    """Write the answers at a price; return their mean seconds."""
    if price == np.inf:
        chosen[:] = seconds[kinds].argmin(axis=1)
    else:
        choose_at(squares, kinds, price * seconds, chosen)
    return float(seconds[kinds, chosen].mean())


@kernel
def choose_at(squares: Float32, kinds: Index, priced: Float64, chosen: Chosen) -> None:
    """Write the answer of each query with the least squared error plus price of its kind, (kinds, answers)."""
    for n in range(len(squares)):
        least, kind = np.inf, kinds[n]
        for answer in range(squares.shape[1]):
            value = squares[n, answer] + priced[kind, answer]
            if value < least:
                least, chosen[n] = value, answer
