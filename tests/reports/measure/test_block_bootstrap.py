import numpy as np
import pytest
from scipy import ndimage

from reports.measure.block_bootstrap import block_interval, blocks

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
        _, low, high = block_interval(rows, DISC)
        by_blocks += low <= 1 <= high
        by_pixels += abs(rows.mean() - 1) < 1.96 * rows.std() / np.sqrt(rows.size)
    assert by_blocks >= 170
    assert by_pixels < 100


def test_independent_pixels_have_the_usual_standard_error():
    """Its own relative error is 1 / sqrt(2 · 90 blocks) = 7 % and that of 500 draws 3 %: 25 % allowed."""
    rows = np.random.default_rng(1).standard_normal(DISC.sum())
    spread, low, high = block_interval(rows, DISC)
    assert spread == pytest.approx(1 / np.sqrt(rows.size), rel=0.25)
    assert high - low == pytest.approx(2 * 1.96 * spread, rel=0.2)


def test_blocks_part_the_mask():
    mask = np.ones((64, 96), dtype=bool)
    mask[:, :16] = False
    found = blocks(mask, 16)
    assert np.bincount(found).tolist() == [256] * (4 * 5)
    assert np.bincount(blocks(mask[:20, 16:], 16)).tolist() == [25] * (4 * 16)  # a quarter of 20 is 5


def test_equal_values_have_an_interval_of_no_width():
    assert block_interval(np.full(DISC.sum(), 0.5), DISC) == (0, 0.5, 0.5)
