from functools import cache

import numpy as np
import pytest

from pipeline.shards.queries import QueryOptions, draw_queries
from pipeline.truth.estimator import estimate
from pipeline.truth.options import TruthOptions
from tests.pipeline.analytic import methods
from tests.pipeline.models.against_truth import GREY, colour_error
from tests.pipeline.truth.cloths import LOPSIDED

TRUTH = TruthOptions(estimator="quadrature", walls="left_out", relative_error=3e-3, max_count=1 << 15)
"""It knows no rims: methods that know them leave walls out, too."""

RIMS = {method: {"rims": False} for method in (methods.soft_nodes, methods.points)}
SIZES = {"narrow": (0.08, 0.24), "middle": (0.3, 1.0), "wide": (3.0, 8.0)}


@cache
def asked(size, behind=0.0):
    """Return queries, their answers by quadrature, and the rms standard error of the colour over its mean."""
    options = QueryOptions(sigma=SIZES[size], max_angle=70.0, behind=behind)
    queries = draw_queries(options, LOPSIDED.weave.repeat, 5, 0, 40)
    exact = estimate(LOPSIDED, queries, TRUTH, 1)
    truth = exact.mean @ GREY
    return queries, exact, np.sqrt(np.mean((exact.standard_error @ GREY) ** 2)) / truth.mean()


BOUNDS = {methods.soft_nodes: (0.15, 0.04, 0.025), methods.points: (0.03, 0.03, 0.03)}
"""For the three sizes: those of random cloths (reports/LOG.md); of points what 256 leave."""


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("method", [method for method in methods.ALL if method is not methods.averaged_normals])
def test_colours_are_near_those_of_quadrature(method, size):
    """RMSE of a grey cloth's colour over its mean; the oracle errs by less than a quarter of every bound."""
    queries, exact, error = asked(size)
    bound = BOUNDS[method][list(SIZES).index(size)]
    assert error < 0.25 * bound
    assert colour_error(method(LOPSIDED, queries, **RIMS.get(method, {})), exact.mean) < bound


def test_light_from_behind_and_points_are_near_quadrature_and_a_method_without_shadows_is_far_off():
    """What the bounds above can tell apart: averaged normals are off by ten times the bound of soft nodes."""
    queries, exact, _ = asked("wide")
    assert colour_error(methods.averaged_normals(LOPSIDED, queries), exact.mean) > 10 * BOUNDS[methods.soft_nodes][2]
    queries, exact, error = asked("wide", 1.0)
    assert error < 0.25 * 0.035
    found = methods.soft_nodes_behind(LOPSIDED, queries._replace(wi=queries.wi * np.float32([1, 1, -1])), rims=False)
    assert colour_error(found[:, :4], exact.mean) < 0.035
    assert np.sqrt(np.mean((found[:, 4] - exact.transparency) ** 2)) < 0.005
    # R2 points, from 16 to 4,096: faster than independent ones, whose order is 1/2.
    queries, exact, error = asked("middle")
    counts = [16, 64, 256, 1024, 4096]
    errors = [colour_error(methods.points(LOPSIDED, queries, count, rims=False), exact.mean) for count in counts]
    assert -np.polyfit(np.log(counts), np.log(errors), 1)[0] > 0.55, errors
    assert errors[-1] < 4.0 * error
