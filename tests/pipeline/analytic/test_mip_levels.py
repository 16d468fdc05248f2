"""The kernel with which maps are read: read from a map of one bright texel, its moments are those of the Gaussian."""

import math

import numpy as np
import pytest

from pipeline.analytic.mip_levels import add_mean, pyramid

TEXELS = 64


def read(maps, u, v, sigma, weight=1.0):
    sums = np.zeros(maps.texels.shape[1], np.float32)
    add_mean(maps, u, v, sigma, weight, sums)
    return sums.astype(np.float64)


@pytest.fixture(scope="module")
def noise():
    return np.random.default_rng(3).random((TEXELS, TEXELS, 2))


@pytest.mark.parametrize("octave", [0.0, 0.3, 0.5, 1.0, 1.6, 2.0])
def test_the_kernel_has_the_mass_mean_and_variance_of_the_gaussian(octave):
    """Texels of width h, read bilinearly, average with variance h^2 / 4: sigma^2 = 4^l h^2 / 4 at a whole level l.
    Between two levels variances are mixed on a line, (1 + 3 s) in place of 4^s. A bright column is at all places that
    it may have within a coarse texel; sums over an eighth of a texel are integrals to 1 % of the variance."""
    width, step = 8.0 / TEXELS, math.floor(octave)
    sigma, expected = 0.5 * width * 2.0**octave, (0.5 * width * 2.0**step) ** 2 * (1.0 + 3.0 * (octave - step))
    centres, mass, mean, variance = (np.arange(8 * TEXELS) + 0.5) * width / 8.0, 0.0, 0.0, 0.0
    for column in range(28, 36):
        bright = np.zeros((TEXELS, TEXELS, 1))
        bright[:, column] = 1.0 / 64.0
        maps, place = pyramid(bright, (8, 8)), (column + 0.5) * width
        kernel = np.array([read(maps, u, 0.3, sigma)[0] for u in centres])
        mass += kernel.sum()
        mean += kernel @ (centres - place)
        # The column itself is a texel wide.
        variance += kernel @ ((centres - place) ** 2 + width**2 / 12.0)
    assert mass == pytest.approx(1.0, rel=1e-5) and mean == pytest.approx(0.0, abs=1e-6)
    assert variance == pytest.approx(expected, rel=0.01)


def test_a_constant_is_read_as_it_is_a_coarse_reading_is_the_mean_and_a_narrow_one_bilinear(noise):
    even, maps = pyramid(np.full((TEXELS, TEXELS, 1), 0.7), (8, 8)), pyramid(noise, (8, 8))
    for sigma in (1e-3, 0.06, 0.11, 0.9, 30.0):
        assert read(even, 3.3, -2.9, sigma)[0] == pytest.approx(0.7, rel=1e-6)
    np.testing.assert_allclose(read(maps, 1.0, 2.0, 1e3), noise.mean(axis=(0, 1)), rtol=1e-6)
    np.testing.assert_allclose(read(maps, 1.0, 2.0, 0.2, 2.5), 2.5 * read(maps, 1.0, 2.0, 0.2), rtol=1e-6)
    # At centres of texels their values, halfway the means of two and of four.
    maps, width = pyramid(noise, (8, 8)), 8.0 / TEXELS
    expected = {(5.5, 9.5): noise[9, 5], (6.0, 9.5): noise[9, 5:7].mean(axis=0)}
    expected |= {(6.0, 10.0): noise[9:11, 5:7].mean(axis=(0, 1)), (5.5, 0.0): noise[[-1, 0], 5].mean(axis=0)}
    for (x, y), value in expected.items():
        np.testing.assert_allclose(read(maps, x * width, y * width, 1e-3), value, rtol=1e-6)


@pytest.mark.parametrize("sigma", [0.03, 0.1, 0.25])
def test_a_moved_map_is_read_at_the_moved_place_and_a_mirrored_one_at_its_mirror_image(noise, sigma):
    """Moves by eight texels, which are whole texels of the four finest levels."""
    planes = noise, np.roll(noise, (8, -16), (0, 1)), noise[:, ::-1]
    maps, moved, mirrored = (pyramid(plane, (8, 8)) for plane in planes)
    for u, v in np.random.default_rng(1).random((20, 2)) * 8.0:
        own = read(maps, u, v, sigma)
        np.testing.assert_allclose(read(moved, u - 2.0, v + 1.0, sigma), own, rtol=1e-4)
        np.testing.assert_allclose(read(mirrored, 8.0 - u, v, sigma), own, rtol=1e-4)
        np.testing.assert_allclose(read(maps, u + 800.0, v - 1600.0, sigma), own, rtol=1e-4)
