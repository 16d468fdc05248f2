import numpy as np
import pytest

from pipeline.models.analytic.point_sampled import PointSampledOptions
from pipeline.models.analytic.summed_area import SummedAreaOptions
from pipeline.models.registry import load_methods
from pipeline.shards.queries import QueryOptions, draw_queries
from tests.pipeline.models.against_truth import colour_error, truth_of
from weaves.fabric import load_fabric


def test_each_number_of_clusters_is_a_method():
    fabric, methods = load_fabric("polyester_lining"), load_methods(SummedAreaOptions(clusters=[16, 64]))
    assert [method.setting for method in methods] == ["k = 16", "k = 64"]
    queries = draw_queries(QueryOptions(), fabric.weave.repeat, 1, 0, 64)
    few, many = (method.predict(fabric, queries, seed=1) for method in methods)
    np.testing.assert_array_equal(few, methods[0].predict(fabric, queries, seed=2))
    assert not np.array_equal(few, many)
    assert 0 < methods[0].bytes_stored(fabric) < methods[1].bytes_stored(fabric)


@pytest.mark.parametrize("sigma", [(0.05, 0.25), (0.25, 0.8), (0.8, 8.0)])
def test_it_errs_less_than_points_of_the_same_time(sigma, clusters):
    """RMSE of a grey cloth's colour: 16 R2 points take about as long as 64 clusters."""
    fabric = load_fabric("cotton_twill")
    queries = draw_queries(QueryOptions(sigma=sigma), fabric.weave.repeat, 1, 0, 300)
    truth = truth_of(fabric, queries)
    (points,) = load_methods(PointSampledOptions(counts=[16], sequence="r2", visibility="soft_horizon"))
    own, others = (colour_error(method.predict(fabric, queries), truth) for method in (clusters, points))
    assert own**2 < 0.8 * others**2
