import pytest

from pipeline.models.analytic.point_sampled import PointSampledOptions
from pipeline.models.analytic.soft_nodes import SoftNodesOptions
from pipeline.models.fallback import Fallback
from pipeline.models.registry import load_methods
from pipeline.shards.queries import QueryOptions, draw_queries
from tests.pipeline.models.against_truth import colour_error, truth_of
from weaves.fabric import load_fabric


@pytest.mark.parametrize(
    ("options", "bound"),
    [(SoftNodesOptions(levels=[2]), 0.04), (PointSampledOptions(counts=[4096], sequence="r2"), 0.03)],
    ids=["soft nodes", "points"],
)
def test_ellipses_are_answered_as_such(options, bound):
    """RMSE of the colour over the mean; asked for the round footprint of equal area half as much again at least."""
    fabric = load_fabric("cotton_twill")
    kinds = QueryOptions(sigma=(0.25, 0.6), max_angle=60.0, stretch=8.0)
    queries = draw_queries(kinds, fabric.weave.repeat, 9, 0, 96)
    truth = truth_of(fabric, queries)
    (method,) = load_methods(options)
    assert "stretch" in options.kinds
    known, unknown = (colour_error(Fallback(method, k).predict(fabric, queries, 3), truth) for k in ({"stretch"}, ()))
    assert known < bound
    assert unknown > 1.5 * known
