"""Footprints in closed form, against the singular values that NumPy finds."""

import numpy as np
import pytest

from pipeline.mitsuba.footprint import LARGEST, PIXEL, Footprints


def test_axes_are_singular_vectors_and_deviations_singular_values():
    jacobian = np.random.default_rng(0).standard_normal((500, 2, 2))
    found = Footprints.of(jacobian)
    vectors, sizes, _ = np.linalg.svd(jacobian)
    np.testing.assert_allclose(found.sigma, PIXEL * sizes[:, 0], rtol=1e-5)
    np.testing.assert_allclose(found.sigma_minor, PIXEL * sizes[:, 1], rtol=1e-4, atol=2e-6)
    axis = np.stack([np.cos(found.angle), np.sin(found.angle)], axis=-1)
    np.testing.assert_allclose(np.abs(np.einsum("ni,ni->n", axis, vectors[:, :, 0])), 1.0, atol=1e-5)


def test_the_narrow_axis_of_a_long_footprint_is_exact():
    """A ratio of 1e6 between the axes, turned by .3: a difference of squares would lose the narrow one."""
    turn = np.array([[np.cos(0.3), -np.sin(0.3)], [np.sin(0.3), np.cos(0.3)]])
    found = Footprints.of((turn @ np.diag([10.0, 1e-5]))[None])
    np.testing.assert_allclose([found.sigma[0], found.sigma_minor[0], found.angle[0]], [5.0, 5e-6, 0.3], rtol=1e-5)


@pytest.mark.parametrize("lost", [np.nan, np.inf, 1e30])
def test_a_footprint_without_derivatives_is_the_largest(lost):
    assert Footprints.of(np.array([[[lost, 0.0], [0.0, 1.0]]])).sigma[0] == LARGEST


def test_round_footprints_are_cut_too():
    found = Footprints.round(np.array([0.5, 1e9, 0.0]))
    np.testing.assert_array_equal(found.sigma, found.sigma_minor)
    assert found.sigma[0] == 0.5 and found.sigma[1] == LARGEST and found.sigma[2] > 0.0
