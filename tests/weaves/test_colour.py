"""Colours: three notations, one linear sRGB."""

import numpy as np
import pytest

from weaves.colour import Spectrum, linear_rgb
from weaves.yarn import Yarn


def test_linear_rgb_is_taken_as_it_is():
    assert linear_rgb((0.1, 0.2, 0.3)) == (0.1, 0.2, 0.3)


def test_hex_is_decoded_by_the_srgb_curve():
    """IEC 61966-2-1: below 0.04045 a line, above it ((c + 0.055)/1.055)^2.4."""
    assert linear_rgb("#000000") == (0, 0, 0)
    assert linear_rgb("#FFFFFF") == pytest.approx((1, 1, 1))
    assert linear_rgb("#0a80ff") == pytest.approx((10 / 255 / 12.92, ((128 / 255 + 0.055) / 1.055) ** 2.4, 1))


@pytest.mark.parametrize("level", [0.0, 0.18, 1.0])
def test_a_flat_spectrum_is_grey_of_its_own_level(level):
    """Under D65 a perfect diffuser is the white of sRGB; the tolerance is the rounding of the white point."""
    rgb = linear_rgb(Spectrum(wavelengths=(400, 700), values=(level, level)))
    assert np.allclose(rgb, level, atol=1e-3)


def test_a_spectrum_rising_to_the_red_is_red():
    red, green, blue = linear_rgb(Spectrum(wavelengths=(380, 570, 600, 780), values=(0.05, 0.05, 0.6, 0.6)))
    assert red > 3 * green > 0
    assert green >= blue


def test_saturated_spectra_are_clipped_to_the_gamut():
    rgb = linear_rgb(Spectrum(wavelengths=(500, 505, 515, 520), values=(0, 1, 1, 0)))
    assert all(0 <= channel <= 1 for channel in rgb)
    assert min(rgb) == 0


def test_yarn_gives_both_colours_in_linear_rgb():
    yarn = Yarn(bend=10, roughness=0.2, specular=(0.5, 0.4, 0.3), diffuse="#ff0000")
    assert yarn.specular_rgb == (0.5, 0.4, 0.3)
    assert yarn.diffuse_rgb == pytest.approx((1, 0, 0))
