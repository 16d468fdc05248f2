import itertools

import numpy as np

from pipeline.analytic.exact_points import sample_points
from pipeline.truth.cloth import cloth_side
from pipeline.truth.estimator import estimate
from pipeline.truth.options import TruthOptions
from tests.directions import unit
from tests.pipeline.models.against_truth import colour_error, truth_of
from tests.pipeline.truth.cloths import drawn, equal_queries, fixed, woven
from weaves.fabric import load_fabric


def test_points_err_by_their_order():
    """Independent points by n^-1/2, within three standard errors of the fit; the R2 sequence errs less throughout, in
    the root mean square over four seeds."""
    fabric, counts = load_fabric("denim"), np.array([4, 16, 64, 256])
    queries = drawn(fabric, 11, 200, sigma=(0.3, 1.0), max_angle=60.0)
    truth, cloth = truth_of(fabric, queries, relative_error=0.005), cloth_side(fabric, TruthOptions())
    errors = [
        [[colour_error(sample_points(cloth, queries, n, k, r2)[:, :4], truth) for n in counts] for k in range(4)]
        for r2 in (False, True)
    ]
    independent, r2 = np.sqrt(np.mean(np.square(errors), axis=1))
    assert -0.6 < np.polyfit(np.log(counts), np.log(independent), 1)[0] < -0.4, independent
    assert (r2 < independent).all(), (r2, independent)


def test_transparency_converges_to_the_truth_and_extremes_stay_finite():
    fabric = load_fabric("gauze")
    looks = equal_queries(unit(45, 120), unit(45, 120), 0.7)
    exact = estimate(fabric, looks, fixed(1 << 17), 1).transparency
    cloth = cloth_side(fabric, TruthOptions())
    assert 0.05 < exact[0] < 0.95
    np.testing.assert_allclose(sample_points(cloth, looks, 400_000, 1)[:, 4], exact, rtol=0.02)
    assert sample_points(cloth, looks, 4, 1)[0, 4] != sample_points(cloth, looks, 4, 2)[0, 4]
    for sigma, theta, roughness in itertools.product((1e-4, 1e4), (0.0, 89.9), (0.01, 1.0)):
        cloth = cloth_side(woven("silk_charmeuse", roughness=roughness), TruthOptions())
        for other in (0.0, 89.9):
            queries = equal_queries(unit(theta, 13), unit(other, 200), sigma, 4, (1e6 + 0.3, -1e6))
            values = sample_points(cloth, queries, 1, 0)
            np.testing.assert_array_equal(values, sample_points(cloth, queries.raised(), 1, 0))
            assert np.isfinite(values).all() and (values >= 0).all()
