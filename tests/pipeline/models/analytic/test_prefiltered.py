import numpy as np
import pytest

from pipeline.models.analytic.prefiltered import PrefilteredOptions
from pipeline.models.registry import load_methods
from pipeline.shards.queries import QueryOptions, draw_queries
from pipeline.truth.estimator import estimate
from pipeline.truth.options import TruthOptions
from weaves.fabric import load_fabric

UNSHADED = TruthOptions(estimator="quadrature", shadows=False, relative_error=1e-3, absolute_error=1e-6)


def answers(widening: str, sigma: float, texels: int = 16, fabric: str = "denim"):
    """Return the method's answers and the truth with nothing hidden."""
    cloth = load_fabric(fabric)
    queries = draw_queries(QueryOptions(sigma=(sigma, sigma), max_angle=60.0), cloth.weave.repeat, 2, 0, 128)
    (method,) = load_methods(PrefilteredOptions(widening=widening, texels_per_yarn=texels))
    return method.predict(cloth, queries), estimate(cloth, queries, UNSHADED, 1, 0).mean


def test_a_tiny_footprint_is_a_point():
    """Nothing is averaged over a texel of a fine map: what the point model gives, but next to the yarns' sides."""
    answer, truth = answers("lean", 0.005, texels=64)
    error = np.abs(answer - truth).max(axis=1) / truth.max()
    assert np.median(error) < 1e-3


@pytest.mark.parametrize("fabric", ["denim", "silk_charmeuse"])
def test_widening_helps_highlights(fabric):
    """Over a wide footprint the specular error falls from no widening to Toksvig's to the half vector's own."""
    errors = []
    for widening in ("none", "toksvig", "lean"):
        answer, truth = answers(widening, 4.0, fabric=fabric)
        errors.append(np.sqrt(np.mean((answer - truth)[:, :2] ** 2)))
    assert errors[2] < errors[1] < errors[0]
