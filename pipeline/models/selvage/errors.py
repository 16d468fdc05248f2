"""Expected errors of each answer to a query, from the query and the cloth alone: a table learnt once for all cloths.

The mean squared error of a level of soft nodes, or of the fallback, is the exponential of a polynomial in logarithms of
the query: size and length of its footprint, inclinations of viewer and light, bend across the footprint. Its
coefficients are linear in numbers of the cloth, so that a cloth turns the table into its own coefficients once:

    log E[e^2] = sum_t x_t(query) sum_z C_tz y_z(cloth)

An error e is that of a grey cloth's colour, relative to the true colour plus `FLOOR`. Light in front and behind, flat
and curved cloth have a table each (`pipeline.models.selvage.fit_errors` makes them).
"""

from __future__ import annotations

import json
import math
from functools import cache
from pathlib import Path
from typing import Final

import numpy as np

from pipeline.compiled.arrays import Float32, Float64, Index
from pipeline.compiled.decorators import kernel
from pipeline.truth.query import Queries
from weaves.fabric import Fabric

FLOOR: Final = 0.05
"""Colour added to the colour that errors are relative to: a third of that of a usual cloth."""

GREY: Final = (0.3, 0.3, 0.5, 0.5)
"""Weights of the four components in a grey cloth's colour."""

TABLE: Final = Path(__file__).with_name("errors.json")
"""The table of all cloths."""

ANSWERS: Final = 5
"""Answers: soft nodes of four levels, from the cheapest on, and the fallback."""

TERMS: Final = 15
"""Terms of the polynomial."""

_LEAST_COSINE = np.float32(0.03)  # lower directions are as this one
_SMALLEST, _LARGEST = np.float32(math.log(0.03)), np.float32(math.log(16.0))  # sizes beyond are as these
_BENDS = np.float32(30.0)  # of flat cloth on: curvature well above which errors are of another kind
_0, _1, _HALF = np.float32(0.0), np.float32(1.0), np.float32(0.5)


CASES: Final = 4
"""Cases, each with coefficients of its own: light in front, behind; curved cloth with light in front, behind."""


def cases_of(queries: Queries) -> Index:
    """Return the cases of N queries, (N,)."""
    return np.asarray((queries.wi[:, 2] < 0.0) + 2 * (queries.curvature > 0.0), np.int64)


@kernel
def write_terms(queries: Queries, n: int, terms: Float32) -> None:
    """Write the terms of query n, (TERMS,)."""
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
def case_of(queries: Queries, n: int) -> int:
    """Return the case of query n."""
    return int(queries.wi[n, 2] < _0) + 2 * int(queries.curvature[n] > _0)


@kernel
def log_error(coefficients: Float32, case: int, answer: int, terms: Float32) -> np.float32:
    """Return the logarithm of an answer's mean squared error; coefficients (cases, answers, TERMS)."""
    total = _0
    for t in range(TERMS):
        total += coefficients[case, answer, t] * terms[t]
    return total


@kernel
def _write_logarithms(queries: Queries, coefficients: Float32, terms: Float32, result: Float32) -> None:
    """Write the logarithms of the mean squared errors of N queries, (N, answers)."""
    for n in range(len(result)):
        write_terms(queries, n, terms)
        case = case_of(queries, n)
        for answer in range(coefficients.shape[1]):
            result[n, answer] = log_error(coefficients, case, answer, terms)


def logarithms(queries: Queries, coefficients: Float32) -> Float32:
    """Return the logarithms of the mean squared errors of N queries, (N, answers), by `coefficients_of` a cloth."""
    result = np.empty((len(queries.u), coefficients.shape[1]), np.float32)
    _write_logarithms(contiguous(queries), coefficients, np.empty(TERMS, np.float32), result)
    return result


def contiguous(queries: Queries) -> Queries:
    """Return queries whose columns kernels read, float32 and contiguous."""
    return Queries(*(np.ascontiguousarray(column, np.float32) for column in queries))


@cache
def _table() -> Float64:
    """Return the table of all cloths, (cases, answers, TERMS, CLOTH)."""
    return np.array(json.loads(TABLE.read_text(encoding="utf-8"))["coefficients"])


def coefficients_of(fabric: Fabric) -> Float32:
    """Return the coefficients of a cloth, (cases, answers, TERMS)."""
    return np.ascontiguousarray(_table() @ cloth_numbers(fabric), np.float32)


def cloth_numbers(fabric: Fabric) -> Float64:
    """Return the numbers of a cloth that its errors depend on, (CLOTH,)."""
    return np.ones(1)
