import pytest

from pipeline.models.analytic.point_sampled import PointSampledOptions
from pipeline.models.registry import load_methods
from pipeline.shards.queries import QueryOptions, draw_queries
from tests.pipeline.models.against_truth import colour_error, truth_of
from tests.presets import slow
from weaves.fabric import load_fabric


@pytest.mark.parametrize("sigma", [slow((0.25, 0.8)), (0.8, 8.0)])
def test_it_errs_less_than_points_of_the_same_time(sigma, clusters):
    """RMSE of a grey cloth's colour: 16 R2 points take as long as 64 clusters, or longer."""
    fabric = load_fabric("cotton_twill")
    queries = draw_queries(QueryOptions(sigma=sigma), fabric.weave.repeat, 1, 0, 100)
    truth = truth_of(fabric, queries)
    (points,) = load_methods(PointSampledOptions(counts=[16], sequence="r2"))
    own, others = (colour_error(method.predict(fabric, queries), truth) for method in (clusters, points))
    assert own**2 < 0.8 * others**2
