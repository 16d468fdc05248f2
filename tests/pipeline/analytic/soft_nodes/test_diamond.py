"""Values known for even azimuths are found again between those of the diamond angle."""

import numpy as np

from pipeline.analytic.soft_nodes.diamond import AZIMUTHS, around, from_even


def test_a_smooth_function_of_the_azimuth_is_found_around_any_direction():
    """Linear interpolation of a second derivative of 1 errs by at most h^2 / 8, twice, with h up to 0.25."""
    even = np.sin(2.0 * np.pi * np.arange(2 * AZIMUTHS) / (2 * AZIMUTHS) + 0.3)[:, None]
    table = from_even(even)[:, 0]
    for angle in np.linspace(0.0, 2.0 * np.pi, 97):
        low, high, turn = around(np.float32(0.7 * np.cos(angle)), np.float32(0.7 * np.sin(angle)))
        assert 0 <= low < AZIMUTHS and high == (low + 1) % AZIMUTHS and 0.0 <= turn <= 1.0
        assert abs((1.0 - turn) * table[low] + turn * table[high] - np.sin(angle + 0.3)) < 0.015


def test_no_azimuth_is_an_azimuth_too():
    low, _, turn = around(np.float32(0.0), np.float32(0.0))
    assert 0 <= low < AZIMUTHS and 0.0 <= turn <= 1.0
