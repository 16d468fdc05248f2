import numpy as np
import pytest
from scipy import ndimage

from reports.measure.block_bootstrap import block_interval, blocks, mse_difference
from reports.options import ImageOptions

Y, X = np.mgrid[:160, :160]
DISC = np.hypot(Y - 80, X - 80) < 78


def test_intervals_cover_under_correlated_noise():
    """Squares of Gaussian noise smoothed over 2 pixels, expectation 1, in a disc of some 90 blocks of 16 pixels.

    If 95 % intervals cover at least 90 %, fewer than 170 of 200 do so once in 60 runs. Intervals from pixels taken to
    be independent, shown for contrast, cover less than half.
    """
    random = np.random.default_rng(0)
    by_blocks = by_pixels = 0
    for _ in range(200):
        field = ndimage.gaussian_filter(random.standard_normal(DISC.shape), 2, mode="wrap")
        rows = (field[DISC] * 4 * np.sqrt(np.pi)) ** 2  # smoothing leaves the variance 1 / (4 pi 2^2)
        _, low, high = block_interval(rows, DISC, ImageOptions())
        by_blocks += low <= 1 <= high
        by_pixels += abs(rows.mean() - 1) < 1.96 * rows.std() / np.sqrt(rows.size)
    assert by_blocks >= 170 and by_pixels < 100


def test_intervals_are_those_of_the_difference_and_of_independent_pixels():
    """Its own relative error is 1 / sqrt(2 · 90 blocks) = 7 % and that of 500 draws 3 %: 25 % allowed."""
    rows = np.random.default_rng(1).standard_normal(DISC.sum())
    spread, low, high = block_interval(rows, DISC, ImageOptions())
    assert spread == pytest.approx(1 / np.sqrt(rows.size), rel=0.25)
    assert high - low == pytest.approx(2 * 1.96 * spread, rel=0.2)
    mask = np.ones((64, 96), dtype=bool)
    mask[:, :16] = False
    assert np.bincount(blocks(mask, 16)).tolist() == [256] * (4 * 5)
    assert np.bincount(blocks(mask[:20, 16:], 16)).tolist() == [25] * (4 * 16)  # a quarter of 20 is 5
    assert block_interval(np.full(DISC.sum(), 0.5), DISC, ImageOptions()) == (0, 0.5, 0.5)
    # Exactly, whatever the noise of the truth is: it enters linearly, and has no bias.
    a, b = TRUTH + 0.1 * HARD, TRUTH + 0.2 * HARD
    difference, low, high = mse_difference(a, b, TRUTH, MASK, OPTIONS)
    assert difference == pytest.approx((0.04 - 0.01) * np.mean(HARD[MASK] ** 2), rel=1e-12)
    assert low < difference < high and mse_difference(b, a, TRUTH, MASK, OPTIONS)[0] == -difference
    assert mse_difference(a, a, TRUTH, MASK, OPTIONS) == (0.0, 0.0, 0.0)
    # Both are off by the same pattern; b by a little more. The pattern varies, the difference hardly does.
    a = TRUTH + 1.0
    a[:, :32] += 1.0
    b = a + 0.01
    difference, low, high = mse_difference(a, b, TRUTH, MASK, OPTIONS)
    assert difference == pytest.approx(0.03, rel=0.1)
    # By itself, a picture's MSE is 1 in one half and 4 in the other.
    assert low > 0.0 and high - low < 0.02


RANDOM = np.random.default_rng(5)
SIZE = (48, 64)
MASK = RANDOM.random(SIZE) < 0.8
TRUTH = RANDOM.random((*SIZE, 3)) + 0.5
HARD = RANDOM.standard_normal((*SIZE, 3)) * np.linspace(0.1, 3.0, SIZE[1])[:, None]
OPTIONS = ImageOptions(block=8, resamples=300)
