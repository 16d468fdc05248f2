import math

import numpy as np
import pytest

from pipeline.truth.query import Answers
from reports.error import COLOUR_WEIGHTS, colour_error, colour_noise, component_errors, most_error, ratio, squared_error


def answers(mean, standard_error):
    mean, standard_error = np.asarray(mean, np.float32), np.asarray(standard_error, np.float32)
    return Answers.opaque(mean, standard_error, np.full(len(mean), 64, np.int32))


def test_noise_of_the_truth_is_subtracted_without_bias():
    """Rationale: model error .05, truth noise .1, independent; expected MSE .0025.

    40,000 values: the standard error of the mean of (e^2 - s^2) is about sqrt(2) .0125 / 200 = 9e-5; 5 of them allowed.
    """
    random = np.random.default_rng(1)
    field = random.random((40_000, 1))
    noise = np.full_like(field, 0.1)
    truth = field + noise * random.standard_normal(field.shape)
    error = squared_error(field + 0.05, truth, noise)
    assert error.measured == pytest.approx(0.0125, rel=0.05) and error.noise == pytest.approx(0.01)
    assert error.value == pytest.approx(0.0025, abs=5 * 9e-5)
    assert error.standard_error == pytest.approx(9e-5, rel=0.15) and error.mean == pytest.approx(truth.mean())
    perfect = squared_error(field, truth, noise)
    assert abs(perfect.value) < 5 * perfect.standard_error


def test_ratio_and_bootstrap_have_the_intervals_of_formulas_for_many_rows():
    random = np.random.default_rng(2)
    values = random.standard_normal((4000, 3))
    by_bootstrap = squared_error(values, np.zeros_like(values), np.zeros_like(values))
    by_formula = squared_error(values, np.zeros_like(values), np.zeros_like(values), resamples=0)
    assert by_formula.high - by_formula.value == pytest.approx(1.96 * by_formula.standard_error)
    assert by_bootstrap.low == pytest.approx(by_formula.low, abs=0.3 * by_formula.standard_error)
    assert by_bootstrap.high == pytest.approx(by_formula.high, abs=0.3 * by_formula.standard_error)
    assert by_bootstrap == squared_error(values, np.zeros_like(values), np.zeros_like(values))
    # Both 1 % off: the ratio is off by sqrt(2) %; checked against 200,000 draws to a tenth of that.
    value, low, high = ratio((4.0, 0.04), (2.0, 0.02))
    random = np.random.default_rng(3)
    draws = random.normal(4, 0.04, 200_000) / random.normal(2, 0.02, 200_000)
    assert value == 2 and (low, high) == pytest.approx(tuple(np.percentile(draws, [2.5, 97.5])), abs=0.003)


def test_colour_error_uses_the_colours_and_components_stay_apart():
    """An error of 1 in S_weft alone, seen through colour (.2, 0, .4): <e^2> = (.04 + .16) / 3."""
    truth = answers(np.ones((5, 4)), np.zeros((5, 4)))
    values = np.ones((5, 4)) + np.array([0, 1, 0, 0])
    colours = np.array([[1, 1, 1], [0.2, 0, 0.4], [1, 0, 0], [0, 1, 0]])
    assert colour_error(values, truth, colours).value == pytest.approx(0.2 / 3)
    truth = answers(np.tile([1, 2, 4, 0], (6, 1)), np.zeros((6, 4)))
    values = truth.mean + np.array([0.1, 0.1, 0.1, 0])
    found = [error.relative_rmse for error in component_errors(values, truth)]
    assert found[:3] == pytest.approx([0.1, 0.05, 0.025], rel=1e-5) and math.isnan(found[3])
    noise = colour_noise(answers(np.ones((1, 4)), [[3, 4, 0, 0]]), np.ones((4, 3)))
    assert noise == pytest.approx(np.full((1, 3), 5.0))


def test_colour_measure_is_the_prototypes_and_error_of_99_per_cent_leaves_the_largest_out():
    """S = 1, C = 2 everywhere: colour = .6 + 2 = 2.6; C_warp off by .26 is .13 of colour, 5 %."""
    truth = answers(np.tile([1, 1, 2, 2], (7, 1)), np.zeros((7, 4)))
    values = truth.mean + np.array([0, 0, 0.26, 0])
    assert colour_error(values, truth, COLOUR_WEIGHTS).relative_rmse == pytest.approx(0.05, rel=1e-5)
    # C off by .4 in 199 of 200 queries and by 40 in one: .2 of colour, and without the noise of .1 of colour.
    truth = answers(np.tile([0, 0, 2, 2], (200, 1)), np.tile([0, 0, 0.2, 0], (200, 1)))
    off = np.where(np.arange(200) == 7, 40.0, 0.4)
    values = truth.mean + off[:, None] * np.array([0, 0, 1, 0])
    assert most_error(values, truth).value == pytest.approx(0.2**2 - 0.1**2, rel=1e-6)
    assert most_error(values, truth).count == 198 and colour_error(values, truth, COLOUR_WEIGHTS).value > 1.0
