import numpy as np
import pytest

from pipeline.analytic.exact_points import sample_points
from pipeline.models.analytic.point_sampled import PointSampledOptions
from pipeline.models.registry import load_methods
from pipeline.shards.queries import QueryOptions, draw_queries
from pipeline.truth.cloth import cloth_side
from pipeline.truth.estimator import estimate
from pipeline.truth.options import TruthOptions
from tests.pipeline.models.against_truth import GREY
from tests.presets import slow
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
@pytest.mark.parametrize("visibility", ["exact", "horizon", "soft_horizon"])
def test_r2_errs_less_than_random_points(visibility):
    """Spread over seeds at k = 64; every seed is another shift of the same sequence."""
    fabric = load_fabric("polyester_lining")
    queries = draw_queries(QueryOptions(), fabric.weave.repeat, 1, 0, 128)
    random, r2 = (_sampled(64, sequence=sequence, visibility=visibility) for sequence in ("random", "r2"))
    assert _spread(r2, fabric, queries, 6) < 0.8 * _spread(random, fabric, queries, 6)


def test_the_horizon_map_errs_by_its_bias_only():
    """The mean over many points differs from that of the exact march by far less than what shadows take away."""
    fabric = load_fabric("denim")
    queries = draw_queries(QueryOptions(sigma=(0.3, 8.0)), fabric.weave.repeat, 1, 0, 64)
    methods = (_sampled(4096, sequence="r2", visibility=visibility) for visibility in ("exact", "horizon"))
    exact, tabulated = (method.predict(fabric, queries) for method in methods)
    assert (np.sqrt(np.mean((tabulated - exact) ** 2, axis=0)) / exact.mean(axis=0) < 0.03).all()


@pytest.mark.parametrize("sigma", [(0.25, 0.8), slow((0.8, 8.0))])
@pytest.mark.parametrize("name", ["denim", slow("cotton_twill"), slow("basket")])
def test_soft_horizons_err_less(name, sigma):
    """Squared error of a grey cloth's colour at k = 10, mean over four seeds; the truth errs by a hundredth of it."""
    fabric, errors = load_fabric(name), {}
    queries = draw_queries(QueryOptions(sigma=sigma), fabric.weave.repeat, 1, 0, 200)
    truth = estimate(fabric, queries, TruthOptions(relative_error=0.02), 1)
    for visibility in ("horizon", "soft_horizon"):
        method = _sampled(10, sequence="r2", visibility=visibility)
        answers = np.array([method.predict(fabric, queries, seed) for seed in range(4)])
        errors[visibility] = np.mean(((answers - truth.mean) @ GREY) ** 2)
    assert np.mean((truth.standard_error @ GREY) ** 2) < 0.01 * errors["soft_horizon"]
    assert errors["soft_horizon"] < 0.95 * errors["horizon"]
