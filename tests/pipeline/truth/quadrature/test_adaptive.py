import numpy as np
import pytest
from scipy import stats

from pipeline.truth.cloth import cloth_side, columns_of
from pipeline.truth.estimator import estimate
from pipeline.truth.geometry.pieces import first_cells
from pipeline.truth.options import Limits, TruthOptions
from pipeline.truth.quadrature.adaptive import integrate_rows
from pipeline.truth.quadrature.rules import rectangles
from tests.directions import unit
from tests.pipeline.truth.cloths import answering, equal_queries, fixed, woven

CUT, NEVER = 2, 9  # level from which on lines are cut; the second is never reached
FINE = answering("quadrature", parallax=False, relative_error=3e-4, absolute_error=0.0, max_count=1 << 15)


@pytest.mark.parametrize("name", ["polyester_lining", "satin_8", "herringbone", "silk_shantung", "basket"])
@pytest.mark.parametrize("width", [1.0, 0.7])
def test_the_rectangles_cover_the_repeat_once(name, width):
    fabric = woven(name, width=width)
    model = cloth_side(fabric, TruthOptions())
    ends, picks = fabric.weave.repeat
    found = rectangles(model.front, np.ones((picks, ends), np.bool_))
    area = np.sum((found[:, 1] - found[:, 0]) * (found[:, 3] - found[:, 2]))
    np.testing.assert_allclose(area, ends * picks, rtol=1e-12)
    x, y = np.random.default_rng(1).random((2, 500)) * np.array([[ends], [picks]])
    inside = np.zeros(500, int)
    for shift_x in (0, ends):
        for shift_y in (0, picks):
            over_x = (x[:, None] + shift_x >= found[:, 0]) & (x[:, None] + shift_x < found[:, 1])
            inside += (over_x & (y[:, None] + shift_y >= found[:, 2]) & (y[:, None] + shift_y < found[:, 3])).sum(1)
    np.testing.assert_array_equal(inside, 1)


def _specular_errors(roughness, split):
    """Return rms errors of the specular part with 4, 8, 16 nodes an axis; plain weave, one repeat, no shadows."""
    fabric = woven("polyester_lining", roughness=roughness)
    pairs = [((30, 30), (30, 210)), ((40, 10), (35, 100)), ((20, 70), (45, 300)), ((10, 0), (25, 160))]
    model = cloth_side(fabric, TruthOptions(parallax=False, shadows=False))
    wi, wo = (np.array([unit(*pair[k]) for pair in pairs], np.float32) for k in (0, 1))
    columns = columns_of(equal_queries((0, 0, 1), (0, 0, 1), rows=4)._replace(wi=wi, wo=wo))
    limits = Limits(1e-15, 0.0, 32, 1 << 30)
    different = first_cells(model.front)
    exact = integrate_rows(model, columns, different, limits, CUT, 4, 5)[0][:, :2]
    means = (integrate_rows(model, columns, different, limits, split, k - 1, k)[0][:, :2] for k in (1, 2, 3))
    return [np.sqrt(np.mean(np.sum((mean - exact) ** 2, 1) / np.sum(exact**2, 1))) for mean in means]


@pytest.mark.parametrize(("roughness", "bounds"), [(0.3, (5e-2, 1e-3, 2e-6)), (0.1, (0.3, 3e-2, 2e-4))])
def test_convergence_is_spectral_without_shadows(roughness, bounds):
    """Measured elsewhere (specification, 6), alpha = .1: n = 12 -> 6e-3, 16 -> 8e-4, 24 -> 1.6e-5, about exp(-.49 n).
    The rate fitted here must be at least that, and not fall from one doubling to the next as an algebraic order's does.
    Without cuts the yarns' edges, which turn away from any slanted direction, leave 1e-3 at n = 16."""
    errors = _specular_errors(roughness, CUT)
    assert all(error < bound for error, bound in zip(errors, bounds, strict=True))
    rate = -stats.linregress([4, 8, 16], np.log(errors)).slope
    assert rate > 0.49
    assert np.log(errors[1] / errors[2]) > 1.3 * np.log(errors[0] / errors[1])
    assert _specular_errors(roughness, NEVER)[2] > 5 * errors[2]


def _cases():
    aslant = unit(50, 30), unit(40, 140)
    behind = (*aslant[0][:2], -aslant[0][2])
    yield "plain", "polyester_lining", {}, {}, equal_queries(*aslant, sigma=0.6)
    yield "satin", "silk_charmeuse", {}, {}, equal_queries(*aslant, sigma=8.0)
    yield "gaps", "cotton_twill", {"width": 0.6}, {}, equal_queries(*aslant, sigma=0.5)
    yield "transmission", "polyester_lining", {"width": 0.8}, {}, equal_queries(behind, aslant[1], sigma=0.7)
    yield "from behind", "cotton_twill", {}, {}, equal_queries(aslant[0], (*aslant[1][:2], -aslant[1][2]), sigma=0.7)
    curved = equal_queries(unit(70, 20), unit(60, 190), sigma=0.8)
    yield "curved", "wool_gabardine", {}, {}, curved._replace(curvature=np.full(1, 0.3, np.float32))
    yield "box", "polyester_lining", {}, {"footprint": "box"}, equal_queries(*aslant, sigma=0.4)
    yield "wide box", "polyester_lining", {}, {"footprint": "box"}, equal_queries(*aslant, sigma=0.9)
    thin = equal_queries(*aslant, sigma=1.1)._replace(sigma_minor=np.full(1, 0.15, np.float32))
    yield "along", "cotton_twill", {}, {}, thin
    yield "aslant", "cotton_twill", {}, {}, thin._replace(angle=np.full(1, 0.5, np.float32))


@pytest.mark.parametrize("case", list(_cases()), ids=lambda case: case[0])
def test_it_agrees_with_sampled_estimates(case):
    """Against 2^17 points; Student's t with 15 degrees of freedom at a level of 1e-4, next to the bound stated."""
    _, name, changes, options, queries = case
    fabric = woven(name, **changes)
    own = estimate(fabric, queries, FINE.model_copy(update=options), 1)
    sampled = estimate(fabric, queries, fixed(1 << 17, parallax=False, **options), 2)
    allowed = stats.t.ppf(1 - 5e-5, 15) * sampled.standard_error + own.bound + 1e-7
    assert (np.abs(own.mean - sampled.mean) <= allowed).all()
    spread = stats.t.ppf(1 - 5e-5, 15) * sampled.transparency_standard_error + own.transparency_bound + 1e-7
    assert (np.abs(own.transparency - sampled.transparency) <= spread).all()
    assert own.mean.max() > 1e-3


@pytest.mark.parametrize("sigma", [1e-4, 1e4])
@pytest.mark.parametrize("footprint", ["gaussian", "box"])
def test_extremes_stay_finite_and_not_negative(sigma, footprint):
    fabric = woven("silk_charmeuse", roughness=0.01)
    options = answering("quadrature", parallax=False, footprint=footprint, max_count=512)
    for theta in (0.0, 89.9):
        queries = equal_queries(unit(theta, 13), unit(60.0, 200), sigma, rows=2, centre=(1e6 + 0.3, -1e6))
        answers = estimate(fabric, queries, options, 1)
        assert all(np.isfinite(values).all() and (values >= 0).all() for values in answers)
