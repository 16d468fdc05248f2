import numpy as np

from pipeline.models.analytic.prefiltered import PrefilteredOptions
from pipeline.models.registry import load_methods
from pipeline.shards.queries import QueryOptions, draw_queries
from tests.pipeline.models.against_truth import truth_of
from weaves.fabric import load_fabric


def test_widening_helps_highlights():
    """Over a wide footprint the specular error falls from no widening to Toksvig's to the half vector's own.

    Nothing is hidden on either side, so that the footprint is one of the fabric plane.
    """
    cloth, errors = load_fabric("denim"), []
    queries = draw_queries(QueryOptions(sigma=(4.0, 4.0), max_angle=60.0), cloth.weave.repeat, 2, 0, 24)
    unshadowed = {"estimator": "quadrature", "shadows": False, "parallax": False}
    truth = truth_of(cloth, queries, **unshadowed, relative_error=5e-3, absolute_error=1e-6)
    for widening in ("none", "toksvig", "lean"):
        (method,) = load_methods(PrefilteredOptions(widening=widening))
        errors.append(np.sqrt(np.mean((method.predict(cloth, queries) - truth)[:, :2] ** 2)))
    assert errors[2] < errors[1] < errors[0]
