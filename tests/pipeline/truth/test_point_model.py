"""The point model against 50-digit arithmetic and closed forms."""

import math

import mpmath
import numpy as np
import pytest
from scipy import integrate

from pipeline.truth.microflake import density, sigma
from pipeline.truth.slab import reflection

RNG = np.random.default_rng(1)


def _unit(theta, phi):
    return np.array([math.sin(theta) * math.cos(phi), math.sin(theta) * math.sin(phi), math.cos(theta)])


def _exact_specular(i, o, t, alpha, thickness):
    """Return f_r by the textbook form: matrix S and its inverse, in 50 digits."""
    mpmath.mp.dps = 50
    i, o, t = (mpmath.matrix([mpmath.mpf(float(x)) for x in w]) for w in (i, o, t))
    a = mpmath.mpf(alpha)
    projector = t * t.T / (t.T * t)[0]
    identity = mpmath.eye(3)
    shape = identity - (1 - a**2) * projector
    inverse = identity - (1 - 1 / a**2) * projector
    h = i + o
    h /= mpmath.sqrt((h.T * h)[0])
    flakes = 1 / (mpmath.pi * a * (h.T * inverse * h)[0] ** 2)
    s_i, s_o = (mpmath.sqrt((w.T * shape * w)[0]) for w in (i, o))
    depth = mpmath.mpf(thickness) * (s_i / i[2] + s_o / o[2])
    return float(flakes * (1 - mpmath.exp(-depth)) / (4 * (s_i * o[2] + s_o * i[2])))


@pytest.mark.parametrize("alpha", [0.01, 0.1, 0.5, 1.0])
@pytest.mark.parametrize("thickness", [0.001, 2.0, 100.0])
def test_specular_matches_50_digits(alpha, thickness):
    worst = 0.0
    for _ in range(60):
        i, o = (_unit(RNG.uniform(0, math.radians(89.9)), RNG.uniform(0, 2 * math.pi)) for _ in range(2))
        t = _unit(RNG.uniform(0.3, math.pi - 0.3), RNG.uniform(0, 2 * math.pi))
        ours = reflection(
            density(*(i + o), *t, alpha), sigma(*i, *t, alpha), sigma(*o, *t, alpha), i[2], o[2], thickness
        )
        exact = _exact_specular(i, o, t, alpha, thickness)
        worst = max(worst, abs(ours - exact) / exact)
    # i, o, t are unit to 1e-16 only; alpha = .01 magnifies what the matrix form makes of that by alpha^-2.
    assert worst < 1e-12 / alpha


@pytest.mark.parametrize("alpha", [0.1, 0.5, 1.0])
def test_flakes_project_to_sigma(alpha):
    # The integral of D <w.h> over the sphere is sigma(w); the fibre lies along z, w in the x-z plane.
    t = (0.0, 0.0, 1.0)
    w = _unit(0.7, 0.0)

    def inner(mu, phi):
        h = _unit(math.acos(mu), phi)
        return density(*h, *t, alpha) * max(0.0, float(h @ w))

    total, _ = integrate.dblquad(inner, 0, 2 * math.pi, -1, 1, epsabs=1e-6)
    assert total == pytest.approx(sigma(*w, *t, alpha), rel=2e-5)


def test_round_flakes_equal_the_lommel_seeliger_slab():
    i, o, t = _unit(0.4, 0.1), _unit(1.1, 2.0), _unit(1.2, 0.5)
    ours = reflection(density(*(i + o), *t, 1.0), sigma(*i, *t, 1.0), sigma(*o, *t, 1.0), i[2], o[2], 2.0)
    assert ours == pytest.approx(-math.expm1(-2.0 * (1 / i[2] + 1 / o[2])) / (4 * math.pi * (i[2] + o[2])), rel=1e-13)


def test_specular_is_reciprocal_to_the_last_bit():
    for _ in range(200):
        i, o = (_unit(RNG.uniform(0, 1.5), RNG.uniform(0, 2 * math.pi)) for _ in range(2))
        t = _unit(RNG.uniform(0, math.pi), RNG.uniform(0, 2 * math.pi))
        values = [
            reflection(density(*(a + b), *t, 0.2), sigma(*a, *t, 0.2), sigma(*b, *t, 0.2), a[2], b[2], 2.0)
            for a, b in ((i, o), (o, i))
        ]
        assert values[0] == values[1]


def test_opposite_directions_give_no_nan():
    w = _unit(0.3, 0.2)
    assert density(*(w - w), 0.0, 1.0, 0.0, 0.1) == 0.0
