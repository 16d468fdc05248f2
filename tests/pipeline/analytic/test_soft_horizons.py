import numpy as np
import pytest

from pipeline.analytic import soft_horizons as soft
from pipeline.analytic.gauss_rules import overlap


def test_boxes_have_the_moments_of_their_cells_and_a_ramp_is_the_share_of_a_spread_horizon():
    grid = np.random.default_rng(1).random((3, 6, 8))
    rows = overlap(np.array([0.0, 0.5, 1.0]), np.linspace(0, 1, 7))
    columns = overlap(np.array([0.0, 0.25, 1.0]), np.linspace(0, 1, 9))
    mean, variance = soft.over_boxes(grid, grid**2, rows, columns)
    boxes = [part.reshape(3, -1) for half in (grid[:, :3], grid[:, 3:]) for part in (half[..., :2], half[..., 2:])]
    np.testing.assert_allclose(mean, np.stack([box.mean(axis=1) for box in boxes], axis=1), rtol=1e-12)
    np.testing.assert_allclose(variance, np.stack([box.var(axis=1) for box in boxes], axis=1), rtol=1e-9)
    # Horizons even between 0.3 and 0.5, of which a direction clears those beneath it.
    horizons = 0.3 + 0.2 * (np.arange(1000) + 0.5) / 1000
    sharpness = np.float32(1.0 / (np.sqrt(12.0) * horizons.std()))
    for rise in np.float32([0.2, 0.32, 0.4, 0.49, 0.6]):
        found = soft.ramp(soft.above(rise, np.float32(0.3), np.float32(0.5), np.float32(0.5), sharpness))
        assert found == pytest.approx((horizons < rise).mean(), abs=2e-3)


@pytest.mark.parametrize(("turn", "expected"), [(0.0, "less"), (90.0, "product"), (180.0, "both leave")])
def test_what_hides_one_hides_or_shows_the_other(turn, expected):
    """A box of 10,000 points; light and viewer are free of the same ones, of independent ones, or of opposite ones."""
    azimuth = np.radians(turn)
    ways = soft.azimuths_apart(*np.array([0.6, 0.0, 0.3 * np.cos(azimuth), 0.3 * np.sin(azimuth)], np.float32))
    assert sum(ways) == pytest.approx(1.0)
    first, second = np.float32(0.7), np.float32(0.4)
    points = (np.arange(10_000) + 0.5) / 10_000
    free = points < first
    chosen = {"less": points < second, "product": points * 100 % 1 < second, "both leave": points > 1 - second}
    assert soft.seen_and_lit(first, second, *ways) == pytest.approx((free & chosen[expected]).mean(), abs=1e-3)


def test_a_smooth_function_of_the_azimuth_is_found_around_any_direction_and_a_quarter_turn_is_exact():
    """Linear interpolation of a second derivative of 1 errs by at most h^2 / 8, twice, with h up to 0.25."""
    even = np.sin(2.0 * np.pi * np.arange(2 * soft.AZIMUTHS) / (2 * soft.AZIMUTHS) + 0.3)[:, None]
    table = soft.from_even(even)[:, 0]
    for angle in np.linspace(0.0, 2.0 * np.pi, 97):
        low, high, turn = soft.around(np.float32(0.7 * np.cos(angle)), np.float32(0.7 * np.sin(angle)))
        assert 0 <= low < soft.AZIMUTHS and high == (low + 1) % soft.AZIMUTHS and 0.0 <= turn <= 1.0
        assert abs((1.0 - turn) * table[low] + turn * table[high] - np.sin(angle + 0.3)) < 0.015
    # The diamond angle runs clockwise.
    for x, y in np.random.default_rng(1).normal(size=(50, 2)).astype(np.float32):
        own, turned = soft.around(x, y), soft.around(y, -x)
        quarters = [(after - before) % soft.AZIMUTHS * 4 for before, after in zip(own[:2], turned[:2], strict=True)]
        assert quarters == [soft.AZIMUTHS] * 2 and turned[2] == pytest.approx(own[2], abs=1e-5)
    low, _, turn = soft.around(np.float32(0.0), np.float32(0.0))
    assert 0 <= low < soft.AZIMUTHS and 0.0 <= turn <= 1.0


def test_azimuths_are_read_to_second_order_and_what_two_see_together_lies_between_the_bounds():
    """Linear interpolation: the error falls by four with twice the azimuths."""
    t = np.arange(soft.AZIMUTHS) * 4.0 / soft.AZIMUTHS
    y = np.where(t <= 2.0, 1.0 - t, t - 3.0)
    angle = np.arctan2(y, np.where(t <= 2.0, 1.0, -1.0) * (1.0 - np.abs(y)))
    counts, errors = [16, 32, 64, 128, 256], []
    for count in counts:
        even = np.sin(2.0 * np.pi * np.arange(count) / count + 0.3)[:, None]
        errors.append(np.abs(soft.from_even(even)[:, 0] - np.sin(angle + 0.3)).max())
    assert -2.2 < np.polyfit(np.log(counts), np.log(errors), 1)[0] < -1.7, errors
    # Frechet's bounds; it is symmetric, and all of what one sees if the other sees everything.
    random = np.random.default_rng(7)
    for first, second, *xy in random.random((200, 6)).astype(np.float32):
        ways = soft.azimuths_apart(*(np.float32(2.0 * w - 1.0) for w in xy))
        both = soft.seen_and_lit(first, second, *ways)
        assert max(first + second - 1.0, 0.0) - 1e-6 <= both <= min(first, second) + 1e-6
        assert both == pytest.approx(soft.seen_and_lit(second, first, *ways), abs=1e-6)
        assert soft.seen_and_lit(first, np.float32(1.0), *ways) == pytest.approx(first, abs=1e-6)
        assert soft.azimuths_apart(*(np.float32(2.0 * w - 1.0) for w in (*xy[2:], *xy[:2]))) == pytest.approx(
            ways, abs=1e-6
        )


def test_a_fall_of_the_largest_share_is_a_line_in_the_curvature_also_between_two_azimuths():
    """With shares of 1 the sine falls by FALL times the curvature, between tabulated curvatures too."""
    for curvature in (0.0, 0.01, 0.05, 0.1, 0.25, 0.7, 1.0):
        bend = soft.bend_of(np.float32(curvature))
        assert 0 <= bend.low <= bend.high < len(soft.CURVATURES)
        assert bend.of_low + bend.of_high == pytest.approx(soft.FALL * curvature, rel=1e-6)
        if curvature in soft.CURVATURES:
            assert max(bend.of_low, bend.of_high) == pytest.approx(soft.FALL * curvature, rel=1e-6)
            own = bend.high if bend.of_high > 0 else bend.low
            assert soft.CURVATURES[own] == curvature
    # By the tabulated falls times their factors; without curvature they do not.
    random, turn = np.random.default_rng(2), np.float32(0.3)
    mean, falls = (np.float32(random.random(shape)) for shape in ((2, 1, 16), (len(soft.CURVATURES), 2, 1, 16)))
    for curvature in (0.0, 0.03, 0.4):
        bend, found = soft.bend_of(np.float32(curvature)), np.zeros((1, 16), np.float32)
        soft.bend_rows(mean, falls, 0, 1, turn, bend, found)
        flat, little, much = ((1.0 - turn) * a[0] + turn * a[1] for a in (mean, falls[bend.low], falls[bend.high]))
        np.testing.assert_allclose(found, flat - bend.of_low * little - bend.of_high * much, atol=1e-6)
        assert curvature > 0.0 or np.allclose(found, flat, atol=1e-6)
