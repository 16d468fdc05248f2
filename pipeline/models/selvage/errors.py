"""Expected errors of each answer to a query, before any of them is evaluated: a table learnt once for all cloths.

The mean squared error of a level of soft nodes, or of the fallback, is the exponential of a polynomial in logarithms of
the query: size and length of its footprint, inclinations of viewer and light, bend of the cloth. Its coefficients are
linear in numbers y of the cloth, so that a cloth turns the table C into coefficients of its own, once:

    log E[e^2] = sum_t x_t(query) sum_z C_tz y_z(cloth) + log f(cloth, range of sizes)

An error e is that of a grey cloth's colour, relative to the true colour plus a floor. The numbers of a cloth say how
far its answers differ from one another, on some queries of flat cloth: logarithms of root mean squares, for each side
of the light. The factors f of a level are the mean squares of its differences from the fallback over what the
polynomial expects there, in each range of sizes: where a level takes up another way, errors have a step, which is no
polynomial and differs from cloth to cloth. No truth is needed for either. tests/fits/fit_selvage_errors.py makes the
table from random cloths.

Of curved cloth the fallback has larger errors than the finest nodes, and is never taken.
"""

import json
import math
from functools import cache, partial
from pathlib import Path
from typing import Final

import numpy as np

from pipeline.compiled.arrays import Float32, Float64, Index
from pipeline.compiled.decorators import kernel
from pipeline.models.selvage.cloth_numbers import FLOOR, NUMBERS, numbers_of, probed
from pipeline.per_fabric import PerFabric
from pipeline.truth.query import Queries
from weaves.fabric import Fabric

ERROR_TABLE: Final = Path(__file__).with_name("errors.json")
"""The table of all cloths, C: cases, answers, TERMS for the number 1 and OF_CLOTH for each of the others."""

OF_CLOTH: Final = (0, 1, 4)
"""Terms whose coefficients depend on the cloth: the constant one, size, inclination of the viewer."""

TERMS: Final = 15  # terms of the polynomial
SIZE_LIMITS: Final = (0.1, 0.3, 1.0, 3.0)  # limits of the ranges of sizes with factors of their own, in yarn spacings
SIZES: Final = np.log(np.array(SIZE_LIMITS, np.float32))

CASES: Final = 4
"""Cases, each with coefficients of its own: light in front, behind; curved cloth with light in front, behind."""

CURVED: Final = 2  # first case of curved cloth
_LEAST_COSINE = np.float32(0.03)  # lower directions are as this one
_SMALLEST, _LARGEST = np.float32(math.log(0.03)), np.float32(math.log(16.0))  # sizes beyond are as these
_BENDS = np.float32(30.0)  # of flat cloth on: curvature well above which errors are of another kind
_PRIOR = 16  # rows of each range that the polynomial counts for
_NEVER = 50.0  # logarithm of an error that no wish allows
_0, _1, _HALF = np.float32(0.0), np.float32(1.0), np.float32(0.5)


def cases_of(queries: Queries) -> Index:
    """Return the cases of N queries, (N,)."""
    return np.asarray((queries.wi[:, 2] < 0.0) + 2 * (queries.curvature > 0.0), np.int64)


@kernel
def _write_terms(queries: Queries, result: Float32) -> None:
    """Write the terms of N queries, (N, TERMS)."""
    for n in range(len(result)):
        terms = result[n]
        sigma, minor = queries.sigma[n], queries.sigma_minor[n]
        size = min(max(_HALF * np.log(sigma * minor), _SMALLEST), _LARGEST)
        length = np.abs(np.log(sigma / minor))
        viewer = -np.log(max(queries.wo[n, 2], _LEAST_COSINE))
        light = -np.log(max(abs(queries.wi[n, 2]), _LEAST_COSINE))
        bend = np.log(_1 + _BENDS * queries.curvature[n])
        terms[0] = _1
        terms[1], terms[2], terms[3] = size, size * size, size * size * size
        terms[4], terms[5], terms[6] = viewer, viewer * viewer, size * viewer
        terms[7], terms[8], terms[9] = light, light * light, size * light
        terms[10] = viewer * light
        terms[11], terms[12] = length, size * length
        terms[13], terms[14] = bend, size * bend


