import math

import numpy as np
import pytest

from pipeline.truth.conventions import COMPONENTS
from reports.truth.bias import LIMIT, RECORDS, SIDES, Bias, bias_of, measure


def test_a_known_bias_lies_within_its_errors():
    """2,000 data sets of 400 rows that are .5 % too bright: z of their biases is standard normal.

    Its mean square then has standard deviation sqrt(2 / 2000) = .032; four of them are allowed."""
    random = np.random.default_rng(3)
    z = []
    for _ in range(2000):
        truth = random.exponential(size=400)
        value, error = bias_of(truth * (1.005 + 0.02 * random.normal(size=400)), truth)
        z.append((value - 0.005) / error)
    assert abs(np.mean(z)) < 4 / math.sqrt(len(z))
    assert abs(np.mean(np.square(z)) - 1) < 4 * 0.032 + 0.01  # 400 rows: Student's t and the first order
    assert bias_of(np.zeros(5), np.zeros(5)) == (0.0, 0.0), "what returns nothing has no bias"


@pytest.mark.parametrize(
    ("value", "error", "result"),
    [(0.001, 0.0005, "below"), (-0.001, 0.0005, "below"), (-0.0025, 0.001, "open"), (0.0055, 0.001, "above")],
)
def test_results_need_two_standard_errors(value, error, result):
    assert Bias("denim", SIDES[0], COMPONENTS[0], value, error, 10).result == result


@pytest.mark.slow
def test_the_table_is_measured_from_both_sides():
    found = list(measure(rows=200, fabrics=["basket"], reference=1024))
    assert [(bias.side, bias.component) for bias in found] == [(side, name) for side in SIDES for name in COMPONENTS]
    # Nothing like a wrong factor: 5 standard errors beyond ten times the limit.
    assert all(abs(bias.value) < 10 * LIMIT + 5 * bias.standard_error for bias in found)
    assert RECORDS.from_records(RECORDS.to_records(found)) == found
