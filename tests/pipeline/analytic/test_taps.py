import numpy as np
import pytest
from scipy.stats import norm

from pipeline.analytic.taps import taps


def test_readings_have_the_moments_of_a_gaussian():
    table = taps(16)
    assert not table[1].any()
    for count in range(2, 17):
        places = table[count, :count]
        assert places.mean() == pytest.approx(0.0, abs=1e-12) and (places**2).mean() == pytest.approx(1.0)


def test_many_readings_damp_a_wave_as_a_gaussian_does():
    places = taps(256)[256]
    for wave in (0.5, 1.0, 2.0):
        expected = norm.expect(lambda z, wave=wave: np.cos(wave * z))
        assert np.cos(wave * places).mean() == pytest.approx(expected, abs=0.01)
