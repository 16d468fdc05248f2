"""Errors over unseen fabrics: known intervals, coverage, and the columns of a method."""

import math

import numpy as np
import pandas as pd
import pytest

from reports.over_fabrics import columns_over_fabrics, over_fabrics


def test_interval_of_three_fabrics():
    """Logarithms -1, 0 and 1: s = 1, and t_{.975, 2} = 4.302653 (tables of Student's distribution)."""
    found = over_fabrics([math.exp(-1), 1.0, math.e])
    reach = 4.302653 / math.sqrt(3)
    assert found.mean == pytest.approx(1.0)
    assert (found.low, found.high) == pytest.approx((math.exp(-reach), math.exp(reach)), rel=1e-6)


def test_alike_fabrics_leave_no_doubt():
    assert over_fabrics([0.25] * 4) == pytest.approx((0.25, 0.25, 0.25))


@pytest.mark.parametrize("values", [[], [0.1, 0.0], [0.1, -0.2], [0.1, math.nan], [0.1, math.inf]])
def test_errors_lost_in_the_noise_have_no_mean(values):
    assert all(math.isnan(number) for number in over_fabrics(values))


def test_a_single_fabric_has_no_interval():
    mean, low, high = over_fabrics([0.3])
    assert mean == pytest.approx(0.3) and math.isnan(low) and math.isnan(high)


def test_intervals_hold_the_true_mean_in_95_of_100_draws():
    """4000 draws of 9 fabrics: a share of .95 has a standard error of .0034; four of them are allowed."""
    draws = np.random.default_rng(0).lognormal(-3.0, 0.8, (4000, 9))
    held = [low <= math.exp(-3.0) <= high for _, low, high in map(over_fabrics, draws)]
    assert abs(np.mean(held) - 0.95) < 0.014


def test_ratios_are_those_of_the_same_fabric():
    """The baseline errs 100 and 1; the method a thousandth and a tenth of it: geometric mean 100."""
    base = pd.DataFrame({"fabric": ["b", "a"], "mse": [100.0, 1.0]})
    errors = pd.DataFrame(
        {"fabric": ["a", "b"], "mse": [0.1, 0.1], "colour_rrmse": [0.04, 0.01], "rrmse_specular_warp": [0.3, math.nan]}
    )
    found = columns_over_fabrics(errors, base)
    assert found["ratio_fabrics"] == pytest.approx(100.0)
    assert found["ratio_fabrics_low"] < 10.0 and found["ratio_fabrics_high"] > 1000.0
    assert found["colour_rrmse_fabrics"] == pytest.approx(0.02)
    # On fabric b the component is nowhere seen, another one was not measured.
    assert found["rrmse_specular_warp_fabrics"] == pytest.approx(0.3)
    assert math.isnan(found["rrmse_specular_warp_fabrics_low"]) and math.isnan(found["rrmse_diffuse_warp_fabrics"])


def test_without_the_baseline_there_is_no_ratio():
    errors = pd.DataFrame({"fabric": ["a", "b"], "mse": [0.1, 0.1]})
    found = columns_over_fabrics(errors, errors.iloc[:0])
    assert math.isnan(found["ratio_fabrics"]) and found["mse_fabrics"] == pytest.approx(0.1)
