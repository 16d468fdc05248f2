"""Differences of errors: what both pictures share, and the truth's noise, cancel."""

import numpy as np
import pytest

from reports.measure.paired_error import mse_difference
from reports.options import ImageOptions

RANDOM = np.random.default_rng(5)
SIZE = (48, 64)
MASK = RANDOM.random(SIZE) < 0.8
TRUTH = RANDOM.random((*SIZE, 3)) + 0.5
HARD = RANDOM.standard_normal((*SIZE, 3)) * np.linspace(0.1, 3.0, SIZE[1])[:, None]
OPTIONS = ImageOptions(block=8, resamples=300)


def test_it_is_the_difference_of_both_mean_squared_errors():
    a, b = TRUTH + 0.1 * HARD, TRUTH + 0.2 * HARD
    difference, low, high = mse_difference(a, b, TRUTH, MASK, OPTIONS)
    assert difference == pytest.approx((0.04 - 0.01) * np.mean(HARD[MASK] ** 2), rel=1e-12)
    assert low < difference < high
    assert mse_difference(b, a, TRUTH, MASK, OPTIONS)[0] == -difference


def test_what_both_err_alike_does_not_widen_the_interval():
    """Both are off by the same pattern; b by a little more. The pattern varies, the difference hardly does."""
    a = TRUTH + 1.0
    a[:, :32] += 1.0
    b = a + 0.01
    difference, low, high = mse_difference(a, b, TRUTH, MASK, OPTIONS)
    assert difference == pytest.approx(0.03, rel=0.1)
    # By itself, a picture's MSE is 1 in one half and 4 in the other.
    assert low > 0.0 and high - low < 0.02


def test_noise_of_the_truth_does_not_bias_it():
    """20 noisy truths: the mean lies within 4 standard errors of the difference by the exact one (level 6e-5)."""
    a, b = TRUTH + 0.1 * HARD, TRUTH + 0.12 * HARD
    exact = mse_difference(a, b, TRUTH, MASK, OPTIONS)[0]
    noisy = [
        mse_difference(a, b, TRUTH + 0.5 * RANDOM.standard_normal(TRUTH.shape), MASK, OPTIONS)[0] for _ in range(20)
    ]
    assert abs(np.mean(noisy) - exact) < 4.0 * np.std(noisy, ddof=1) / np.sqrt(20)


def test_equal_pictures_differ_by_nothing():
    assert mse_difference(TRUTH, TRUTH, TRUTH + HARD, MASK, OPTIONS) == (0.0, 0.0, 0.0)
