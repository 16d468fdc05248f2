"""Expected errors of each answer to a query, before any of them is evaluated: a table learnt once for all cloths.

The mean squared error of a level of soft nodes, or of the fallback, is the exponential of a polynomial in logarithms of
the query: size and length of its footprint, inclinations of viewer and light, bend of the cloth. Its coefficients are
linear in numbers y of the cloth, so that a cloth turns the table C into coefficients of its own, once:

    log E[e^2] = sum_t x_t(query) sum_z C_tz y_z(cloth)

An error e is that of a grey cloth's colour, relative to the true colour plus a floor. The numbers of a cloth say how
far its answers differ from one another, on some queries of flat cloth: logarithms of root mean squares, for each side
of the light. No truth is needed for them. tests/fits/fit_selvage_errors.py makes the table from random cloths.

Of curved cloth the fallback has larger errors than the finest nodes, and is never taken.
"""

import json
import math
from functools import cache, partial
from pathlib import Path
from typing import Final, Literal

import numpy as np

from pipeline.compiled.arrays import Float32, Float64, Index
from pipeline.compiled.decorators import kernel
from pipeline.models.selvage.cloth_numbers import NUMBERS, numbers_of, probed
from pipeline.per_fabric import PerFabric
from pipeline.truth.query import Queries
from weaves.fabric import Fabric

EXPECTED: Final = Path(__file__).with_name("expected.json")
"""Expectations of all cloths: ``errors``, the table C (cases, answers, TERMS for the number 1 and OF_CLOTH for each of
the others); ``numbers``, the least and the largest of the cloths that it was fitted to, for light in front and behind
(a number outside them counts as the nearer of the two); and usual ``microseconds`` of a query (kinds, answers),
processor times, geometric means of three cloths."""

OF_CLOTH: Final = (0, 1, 4)
"""Terms whose coefficients depend on the cloth: the constant one, size, inclination of the viewer."""

TERMS: Final = 15  # terms of the polynomial
SIZE_LIMITS: Final = (0.1, 0.3, 1.0, 3.0)  # limits of the ranges of sizes of `choice`, in yarn spacings
_SIZES: Final = np.log(np.array(SIZE_LIMITS, np.float32))

CASES: Final = 4
"""Cases, each with coefficients of its own: light in front, behind; curved cloth with light in front, behind."""

CURVED: Final = 2  # first case of curved cloth
RANGES: Final = len(SIZE_LIMITS) + 1  # ranges of sizes; a kind of query is a case and a range
_LEAST_COSINE = np.float32(0.03)  # lower directions are as this one
_SMALLEST, _LARGEST = np.float32(math.log(0.03)), np.float32(math.log(16.0))  # sizes beyond are as these
_BENDS = np.float32(30.0)  # of flat cloth on: curvature well above which errors are of another kind
_NEVER = 50.0  # logarithm of an error that no wish allows
_BLOCK = 256  # queries whose terms are at hand at once: they fit a first cache
_0, _1, _HALF = np.float32(0.0), np.float32(1.0), np.float32(0.5)


@kernel
def write_terms(queries: Queries, start: int, terms: Float32, kinds: Index) -> None:
    """Write the terms (TERMS or more, n or more) and kinds (n,) of n queries from `start` on."""
    for n in range(len(kinds)):
        query = start + n
        sigma, minor, curvature = queries.sigma[query], queries.sigma_minor[query], queries.curvature[query]
        size = min(max(_HALF * np.log(sigma * minor), _SMALLEST), _LARGEST)
        terms[0, n], terms[1, n] = _1, size
        terms[4, n] = -np.log(max(queries.wo[query, 2], _LEAST_COSINE))
        terms[7, n] = -np.log(max(abs(queries.wi[query, 2]), _LEAST_COSINE))
        terms[11, n] = np.abs(np.log(sigma / minor)) if sigma != minor else _0
        terms[13, n] = np.log(_1 + _BENDS * curvature) if curvature > _0 else _0
        kind = RANGES * (int(queries.wi[query, 2] < _0) + 2 * int(curvature > _0))
        for end in _SIZES:
            kind += int(size > end)
        kinds[n] = kind
    for n in range(len(kinds)):
        size, viewer, light, length, bend = terms[1, n], terms[4, n], terms[7, n], terms[11, n], terms[13, n]
        terms[2, n], terms[3, n], terms[5, n] = size * size, size * size * size, viewer * viewer
        terms[6, n], terms[8, n], terms[9, n], terms[10, n] = size * viewer, light * light, size * light, viewer * light
        terms[12, n], terms[14, n] = size * length, size * bend


@kernel
def _write_logarithms(queries: Queries, coefficients: Float32, terms: Float32, kinds: Index, result: Float32) -> None:
    """Write the kinds (N,) of N queries and the logarithms of their mean squared errors, (answers, N).

    By blocks of n queries: `terms` (TERMS + 1, n) has room for their terms and sums.
    """
    totals = terms[TERMS]
    for start in range(0, len(kinds), len(totals)):
        block = kinds[start : start + len(totals)]
        write_terms(queries, start, terms, block)
        first, last = block[0], block[0]
        for kind in block:
            first, last = min(first, kind), max(last, kind)
        for case in range(first // RANGES, last // RANGES + 1):
            for answer, own in enumerate(coefficients[case]):
                totals[:] = own[0]
                for term in range(1, TERMS):
                    for n in range(len(block)):  # the inner loop, so that queries are independent
                        totals[n] += own[term] * terms[term, n]
                for n in range(len(block)):
                    if block[n] // RANGES == case:
                        result[answer, start + n] = totals[n]


def squares_and_kinds(queries: Queries, coefficients: Float32) -> tuple[Float32, Index]:
    """Return the expected squared errors (answers, N) of N queries, by `coefficients_of` a cloth, and kinds (N,)."""
    kinds, terms = np.empty(len(queries.u), np.int64), np.empty((TERMS + 1, _BLOCK), np.float32)
    result = np.empty((coefficients.shape[1], len(kinds)), np.float32)
    columns = Queries(*(np.ascontiguousarray(column, np.float32) for column in queries))
    _write_logarithms(columns, np.ascontiguousarray(coefficients), terms, kinds, result)
    return np.exp(result, out=result), kinds


def coefficients_of(fabric: Fabric, behind: bool) -> Float32:
    """Return a cloth's coefficients, (cases, answers, TERMS); 0 of light behind unless wanted."""
    return (_BOTH if behind else _FRONT).of(fabric)


@cache
def expected(what: Literal["errors", "numbers", "microseconds"]) -> list[Float64]:
    """Return one part of `EXPECTED`, by case or by kind."""
    return [np.array(rows) for rows in json.loads(EXPECTED.read_text(encoding="utf-8"))[what]]


def _side(fabric: Fabric, behind: bool) -> Float32:
    """Return coefficients with those of one side of the light, the others 0."""
    rows, numbers = expected("errors"), np.clip(numbers_of(probed(fabric, behind)), *expected("numbers")[int(behind)])
    result = np.zeros((CASES, len(rows[0]), TERMS), np.float32)
    for case in range(int(behind), CASES, 2):
        own = rows[case][:, :TERMS].copy()
        own[:, OF_CLOTH] += numbers[1:] @ rows[case][:, TERMS:].reshape(len(own), NUMBERS - 1, len(OF_CLOTH))
        result[case, :, 0] = _NEVER
        result[case, : len(own)] = own
    return result


_FRONT = PerFabric(partial(_side, behind=False))
_BOTH = PerFabric(lambda fabric: _FRONT.of(fabric) + _side(fabric, behind=True))
