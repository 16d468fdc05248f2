import numpy as np

from pipeline.models.method import Method
from pipeline.models.point_sampled import PointSampled
from pipeline.shards.queries import QueryOptions, draw_queries
from pipeline.truth.point_sampler import PointSampler
from weaves.fabric import load_fabric


def test_it_is_the_truth_package_s_baseline():
    fabric = load_fabric("polyester_lining")
    queries = draw_queries(QueryOptions(), fabric.weave.repeat, 1, 0, 64)
    method = PointSampled(4)
    assert isinstance(method, Method)
    assert method.covers(fabric)
    assert method.bytes_stored(fabric) > 0
    answer = method.predict(fabric, queries, seed=9)
    np.testing.assert_array_equal(answer, PointSampler(fabric).sample(queries, 4, 9))
    assert not np.array_equal(answer, method.predict(fabric, queries, seed=10))


def test_more_points_err_less():
    """Spread over seeds falls from k = 1 to k = 64."""
    fabric = load_fabric("polyester_lining")
    queries = draw_queries(QueryOptions(sigma=(1.0, 1.0)), fabric.weave.repeat, 1, 0, 128)
    spread = {
        k: np.std([PointSampled(k).predict(fabric, queries, s) for s in range(4)], axis=0).mean() for k in (1, 64)
    }
    assert spread[64] < 0.4 * spread[1]