@kernel
def _write_logarithms(terms: Float32, cases: Index, coefficients: Float32, result: Float32) -> None:
    """Write the logarithms of the mean squared errors of N queries, (N, answers)."""
    for n in range(len(result)):
        own, place = coefficients[cases[n]], TERMS
        for end in SIZES:
            place += int(terms[n, 1] > end)
        for answer in range(len(own)):
            total = own[answer, place]
            for t in range(TERMS):
                total += own[answer, t] * terms[n, t]
            result[n, answer] = total


def squared_errors(queries: Queries, coefficients: Float32) -> Float32:
    """Return the expected squared errors of all answers to N queries, (N, answers), by `coefficients_of` a cloth."""
    result = np.empty((len(queries.u), coefficients.shape[1]), np.float32)
    _write_logarithms(terms_of(queries), cases_of(queries), np.ascontiguousarray(coefficients), result)
    return np.exp(result, out=result)


def terms_of(queries: Queries) -> Float32:
    """Return the terms of N queries, (N, TERMS)."""
    result = np.empty((len(queries.u), TERMS), np.float32)
    _write_terms(Queries(*(np.ascontiguousarray(column, np.float32) for column in queries)), result)
    return result


def coefficients_of(fabric: Fabric, behind: bool) -> Float32:
    """Return a cloth's coefficients, (cases, answers, TERMS and ranges of sizes); 0 of light behind unless wanted."""
    return (_BOTH if behind else _FRONT).of(fabric)


def expand(row: Float64, numbers: Float64) -> Float64:
    """Return the coefficients (TERMS,) of a cloth with these numbers, from a row of the table."""
    result = row[:TERMS].copy()
    result[list(OF_CLOTH)] += numbers[1:] @ row[TERMS:].reshape(NUMBERS - 1, len(OF_CLOTH))
    return result


@cache
def _table() -> list[list[Float64]]:
    """Return the rows of the table by case and answer."""
    return [[np.array(row) for row in rows] for rows in json.loads(ERROR_TABLE.read_text(encoding="utf-8"))]


def _side(fabric: Fabric, behind: bool) -> Float32:
    """Return coefficients with those of one side of the light, the others 0."""
    (queries, colours), rows = probed(fabric, behind), _table()
    numbers = numbers_of(colours)
    result = np.zeros((CASES, len(rows[0]), TERMS + len(SIZES) + 1), np.float32)
    for case in range(int(behind), CASES, 2):
        result[case, :, 0] = _NEVER
        for answer, row in enumerate(rows[case]):
            result[case, answer, :TERMS] = expand(row, numbers)
    known = ~np.isnan(colours[:, -1])
    result[int(behind) :: 2, :-1, TERMS:] = np.log(size_factors(queries.take(known), colours[known], result))
    return result


def size_factors(queries: Queries, colours: Float64, coefficients: Float32) -> Float64:
    """Return the factors of each level and range of sizes, from the colours of all answers to N queries."""
    best = colours[:, -1:]
    squares = ((colours[:, :-1] - best) / (best + FLOOR)) ** 2
    expected = squared_errors(queries, coefficients)[:, :-1]
    places = np.searchsorted(SIZES, terms_of(queries)[:, 1])
    result = np.ones((squares.shape[1], len(SIZES) + 1))
    for place in np.unique(places):
        rows = places == place
        prior = _PRIOR * expected[rows].mean(axis=0)
        result[:, place] = (squares[rows].sum(axis=0) + prior) / (expected[rows].sum(axis=0) + prior)
    return result


_FRONT = PerFabric(partial(_side, behind=False))
_BOTH = PerFabric(lambda fabric: _FRONT.of(fabric) + _side(fabric, behind=True))
