import math

import mpmath
import numpy as np
import pytest

from pipeline.truth.scattering.slab import density, reflection, sigma, transmission, unscattered

RNG = np.random.default_rng(1)


def _unit(theta, phi):
    return np.array([math.sin(theta) * math.cos(phi), math.sin(theta) * math.sin(phi), math.cos(theta)])


def _exact_flakes(i, o, t, alpha):
    """Return D, both sigma and i, o by the textbook form, matrix S and its inverse, in 50 digits."""
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
    return flakes, s_i, s_o, i, o


def _exact_specular(i, o, t, alpha, thickness):
    flakes, s_i, s_o, i, o = _exact_flakes(i, o, t, alpha)
    depth = mpmath.mpf(thickness) * (s_i / i[2] + s_o / o[2])
    return float(flakes * (1 - mpmath.exp(-depth)) / (4 * (s_i * o[2] + s_o * i[2])))


def _exact_transmission(i, o, t, alpha, thickness):
    """Return f_t in 50 digits: the difference of two exponentials, or its limit at equal Lambda."""
    flakes, s_i, s_o, i, o = _exact_flakes(i, o, t, alpha)
    thickness, c_i, c_o = mpmath.mpf(thickness), i[2], -o[2]
    if s_i * c_o == s_o * c_i:
        return float(flakes * thickness * mpmath.exp(-thickness * s_i / c_i) / (4 * c_i * c_o))
    crossing = mpmath.exp(-thickness * s_i / c_i) - mpmath.exp(-thickness * s_o / c_o)
    return float(flakes * crossing / (4 * (s_o * c_i - s_i * c_o)))


def test_specular_and_transmission_match_50_digits_and_at_equal_lambda_the_limit():
    for alpha in [0.01, 0.1, 0.5, 1.0]:
        for thickness in [0.001, 2.0, 100.0]:
            worst = 0.0
            for _ in range(60):
                i, o = (_unit(RNG.uniform(0, math.radians(89.9)), RNG.uniform(0, 2 * math.pi)) for _ in range(2))
                t = _unit(RNG.uniform(0.3, math.pi - 0.3), RNG.uniform(0, 2 * math.pi))
                sizes = sigma(*i, *t, alpha), sigma(*o, *t, alpha)
                ours = reflection(density(*(i + o), *t, alpha), *sizes, i[2], o[2], thickness)
                exact = _exact_specular(i, o, t, alpha, thickness)
                worst = max(worst, abs(ours - exact) / exact)
            # i, o, t are unit to 1e-16 only; alpha = .01 magnifies what the matrix form makes of that by alpha^-2.
            assert worst < 1e-12 / alpha
    for alpha in [0.01, 0.1, 0.5, 1.0]:
        for thickness in [0.001, 2.0, 100.0]:
            worst = 0.0
            for i, o, t in _crossing_pairs(60):
                flakes, *sigmas = density(*(i + o), *t, alpha), sigma(*i, *t, alpha), sigma(*o, *t, alpha)
                ours = transmission(flakes, *sigmas, i[2], -o[2], thickness)
                exact = _exact_transmission(i, o, t, alpha, thickness)
                if exact > 1e-300:
                    worst = max(worst, abs(ours - exact) / exact)
                else:
                    assert 0.0 <= ours < 1.1e-300
            # As for reflection: i, o, t are unit to 1e-16 only, which the matrix form magnifies by up to alpha^-2.
            assert worst < 1e-12 / alpha
    for thickness in [0.001, 2.0, 100.0]:
        for degrees in [0.0, 45.0, 89.9]:
            flakes, size, cosine = 0.7, 0.3, math.cos(math.radians(degrees))
            limit = flakes * thickness * math.exp(-thickness * size / cosine) / (4 * cosine * cosine)
            found = transmission(flakes, size, size, cosine, cosine, thickness)
            assert found == pytest.approx(limit, rel=1e-14, abs=1e-300)


