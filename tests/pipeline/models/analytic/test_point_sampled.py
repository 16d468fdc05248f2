import numpy as np

from pipeline.analytic.exact_points import sample_points
from pipeline.models.analytic.point_sampled import PointSampledOptions
from pipeline.models.registry import load_methods
from pipeline.shards.queries import QueryOptions, draw_queries
from pipeline.truth.cloth import cloth_side
from pipeline.truth.options import TruthOptions
from weaves.fabric import load_fabric


def test_it_is_the_truth_package_s_baseline():
    fabric = load_fabric("polyester_lining")
    queries = draw_queries(QueryOptions(), fabric.weave.repeat, 1, 0, 64)
    (method,) = load_methods(PointSampledOptions(counts=[4]))
    answer = method.predict(fabric, queries, seed=9)
    np.testing.assert_array_equal(answer, sample_points(cloth_side(fabric, TruthOptions()), queries, 4, 9)[:, :4])
    assert not np.array_equal(answer, method.predict(fabric, queries, seed=10))
