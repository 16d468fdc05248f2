"""The least curvature along the ray's way, against closed forms on cylinders, ellipses and spheres."""

import numpy as np
import pytest

from pipeline.scenes.curvature import euler_curvature, minimum_curvature

RADIUS = 5.0
CYLINDER = np.diag([1 / RADIUS**2, 1 / RADIUS**2, 0.0])


def _unit(vectors):
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def test_straight_across_a_cylinder_it_is_one_over_the_radius():
    turn = np.linspace(0.0, 6.0, 7)
    point = RADIUS * np.stack([np.cos(turn), np.sin(turn), 0 * turn], axis=-1)
    across = np.stack([-np.sin(turn), np.cos(turn), 0 * turn], axis=-1)
    found = minimum_curvature(CYLINDER, point, _unit(0.2 * point / RADIUS + across))
    np.testing.assert_allclose(found, 1 / RADIUS, rtol=1e-12)


def test_obliquely_it_is_eulers_and_along_the_axis_zero():
    """The section is an ellipse that the point lies on the flattest place of: its least curvature is there."""
    angle = np.linspace(0.0, np.pi / 2, 10)
    point = np.tile([RADIUS, 0.0, 0.0], (10, 1))
    wo = _unit(np.stack([0.1 + 0 * angle, np.cos(angle), np.sin(angle)], axis=-1))
    expected = euler_curvature(np.float64(1 / RADIUS), np.float64(0.0), angle)
    np.testing.assert_allclose(minimum_curvature(CYLINDER, point, wo), expected, rtol=1e-9, atol=1e-12)
    # The mean over the stretch would be greater, but for the first and the last.
    ahead = minimum_curvature(CYLINDER, point, wo, stretch=0.0)
    np.testing.assert_allclose(ahead, expected, rtol=1e-12, atol=1e-12)


def test_towards_the_flat_side_of_an_ellipse_it_is_that_of_the_end_of_the_stretch():
    """Curvature a b / (a^2 sin^2 + b^2 cos^2)^(3/2) at (a cos, b sin); the stretch's end by arc length."""
    a, b = 8.0, 3.0
    turn = np.linspace(0.0, np.pi / 2, 200_001)
    arc = np.concatenate([[0], np.cumsum(np.hypot(np.diff(a * np.cos(turn)), np.diff(b * np.sin(turn))))])
    curve = a * b / (a**2 * np.sin(turn) ** 2 + b**2 * np.cos(turn) ** 2) ** 1.5
    start = 40_000
    point = np.array([[a * np.cos(turn[start]), b * np.sin(turn[start]), 0.0]])
    tangent = _unit(np.array([[-a * np.sin(turn[start]), b * np.cos(turn[start]), 0.0]]))
    quadric = np.diag([1 / a**2, 1 / b**2, 0.0])
    stretch = 1.5
    end = np.searchsorted(arc, arc[start] + stretch)
    found = minimum_curvature(quadric, point, -tangent, stretch=stretch)
    assert found[0] == pytest.approx(curve[end], rel=2e-3)
    # The other way the curvature grows: the least is where it starts.
    assert minimum_curvature(quadric, point, tangent, stretch=stretch)[0] == pytest.approx(curve[start], rel=1e-9)
    assert curve[start] > 1.3 * curve[end]


def test_wider_yarns_see_more_curvature():
    sphere = np.eye(3) / RADIUS**2
    point, wo = np.array([[0.0, 0.0, RADIUS]]), np.array([[0.6, 0.0, 0.8]])
    for spacing in (0.01, 1.0, 3.0):
        found = minimum_curvature(sphere, point, wo, spacing=spacing)
        assert found[0] == pytest.approx(spacing / RADIUS, rel=1e-12)
    # A larger world with its yarns is the same picture.
    quadric = np.diag([1 / 8.0**2, 1 / 3.0**2, 1 / 5.0**2])
    point = np.array([[8 * 0.6, 3 * 0.8, 0.0]])
    small = minimum_curvature(quadric, point, np.array([[0.48, 0.6, 0.64]]), 0.25)
    large = minimum_curvature(quadric / 4.0**2, 4.0 * point, np.array([[0.48, 0.6, 0.64]]), 1.0)
    np.testing.assert_allclose(small, large, rtol=1e-12)


def test_concave_places_are_flat_and_a_viewer_on_the_normal_is_answered():
    hyperboloid = np.diag([1.0, 1.0, -1.0])
    waist = np.array([[1.0, 0.0, 0.0]])
    assert minimum_curvature(hyperboloid, waist, np.array([[0.0, 0.0, 1.0]]), stretch=0.1).tolist() == [0.0]
    assert minimum_curvature(np.eye(3), waist, waist)[0] == pytest.approx(1.0)
