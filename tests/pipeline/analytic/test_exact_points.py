"""Point sampling with exact shadows: it converges to the truth, and stays finite at the extremes."""

import itertools

import numpy as np

from pipeline.analytic.exact_points import sample_points, sample_transparency
from pipeline.truth.cloth import cloth_side
from pipeline.truth.estimator import estimate
from pipeline.truth.options import TruthOptions
from tests.pipeline.truth.cloths import direction, equal_queries, woven
from weaves.fabric import load_fabric

EXACT = TruthOptions(estimator="owen", absolute_error=0.0, relative_error=1e-5, min_count=1 << 20, max_count=1 << 20)


def test_points_converge_to_the_truth():
    fabric = load_fabric("basket")
    queries = equal_queries(direction(30, 0), direction(45, 120), 0.7)
    exact = estimate(fabric, queries, EXACT, 1)
    np.testing.assert_allclose(
        sample_points(cloth_side(fabric, TruthOptions()), queries, 400_000, 1), exact.mean, rtol=0.03
    )


def test_transparency_converges_to_the_truth_and_changes_with_the_seed():
    fabric = load_fabric("gauze")
    looks = equal_queries(direction(45, 120), direction(45, 120), 0.7)
    exact = estimate(fabric, looks, EXACT, 1).transparency
    cloth = cloth_side(fabric, TruthOptions())
    assert 0.05 < exact[0] < 0.95
    np.testing.assert_allclose(sample_transparency(cloth, looks, 400_000, 1), exact, rtol=0.02)
    assert sample_transparency(cloth, looks, 4, 1) != sample_transparency(cloth, looks, 4, 2)


def test_extremes_stay_finite_and_not_negative():
    for sigma, theta, roughness in itertools.product((1e-4, 1e4), (0.0, 89.9), (0.01, 1.0)):
        cloth = cloth_side(woven("silk_charmeuse", roughness=roughness), TruthOptions())
        for other in (0.0, 89.9):
            queries = equal_queries(direction(theta, 13), direction(other, 200), sigma, 4, (1e6 + 0.3, -1e6))
            values = sample_points(cloth, queries, 1, 0)
            assert np.isfinite(values).all()
            assert (values >= 0).all()