def test_round_flakes_equal_the_slab_transmission_is_reciprocal_and_white_flakes_make_no_light():
    w = _unit(0.3, 0.2)
    assert density(*(w - w), 0.0, 1.0, 0.0, 0.1) == 0.0
    i, o, t = _unit(0.4, 0.1), _unit(1.1, 2.0), _unit(1.2, 0.5)
    ours = reflection(density(*(i + o), *t, 1.0), sigma(*i, *t, 1.0), sigma(*o, *t, 1.0), i[2], o[2], 2.0)
    assert ours == pytest.approx(-math.expm1(-2.0 * (1 / i[2] + 1 / o[2])) / (4 * math.pi * (i[2] + o[2])), rel=1e-13)
    for i, o, t in _crossing_pairs(200):
        s_i, s_o, flakes = sigma(*i, *t, 0.2), sigma(*o, *t, 0.2), density(*(i + o), *t, 0.2)
        there, back = transmission(flakes, s_i, s_o, i[2], -o[2], 2.0), transmission(flakes, s_o, s_i, -o[2], i[2], 2.0)
        assert there == back
    # The rest met a second flake; a thin layer loses nothing, as that is of second order in T.
    for alpha in [0.1, 0.5, 1.0]:
        for degrees in [0.0, 50.0, 80.0]:
            i, t = _unit(math.radians(degrees), 0.4), _unit(1.3, 0.9)
            assert _energy(i, t, alpha, 2.0) < 1.0
            assert _energy(i, t, alpha, 1e-4) == pytest.approx(1.0, abs=5e-3)


def _crossing_pairs(count):
    """Yield light in front, viewer behind and tangent; every other pair has almost equal Lambda, 1e-12 to 1 apart."""
    for k in range(count):
        i, o = (_unit(RNG.uniform(0, math.radians(89.9)), RNG.uniform(0, 2 * math.pi)) for _ in range(2))
        t = _unit(RNG.uniform(0.3, math.pi - 0.3), RNG.uniform(0, 2 * math.pi))
        if k % 2:
            # Turned by 180 degrees about the slab's normal, a tangent in its plane is its own opposite: same Lambda.
            t = _unit(math.pi / 2, RNG.uniform(0, 2 * math.pi))
            o = i * [-1, -1, 1] + 10 ** RNG.uniform(-12, 0) * RNG.uniform(-0.3, 0.3, 3)
            o /= np.linalg.norm(o)
        yield i, o * [1, 1, -math.copysign(1, o[2])], t


@pytest.mark.parametrize("thickness", [0.001, 2.0, 100.0])
def test_unscattered_matches_50_digits(thickness):
    mpmath.mp.dps = 50
    for degrees in (0.0, 30.0, 80.0, 89.9):
        for size in (0.01, 0.37, 1.0):
            cosine = math.cos(math.radians(degrees))
            exact = float(mpmath.exp(-mpmath.mpf(thickness) * mpmath.mpf(size) / mpmath.mpf(cosine)))
            assert unscattered(size, cosine, thickness) == pytest.approx(exact, rel=1e-12, abs=1e-300)


def _energy(i, t, alpha, thickness):
    """Return the energy that leaves the layer after one flake or none, by Gauss-Legendre and evenly in azimuth."""
    nodes, weights = np.polynomial.legendre.leggauss(48)
    sigma_i = sigma(*i, *t, alpha)
    total = unscattered(sigma_i, i[2], thickness)
    for cosine, weight in zip(0.5 + 0.5 * nodes, 0.5 * weights, strict=True):
        for phi in (np.arange(120) + 0.5) * (2 * math.pi / 120):
            o = _unit(math.acos(cosine), phi)
            for form, side in ((reflection, 1), (transmission, -1)):
                out = o * [1, 1, side]
                flakes = density(*(i + out), *t, alpha)
                value = form(flakes, sigma_i, sigma(*out, *t, alpha), i[2], cosine, thickness)
                total += value * cosine * weight * 2 * math.pi / 120
    return total
