"""The edge of a cloth cylinder: geometry against closed forms, comparisons that know their answer."""

import numpy as np
import pytest

from pipeline.truth.estimator import estimate
from pipeline.truth.geometry.opacity import opacity
from pipeline.truth.options import TruthOptions
from reports.measure.silhouette import (
    edge_of,
    edge_queries,
    measure_silhouette,
    minimum_curvature,
    read_edge,
    render_edge,
    silhouette,
    true_edge,
)
from reports.options import EdgeOptions
from weaves.fabric import load_fabric

TINY = EdgeOptions(
    radius=10.0, depth=0.15, pixel=0.025, rows=5, truth=TruthOptions(relative_error=0.1, min_count=64, max_count=64)
)
DENIM = load_fabric("denim")


class Flat:
    """What a method without curvature answers: always the same, and it remembers the queries."""

    name, setting = "flat", ""

    def __init__(self):
        self.asked = []

    def covers(self, fabric):
        return True

    def prepare(self, fabric):
        pass

    def predict(self, fabric, queries, seed=0):
        self.asked.append(queries)
        return np.full((len(queries.u), 4), 0.25, np.float32)

    def bytes_stored(self, fabric):
        return 0


class Truth(Flat):
    """The truth as a method."""

    def predict(self, fabric, queries, seed=0):
        return estimate(fabric, queries, TINY.truth, TINY.seed).mean

    def missed(self, fabric, queries):
        return 1 - opacity(fabric, queries, TINY.truth, TINY.seed)[0]


def test_pixels_see_the_cylinder_as_the_camera_does():
    queries = edge_queries(TINY, (4, 4))
    assert len(queries.u) == 5 * 6
    distance = 10.0 - 0.025 * (np.arange(6)[::-1] + 0.5)
    np.testing.assert_allclose(queries.wo[:6, 2], np.sqrt(1 - (distance / 10) ** 2), rtol=1e-5)
    np.testing.assert_allclose(queries.wo[:6, 0], -distance / 10, rtol=1e-6)
    np.testing.assert_allclose(queries.curvature, 0.1, rtol=1e-6)
    np.testing.assert_allclose(queries.u[:6], np.mod(10 * np.arcsin(distance / 10), 4), rtol=1e-5)
    np.testing.assert_allclose(queries.v[::6], 0.025 * (np.arange(5) + 0.5), rtol=1e-5)
    # The angle between light and camera is the same everywhere: 60 degrees, lifted by 20.
    expected = np.cos(np.radians(60)) * np.cos(np.radians(20))
    np.testing.assert_allclose((queries.wi * queries.wo).sum(axis=1), expected, atol=1e-6)
    # Light from the edge's side: straight into the normal where the normal is turned to it.
    assert (queries.wi[:, 2] > 0.7).all()


def test_the_truth_finds_its_own_edge():
    assert silhouette(Truth(), DENIM, TINY) == (0.0, 0.0, 0.0)


def test_a_flat_method_covers_everything_and_is_asked_flat():
    method, truth = Flat(), true_edge(DENIM, TINY)
    found = silhouette(method, DENIM, TINY, truth)
    assert 0.05 < truth.coverage.mean() < 0.95
    assert found.displacement == pytest.approx(0.15 * (1 - truth.coverage.mean()))
    assert found.coverage_rmse == pytest.approx(np.sqrt(((1 - truth.coverage) ** 2).mean()))
    assert (method.asked[0].curvature == 0).all()


def test_a_flat_method_is_black_where_the_light_is_behind():
    lit_from_behind = TINY.model_copy(update={"light": (-120.0, 0.0)})
    method = Flat()
    edge = edge_of(method, DENIM, lit_from_behind)
    assert len(method.asked[0].u) == 0
    assert (edge.light == 0).all()
    assert (edge_of(method, DENIM, TINY).light > 0).all()


def test_opacity_falls_towards_the_outline_and_flatter_cylinders_hide_more():
    """On a flatter one a ray that dips equally deep has to pass over more crests."""
    means = []
    for radius in (5.0, 20.0, 80.0):
        options = TINY.model_copy(update={"radius": radius, "rows": 160})
        coverage, _ = opacity(DENIM, edge_queries(options, DENIM.weave.repeat), options.truth, 0)
        mean = coverage.reshape(160, -1).mean(axis=0)
        assert (np.diff(mean) <= 0.02).all()
        assert mean[0] > 0.9
        assert mean[-1] < 0.5
        means.append(mean)
    assert (means[1] > means[0] - 0.02).all()
    assert (means[2] > means[1] - 0.02).all()
    assert means[2].mean() > means[0].mean() + 0.05


def test_records_are_those_of_the_edge_that_was_rendered(tmp_path):
    path = tmp_path / "edge.exr"
    render_edge(DENIM, TINY, path)
    truth = true_edge(DENIM, TINY)
    np.testing.assert_allclose(read_edge(path).coverage, truth.coverage, atol=1e-7)
    np.testing.assert_allclose(read_edge(path).light, truth.light, rtol=1e-6, atol=1e-9)
    records = measure_silhouette(Flat(), DENIM, "seen", TINY, path)
    assert [record.metric for record in records] == [
        "silhouette_coverage",
        "silhouette_displacement",
        "silhouette_light",
    ]
    np.testing.assert_allclose([r.value for r in records], silhouette(Flat(), DENIM, TINY, truth), rtol=1e-5)
    assert {(r.method, r.fabric, r.role) for r in records} == {("flat", "denim", "seen")}


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
    expected = np.cos(angle) ** 2 / RADIUS
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
