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
    50 2.6772 -79.7751 50 0 -82.7485 2.0425   50 3.1571 -77.2803 50 0 -82.7485 2.8615
    50 2.8361 -74.02 50 0 -82.7485 3.4412   50 -1.3802 -84.2814 50 0 -82.7485 1
    50 -1.1848 -84.8006 50 0 -82.7485 1   50 -0.9009 -85.5211 50 0 -82.7485 1
    50 0 0 50 -1 2 2.3669   50 -1 2 50 0 0 2.3669
    50 2.49 -0.001 50 -2.49 0.0009 7.1792   50 2.49 -0.001 50 -2.49 0.0011 7.2195
    50 2.49 -0.001 50 -2.49 0.0012 7.2195   50 -0.001 2.49 50 0.0009 -2.49 4.8045
    50 -0.001 2.49 50 0.0011 -2.49 4.7461   50 2.5 0 50 0 -2.5 4.3065
    50 2.5 0 73 25 -18 27.1492   50 2.5 0 61 -5 29 22.8977
    50 2.5 0 56 -27 -3 31.903   50 2.5 0 58 24 15 19.4535
    50 2.5 0 50 3.1736 0.5854 1   50 2.5 0 50 3.2972 0 1
    50 2.5 0 50 1.8634 0.5757 1   50 2.5 0 50 3.2592 0.335 1
    60.2574 -34.0099 36.2677 60.4626 -34.1751 39.4387 1.2644   63.0109 -31.0961 -5.8663 62.8187 -29.7946 -4.0864 1.263
    61.2901 3.7196 -5.3901 61.4292 2.248 -4.962 1.8731   35.0831 -44.1164 3.7933 35.0232 -40.0716 1.5901 1.8645
    22.7233 20.0904 -46.694 23.0331 14.973 -42.5619 2.0373   36.4612 47.858 18.3852 36.2715 50.5065 21.2231 1.4146
    90.8027 -2.0831 1.441 91.1528 -1.6435 0.0447 1.4441   90.9257 -0.5406 -0.9208 88.6381 -0.8985 -0.7239 1.5381
    6.7747 -0.2908 -2.4247 5.8714 -0.0985 -2.2286 0.6377   2.0776 0.0795 -1.135 0.9033 -0.0636 -0.5514 0.9082
"""
"""L*a*b* pairs and CIEDE2000, table 1 of Sharma2005CIEDE2000, without its pairs 10 and 14: their hues are opposite to
the last digit, where the formula jumps and rounding on the way through RGB decides."""


def from_lab(lab):
    """Return linear sRGB (also negative) of a colour under D65: the inverse of the path, written out anew."""
    lightness, a, b = lab
    y = (lightness + 16) / 116
    cubes = [t**3 if t > 6 / 29 else 3 * (6 / 29) ** 2 * (t - 4 / 29) for t in (y + a / 500, y, y - b / 200)]
    xyz = np.array([0.3127 / 0.3290, 1.0, (1 - 0.3127 - 0.3290) / 0.3290]) * cubes
    return np.linalg.solve([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]], xyz)


def test_published_colour_differences_and_a_spectrum_rising_to_the_red():
    """To the four digits that are published."""
    pairs = np.array(SHARMA.split(), np.float64).reshape(4, 8, 7)
    first, second = (np.apply_along_axis(from_lab, -1, lab) for lab in (pairs[..., :3], pairs[..., 3:6]))
    np.testing.assert_allclose(delta_e(first, second), pairs[..., 6], rtol=0, atol=6e-5)
    red, green, blue = linear_rgb(Spectrum(wavelengths=(380, 570, 600, 780), values=(0.05, 0.05, 0.6, 0.6)))
    assert red > 3 * green > 0 and green >= blue
    rgb = linear_rgb(Spectrum(wavelengths=(500, 505, 515, 520), values=(0, 1, 1, 0)))
    assert min(rgb) == 0 and max(rgb) <= 1
