import colour
import numpy as np
import pytest

from weaves.colour import Spectrum, delta_e, encoded, linear_rgb


def test_hex_is_decoded_by_the_srgb_curve_which_encoding_inverts():
    """IEC 61966-2-1: below 0.04045 a line, above it ((c + 0.055)/1.055)^2.4."""
    assert linear_rgb("#000000") == (0, 0, 0) and linear_rgb("#FFFFFF") == pytest.approx((1, 1, 1))
    assert linear_rgb("#0a80ff") == pytest.approx((10 / 255 / 12.92, ((128 / 255 + 0.055) / 1.055) ** 2.4, 1))
    codes = [f"#{code:02x}{code:02x}{code:02x}" for code in range(256)]
    linear = np.array([linear_rgb(code) for code in codes])
    assert np.allclose(encoded(linear), np.arange(256)[:, None] / 255, atol=1e-7)


@pytest.mark.parametrize("level", [0.0, 0.18, 1.0])
def test_a_flat_spectrum_is_grey_of_its_own_level(level):
    """Under D65 a perfect diffuser is the white of sRGB; the tolerance is the rounding of the white point."""
    rgb = linear_rgb(Spectrum(wavelengths=(400, 700), values=(level, level)))
    assert np.allclose(rgb, level, atol=1e-3)


SHARMA = """
    50 2.6772 -79.7751 50 0 -82.7485 2.0425   50 2.49 -0.001 50 -2.49 0.0009 7.1792
    50 2.5 0 73 25 -18 27.1492   50 2.5 0 58 24 15 19.4535
    60.2574 -34.0099 36.2677 60.4626 -34.1751 39.4387 1.2644   63.0109 -31.0961 -5.8663 62.8187 -29.7946 -4.0864 1.263
    22.7233 20.0904 -46.694 23.0331 14.973 -42.5619 2.0373   90.8027 -2.0831 1.441 91.1528 -1.6435 0.0447 1.4441
"""
"""L*a*b* pairs and CIEDE2000 from table 1 of Sharma2005CIEDE2000: blue, grey, large and small differences."""


def test_published_colour_differences_and_a_spectrum_rising_to_the_red():
    """To the four digits that are published."""
    pairs, white = np.array(SHARMA.split(), np.float64).reshape(4, 2, 7), (0.3127, 0.3290)
    to_rgb = np.linalg.inv([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])
    first, second = (colour.Lab_to_XYZ(lab, white) @ to_rgb.T for lab in (pairs[..., :3], pairs[..., 3:6]))
    np.testing.assert_allclose(delta_e(first, second), pairs[..., 6], rtol=0, atol=6e-5)
    red, green, blue = linear_rgb(Spectrum(wavelengths=(380, 570, 600, 780), values=(0.05, 0.05, 0.6, 0.6)))
    assert red > 3 * green > 0 and green >= blue
    rgb = linear_rgb(Spectrum(wavelengths=(500, 505, 515, 520), values=(0, 1, 1, 0)))
    assert min(rgb) == 0 and max(rgb) <= 1
