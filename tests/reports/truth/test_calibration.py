"""Errors and bounds of every estimator against true errors, on random fabrics that no factor was fitted on."""

import numpy as np
import pytest

from reports.truth.calibration import CLASSES, Calibration, compared, interval, measure


def test_the_comparison_of_normal_errors():
    """Errors of the stated size have ratio 1 and exceed 2.9677 standard errors in .3 % of all cases."""
    rng = np.random.default_rng(1)
    error = rng.uniform(0.5, 2.0, (200_000, 1))
    wrong, nothing = error * rng.standard_normal(error.shape), np.zeros_like(error)
    ratio, exceeded = compared(wrong, error, 2.9677 * error, nothing)
    assert ratio == pytest.approx(1.0, rel=0.01) and exceeded == pytest.approx(0.003, rel=0.15)
    # The reference's own error is subtracted.
    noisy = wrong + error * rng.standard_normal(error.shape)
    ratio, _ = compared(noisy, error, error, error)
    assert ratio == pytest.approx(1.0, rel=0.02)


@pytest.mark.parametrize(
    ("ratio", "exceeded", "low", "high", "holds"),
    [
        (0.9, 0.002, 0.85, 0.95, True), (0.9, 0.002, None, None, True), (0.7, 0.002, None, None, False),
        (0.7, 0.002, 0.5, 0.85, True), (0.7, 0.002, 0.65, 0.75, False), (1.4, 0.002, 1.3, 1.5, False),
        (1.0, 36 / 8000, 0.9, 1.1, True), (1.0, 38 / 8000, 0.9, 1.1, False),
    ],
)  # fmt: skip
def test_a_row_holds_within_its_limits(ratio, exceeded, low, high, holds):
    """Of 8,000 values 24 beyond their bound are expected; 38 have a chance of .5 %."""
    assert Calibration("auto", "solid", ratio, exceeded, low, high, 1.0, 0.0, 2000).holds is holds


def test_the_interval_covers_the_ratio_of_normal_errors_and_refuses_another():
    rng = np.random.default_rng(2)
    error = rng.lognormal(0.0, 1.0, (400, 1)) * np.ones((1, 5))
    nothing, covered = np.zeros_like(error), []
    for _ in range(100):
        wrong = error * rng.standard_normal(error.shape)
        low, high = interval(wrong, error, nothing)
        covered.append(low <= 1.0 <= high)
    # The level is 99 %; heavy tails cost some of it.
    assert sum(covered) >= 93
    low, high = interval(2.0 * wrong, error, nothing)
    assert low > 1.25


@pytest.mark.slow
@pytest.mark.parametrize("kind", list(CLASSES))
def test_errors_of_all_estimators_are_calibrated(kind):
    """1,920 queries of 20 fabrics, each answered by all estimators that know it; 17,280 in all classes."""
    found = list(measure(fabrics=20, rows=96, kinds=(kind,)))
    assert sum(row.count for row in found if row.estimator == "owen") >= 1_800
    assert [row for row in found if not row.holds] == []
