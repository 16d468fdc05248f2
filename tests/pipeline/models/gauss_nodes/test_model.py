import numpy as np
import pytest

from pipeline.models.gauss_nodes.options import GaussNodesOptions
from pipeline.models.method import Method
from pipeline.models.registry import load_methods
from pipeline.shards.queries import QueryOptions, draw_queries
from pipeline.truth.estimator import estimate
from pipeline.truth.options import TruthOptions
from weaves.errors import BadInput
from weaves.fabric import Fabric, load_fabric


def error(options: GaussNodesOptions, fabric: Fabric, sigma: tuple[float, float], truth: TruthOptions) -> float:
    """Return the median over queries of the greatest error of a component, relative to the components' mean.

    The median, for patches that are hidden almost wholly are ratios of what lies beyond the footprint's cut.
    """
    queries = draw_queries(QueryOptions(sigma=sigma), fabric.weave.repeat, 3, 0, 96)
    expected = estimate(fabric, queries, truth, 1, 0).mean
    (method,) = load_methods(options)
    answer = method.predict(fabric, queries)
    assert answer.dtype == np.float32 and np.isfinite(answer).all() and (answer >= 0).all()
    return float(np.median(np.abs(answer - expected).max(axis=1)) / expected.mean())


@pytest.mark.parametrize("sigma", [(0.05, 0.2), (0.3, 1.0), (2.0, 32.0)])
def test_without_shadows_it_converges(sigma):
    """Only the line where a yarn turns away from the light is left to err about, as 1 / k."""
    truth = TruthOptions(estimator="quadrature", shadows=False, relative_error=1e-3, absolute_error=1e-6)
    coarse, fine = (
        error(GaussNodesOptions(nodes=[k], along=1, shadows="none"), load_fabric("denim"), sigma, truth)
        for k in (4, 16)
    )
    assert fine < 0.5 * coarse
    assert fine < 0.02


def test_more_nodes_err_less():
    truth = TruthOptions(relative_error=0.01)
    few, more = (error(GaussNodesOptions(nodes=[k]), load_fabric("denim"), (0.05, 8.0), truth) for k in (2, 8))
    assert more < 0.3 * few
    assert more < 0.05


@pytest.mark.parametrize("widths", [(0.8, 1.0), (0.7, 0.6)])
def test_cloth_with_gaps(widths):
    """Strips of the yarn beneath, and gaps, are pieces like others."""
    denim = load_fabric("denim")
    warp, weft = denim.warp.model_copy(update={"width": widths[0]}), denim.weft.model_copy(update={"width": widths[1]})
    fabric = denim.model_copy(update={"warp": warp, "weft": weft})
    assert error(GaussNodesOptions(nodes=[12]), fabric, (0.05, 8.0), TruthOptions(relative_error=0.01)) < 0.08


def test_it_is_a_method_of_plain_queries():
    fabric = load_fabric("denim")
    small, large = load_methods(GaussNodesOptions(nodes=[2, 8]))
    assert isinstance(small, Method) and small.covers(fabric)
    assert [small.setting, large.setting] == ["k = 2", "k = 8"]
    assert 0 < small.bytes_stored(fabric) < large.bytes_stored(fabric)
    queries = draw_queries(QueryOptions(curvature=(0.1, 0.2)), fabric.weave.repeat, 1, 0, 8)
    with pytest.raises(BadInput, match="flat cloth"):
        small.predict(fabric, queries)
