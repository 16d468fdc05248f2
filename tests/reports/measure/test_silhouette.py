import numpy as np
import pytest

from pipeline.truth.estimator import estimate
from pipeline.truth.geometry.opacity import coverage
from pipeline.truth.options import TruthOptions
from reports.measure.silhouette import edge_of, edge_queries, measure_silhouette, read_edge, render_edge
from reports.options import EdgeOptions
from tests.pipeline.models.stand_ins import FakeMethod
from weaves.fabric import load_fabric

TINY = EdgeOptions(
    radius=10.0, depth=0.15, pixel=0.025, rows=5, truth=TruthOptions(relative_error=0.1, min_count=64, max_count=64)
)
DENIM = load_fabric("denim")


def flat():
    """What a method without curvature answers: always the same, and it remembers the queries."""
    return FakeMethod(lambda queries: np.full((len(queries.u), 4), 0.25, np.float32))


class Truth(FakeMethod):
    def predict(self, fabric, queries, seed=0):
        return estimate(fabric, queries, TINY.truth, TINY.seed).mean

    def coverage(self, fabric, looks):
        return coverage(fabric, looks, TINY.truth, TINY.seed)[0]


def test_pixels_see_the_cylinder_and_a_flat_method_is_black_where_the_light_is_behind():
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
    lit_from_behind = TINY.model_copy(update={"light": (-120.0, 0.0)})
    method = flat()
    edge = edge_of(method, DENIM, lit_from_behind)
    assert len(method.asked[0].u) == 0 and (edge.light == 0).all() and (edge_of(method, DENIM, TINY).light > 0).all()


@pytest.fixture(scope="module")
def rendered(tmp_path_factory):
    path = tmp_path_factory.mktemp("edge") / "edge.exr"
    render_edge(DENIM, TINY, path)
    return path


def test_the_file_holds_the_edge_which_the_truth_finds_and_a_flat_method_does_not(rendered):
    values = [record.value for record in measure_silhouette(Truth(), DENIM, TINY, rendered)]
    assert values == pytest.approx([0.0, 0.0, 0.0], abs=1e-7)
    method, truth = flat(), read_edge(rendered)
    records = measure_silhouette(method, DENIM, TINY, rendered)
    assert {(r.method, r.fabric) for r in records} == {("fake", "denim")}
    values = {r.metric.removeprefix("silhouette_"): r.value for r in records}
    assert 0.05 < truth.coverage.mean() < 0.95
    assert values["coverage"] == pytest.approx(np.sqrt(((1 - truth.coverage) ** 2).mean()))
    assert values["displacement"] == pytest.approx(0.15 * (1 - truth.coverage.mean()))
    wrong = edge_of(flat(), DENIM, TINY).light - truth.light
    assert values["light"] == pytest.approx(np.sqrt((wrong**2).mean())) and (method.asked[0].curvature == 0).all()
