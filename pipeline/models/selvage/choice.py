"""Which answer each query gets: the cheapest within a wished error, or the best within a wished mean time.

Within a time the sum of the expected squared errors is least where every query takes the answer of least

    E[e^2] + price * seconds

at one price for all queries, that at which the mean time is the wished one: a bisection finds it.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
import numpy.typing as npt

from pipeline.compiled.arrays import Float32, Float64, Index
from pipeline.compiled.decorators import kernel
from pipeline.models.selvage.errors import TERMS, case_of, contiguous, log_error, write_terms
from pipeline.truth.query import Queries

Chosen = npt.NDArray[np.uint8]
"""Answers of N queries, (N,): numbers of levels from the cheapest on, then of the fallback."""

_SAMPLE: Final = 512  # queries that the price is found on
_STEPS: Final = 30  # halvings of the range of prices
_RAISE: Final = 1.02  # of the price, if all queries take longer at it than the sample did


def within_error(queries: Queries, coefficients: Float32, error: float) -> Chosen:
    """Return the first answer of each of N queries whose expected error is at most `error`, or the best one."""
    chosen = np.empty(len(queries.u), np.uint8)
    limit = np.float32(2.0 * math.log(error))
    _choose_within(contiguous(queries), coefficients, np.empty(TERMS, np.float32), limit, chosen)
    return chosen


def within_time(logarithms: Float32, kinds: Index, seconds: Float64, time: float) -> Chosen:
    """Return the answers of least summed squared error whose mean time is at most `time`, which is possible.

    Parameters
    ----------
    logarithms : float32 (N, answers)
        Of the expected squared errors.
    kinds : int64 (N,)
        Rows of `seconds`.
    seconds : float64 (kinds, answers)
        Time of an answer.
    time : float
        Mean seconds of a query, at least those of the cheapest answers.
    """
    squares, chosen = np.exp(logarithms), np.empty(len(logarithms), np.uint8)
    if _choose_at(squares, kinds, seconds, 0.0, chosen) <= time:
        return chosen
    every = max(1, len(squares) // _SAMPLE)
    some, some_kinds = squares[::every], kinds[::every]
    low, high = math.log(1e-6), math.log(1e12)  # of the price of a second, in squared errors
    for _ in range(_STEPS):
        middle = 0.5 * (low + high)
        over = _choose_at(some, some_kinds, seconds, math.exp(middle), chosen) > time
        low, high = (middle, high) if over else (low, middle)
    price = math.exp(high)
    while _choose_at(squares, kinds, seconds, price, chosen) > time and price < 1e13:
        price *= _RAISE
    return chosen


@kernel
def _choose_within(queries: Queries, coefficients: Float32, terms: Float32, limit: np.float32, chosen: Chosen) -> None:
    """Write the first answer whose logarithm is at most the limit, or that of the least."""
    for n in range(len(chosen)):
        write_terms(queries, n, terms)
        least, case = np.float32(np.inf), case_of(queries, n)
        for answer in range(coefficients.shape[1]):
            value = log_error(coefficients, case, answer, terms)
            if value < least:
                least, chosen[n] = value, answer
            if value <= limit:
                break


@kernel
def _choose_at(squares: Float32, kinds: Index, seconds: Float64, price: float, chosen: Chosen) -> float:
    """Write the answers of least squared error and price; return their mean seconds."""
    total = 0.0
    for n in range(len(squares)):
        least, kind = np.inf, kinds[n]
        for answer in range(squares.shape[1]):
            value = squares[n, answer] + price * seconds[kind, answer]
            if value < least:
                least, chosen[n] = value, answer
        total += seconds[kind, chosen[n]]
    return total / len(squares)
