"""Tone curves: their formulas, and the exposure of the page."""

import numpy as np
import pytest

from reports.images.tiles import EXPOSURE, encoded
from reports.images.tone import displayed


def test_the_default_is_the_page():
    linear = np.linspace(0.0, 1.0, 60).reshape(4, 5, 3)
    np.testing.assert_array_equal(displayed(linear), encoded(EXPOSURE * linear))
    assert displayed(np.array([0.9, 0.9, 0.9])).tolist() == [255] * 3


@pytest.mark.parametrize("tone", ["srgb", "reinhard"])
def test_a_stop_doubles_the_light(tone):
    linear = np.geomspace(1e-3, 0.4, 30).reshape(10, 3)
    np.testing.assert_array_equal(displayed(linear, tone, 1.0), displayed(2.0 * linear, tone))
    np.testing.assert_array_equal(displayed(linear, tone, -2.0), displayed(0.25 * linear, tone))


def test_reinhard_keeps_the_hue_and_never_ends():
    """Grey of luminance L becomes L / (1 + L): 1 becomes a half, and no grey becomes 1."""
    grey = np.array([1.0, 1.0, 1.0]) / EXPOSURE
    np.testing.assert_array_equal(displayed(grey, "reinhard"), encoded(np.full(3, 0.5)))
    bright = displayed(1e3 * grey, "reinhard", -3.0), displayed(1e3 * grey, "srgb", -3.0)
    assert bright[0].max() < 255 == bright[1].max()
