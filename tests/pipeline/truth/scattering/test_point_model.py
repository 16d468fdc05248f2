import math

import numpy as np
import pytest

from pipeline.truth.scattering.slab import density, reflection, sigma, transmission
from tests.directions import unit


def test_round_flakes_equal_the_slab():
    """Fibres, and digits at the extremes, are in tests/reports/truth/test_stability.py."""
    w = unit(17, 11)
    assert density(*(w - w), 0.0, 1.0, 0.0, 0.1) == 0.0
    i, o, t = unit(23, 6), unit(63, 115), unit(69, 29)
    ours = reflection(density(*(i + o), *t, 1.0), sigma(*i, *t, 1.0), sigma(*o, *t, 1.0), i[2], o[2], 2.0)
    assert ours == pytest.approx(-math.expm1(-2.0 * (1 / i[2] + 1 / o[2])) / (4 * math.pi * (i[2] + o[2])), rel=1e-13)


def test_transmission_is_reciprocal_and_at_equal_lambda_its_limit():
    random = np.random.default_rng(1)
    for _ in range(200):
        i, o = (unit(random.uniform(0, 89.9), random.uniform(0, 360)) for _ in range(2))
        t = unit(random.uniform(17, 163), random.uniform(0, 360))
        s_i, s_o, flakes = sigma(*i, *t, 0.2), sigma(*o, *t, 0.2), density(*(i - o), *t, 0.2)
        there, back = transmission(flakes, s_i, s_o, i[2], o[2], 2.0), transmission(flakes, s_o, s_i, o[2], i[2], 2.0)
        assert there == back
    for thickness in [0.001, 2.0, 100.0]:
        for degrees in [0.0, 45.0, 89.9]:
            flakes, size, cosine = 0.7, 0.3, math.cos(math.radians(degrees))
            limit = flakes * thickness * math.exp(-thickness * size / cosine) / (4 * cosine * cosine)
            ours = transmission(flakes, size, size, cosine, cosine, thickness)
            assert ours == pytest.approx(limit, rel=1e-14, abs=1e-300)
