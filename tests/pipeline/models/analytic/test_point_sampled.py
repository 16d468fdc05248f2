import numpy as np
import pytest
from pydantic import ValidationError

from pipeline.analytic.exact_points import sample_points
from pipeline.models.analytic.point_sampled import PointSampledOptions
from pipeline.models.registry import load_methods
from pipeline.shards.queries import QueryOptions, draw_queries
from pipeline.truth.cloth import cloth_side
from pipeline.truth.estimator import estimate
from pipeline.truth.options import TruthOptions
from tests.presets import slow
from weaves.fabric import load_fabric


def _sampled(count):
    (method,) = load_methods(PointSampledOptions(counts=[count]))
    return method


def test_it_is_the_truth_package_s_baseline():
    fabric = load_fabric("polyester_lining")
    queries = draw_queries(QueryOptions(), fabric.weave.repeat, 1, 0, 64)
    method = _sampled(4)
    assert method.bytes_stored(fabric) > 0
    answer = method.predict(fabric, queries, seed=9)
    np.testing.assert_array_equal(answer, sample_points(cloth_side(fabric, TruthOptions()), queries, 4, 9))
    assert not np.array_equal(answer, method.predict(fabric, queries, seed=10))


def test_more_points_err_less():
    """Spread over seeds falls from k = 1 to k = 64."""
    fabric = load_fabric("polyester_lining")
    queries = draw_queries(QueryOptions(sigma=(1.0, 1.0)), fabric.weave.repeat, 1, 0, 128)
    spread = {k: np.std([_sampled(k).predict(fabric, queries, s) for s in range(4)], axis=0).mean() for k in (1, 64)}
    assert spread[64] < 0.4 * spread[1]


@pytest.mark.slow
@pytest.mark.parametrize("visibility", ["exact", "horizon", "soft_horizon"])
def test_r2_errs_less_than_random_points(visibility):
    """Spread over seeds at k = 64; every seed is another shift of the same sequence."""
    fabric = load_fabric("polyester_lining")
    queries = draw_queries(QueryOptions(), fabric.weave.repeat, 1, 0, 128)
    spread = {}
    for sequence in ("random", "r2"):
        options = PointSampledOptions(counts=[64], sequence=sequence, visibility=visibility)
        (method,) = load_methods(options)
        spread[sequence] = np.std([method.predict(fabric, queries, s) for s in range(6)], axis=0).mean()
    assert spread["r2"] < 0.8 * spread["random"]


def test_the_horizon_map_errs_by_its_bias_only():
    """The mean over many points differs from that of the exact march by far less than what shadows take away."""
    fabric = load_fabric("denim")
    queries = draw_queries(QueryOptions(sigma=(0.3, 8.0)), fabric.weave.repeat, 1, 0, 64)
    answers = {}
    for visibility in ("exact", "horizon"):
        (method,) = load_methods(PointSampledOptions(counts=[4096], sequence="r2", visibility=visibility))
        answers[visibility] = method.predict(fabric, queries)
    error = np.sqrt(np.mean((answers["horizon"] - answers["exact"]) ** 2, axis=0)) / answers["exact"].mean(axis=0)
    assert (error < 0.03).all()


@pytest.mark.parametrize("sigma", [(0.25, 0.8), slow((0.8, 8.0))])
@pytest.mark.parametrize("name", ["denim", slow("cotton_twill"), slow("basket")])
def test_soft_horizons_err_less(name, sigma):
    """Squared error of a grey cloth's colour at k = 10, mean over four seeds; the truth errs by a hundredth of it."""
    fabric, colour, errors = load_fabric(name), np.array([0.3, 0.3, 0.5, 0.5]), {}
    queries = draw_queries(QueryOptions(sigma=sigma), fabric.weave.repeat, 1, 0, 400)
    exact = estimate(fabric, queries, TruthOptions(relative_error=0.02), 1)
    for visibility in ("horizon", "soft_horizon"):
        (method,) = load_methods(PointSampledOptions(counts=[10], sequence="r2", visibility=visibility))
        found = np.array([method.predict(fabric, queries, seed) for seed in range(4)])
        errors[visibility] = np.mean(((found - exact.mean) @ colour) ** 2)
    assert np.mean((exact.standard_error @ colour) ** 2) < 0.01 * errors["soft_horizon"]
    assert errors["soft_horizon"] < 0.95 * errors["horizon"]


def test_horizons_know_one_footprint():
    with pytest.raises(ValidationError):
        PointSampledOptions(visibility="horizon", footprint="box")
