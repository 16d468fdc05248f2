import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.truth.footprint.mixture import COARSE_LINE, FINE_LINE, axes, footprints, line_points, narrow_axis
from pipeline.truth.query import Queries

CORRELATIONS = [0.02, 0.1, 0.15, 0.16, 0.28, 0.29, 0.5, 0.7, 0.9, 0.97, 0.99]


def points(correlation, line):
    places, shares = np.zeros(line.points, np.float32), np.zeros(line.points, np.float32)
    count = line_points(correlation, line, places, shares)
    return places[:count].astype(np.float64), shares[:count].astype(np.float64)


@given(major=st.floats(1e-2, 1e2), ratio=st.floats(1.0, 50.0), angle=st.floats(-math.pi, math.pi), swap=st.booleans())
def test_deviations_and_correlation_are_those_of_the_turned_covariance(major, ratio, angle, swap):
    sides = (major / ratio, major) if swap else (major, major / ratio)
    turn = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
    covariance = turn @ np.diag(np.square(sides)) @ turn.T
    x, y, correlation = axes(*(np.array([number]) for number in (*sides, angle)))[:, 0]
    np.testing.assert_allclose([x * x, y * y], np.diag(covariance), rtol=1e-9)
    assert correlation * x * y == pytest.approx(covariance[0, 1], abs=1e-9 * major**2)
    assert narrow_axis(x, y, correlation) == pytest.approx(min(sides), rel=1e-4)


def test_the_mixture_is_the_gaussian_of_a_round_footprint_and_a_wider_one_of_a_thin_ellipse():
    """Both kernels by their Fourier transforms, all that a sum over nodes can tell them apart by."""
    for sign in [-1.0, 1.0]:
        for correlation in CORRELATIONS:
            for line, bound in [(COARSE_LINE, 0.02), (FINE_LINE, 1e-4)]:
                places, shares = points(sign * correlation, line)
                assert shares.sum() == pytest.approx(1.0, abs=1e-6)
                assert shares @ places == pytest.approx(0.0, abs=1e-6)
                x, y = np.meshgrid(np.linspace(-6, 6, 61), np.linspace(-6, 6, 61))  # waves, in deviations of both axes
                own = np.exp(-0.5 * (x * x + y * y + 2 * sign * correlation * x * y))
                blur, root = 1.0 - correlation, math.sqrt(correlation)
                along = root * (x + sign * y)
                mixture = np.exp(-0.5 * blur * (x * x + y * y)) * np.einsum(
                    "p,pij->ij", shares, np.cos(np.multiply.outer(places, along))
                )
                assert np.abs(mixture - own).max() < bound
    size = np.array([1.0, 1.0, 1.0], np.float32)
    minor, angle = np.array([1e-3, 1.0, 0.5], np.float32), np.array([0.7, 0.7, 0.0], np.float32)
    zero = np.zeros(3, np.float32)
    _, _, x, y, correlation = footprints(Queries(zero, zero, size, zero, zero, minor, angle, zero))
    assert abs(correlation[0]) == pytest.approx(COARSE_LINE.most)
    np.testing.assert_array_equal(correlation[1:], 0.0)
    np.testing.assert_array_equal(x[1:], 1.0)
    np.testing.assert_array_equal(y[1:], [1.0, 0.5])
    places, _ = points(COARSE_LINE.most, COARSE_LINE)
    assert len(places) <= COARSE_LINE.points and places[-1] == pytest.approx(COARSE_LINE.reach, rel=0.1)
