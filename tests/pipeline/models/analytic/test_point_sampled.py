import numpy as np
import pytest

from pipeline.analytic.exact_points import sample_points
from pipeline.models.analytic.point_sampled import PointSampledOptions
from pipeline.models.registry import load_methods
from pipeline.shards.queries import QueryOptions, draw_queries
from pipeline.truth.cloth import cloth_side
from pipeline.truth.options import TruthOptions
from weaves.fabric import load_fabric


def _sampled(count, **options):
    (method,) = load_methods(PointSampledOptions(counts=[count], **options))
    return method


def _spread(method, fabric, queries, seeds):
    return np.std([method.predict(fabric, queries, seed) for seed in range(seeds)], axis=0).mean()


def test_it_is_the_truth_package_s_baseline():
    fabric = load_fabric("polyester_lining")
    queries = draw_queries(QueryOptions(), fabric.weave.repeat, 1, 0, 64)
    method = _sampled(4)
    answer = method.predict(fabric, queries, seed=9)
    np.testing.assert_array_equal(answer, sample_points(cloth_side(fabric, TruthOptions()), queries, 4, 9))
    assert not np.array_equal(answer, method.predict(fabric, queries, seed=10))


@pytest.mark.slow
def test_r2_errs_less_than_random_points():
    """Spread over seeds at k = 64; every seed is another shift of the same sequence."""
    fabric = load_fabric("polyester_lining")
    queries = draw_queries(QueryOptions(), fabric.weave.repeat, 1, 0, 128)
    random, r2 = (_sampled(64, sequence=sequence) for sequence in ("random", "r2"))
    assert _spread(r2, fabric, queries, 6) < 0.8 * _spread(random, fabric, queries, 6)
