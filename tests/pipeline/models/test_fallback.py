import numpy as np
import pytest

from pipeline.analytic.coverage import quick_coverage
from pipeline.models.analytic.soft_nodes import SoftNodes
from pipeline.models.domain import Domain
from pipeline.models.fallback import FLAT_TURN, Fallback, fallback_answers
from pipeline.shards.queries import QueryOptions, draw_queries
from pipeline.truth.estimator import estimate
from pipeline.truth.options import TruthOptions
from tests.pipeline.models.against_truth import colour_error
from tests.pipeline.models.stand_ins import FakeMethod
from tests.pipeline.truth.cloths import fixed, woven
from tests.presets import slow
from weaves.fabric import load_fabric

DENIM = load_fabric("denim")
ROUGH = woven("denim", warp={"roughness": 1.0})


def mixed(count=60):
    """Queries of every kind: ellipses, curvature, light from behind; every third one seen from behind."""
    options = QueryOptions(behind=0.4, stretch=8.0, curvature=(0.01, 0.2), sigma=(0.2, 2.0))
    queries = draw_queries(options, load_fabric("voile").weave.repeat, 5, 0, count)
    wo = queries.wo.copy()
    wo[::3, 2] *= -1.0
    # Seen from behind, cloth is flat: curved cloth is known from outside alone.
    return queries._replace(wo=wo, curvature=np.where(wo[:, 2] > 0, queries.curvature, np.float32(0.0)))


def fallback_of(fabric, about, kinds=()):
    """Return the fallback of a method with the domain of a data set about one fabric."""
    method = FakeMethod()
    method.domain = Domain.of(about, [fabric])
    return Fallback(method, kinds)


def test_a_method_is_asked_in_the_nearest_form_that_it_knows():
    """Round footprints of the same area, or of the major axis, which never alias; curvature is left out."""
    queries = mixed()
    own = queries.take(queries.wo[:, 2] > 0)

    def asked(kinds, *footprint):
        method = FakeMethod()
        Fallback(method, kinds, *footprint).predict(load_fabric("voile"), queries)
        return method.asked[0]

    plain = asked({"behind"})
    np.testing.assert_allclose(plain.sigma**2, own.sigma * own.sigma_minor, rtol=1e-6)
    np.testing.assert_array_equal(plain.sigma, plain.sigma_minor)
    assert not plain.curvature.any() and not plain.angle.any()
    np.testing.assert_array_equal(asked({"behind"}, "major").sigma, own.sigma)
    for known, expected in zip(asked({"behind", "stretch", "curvature"}), own, strict=True):
        np.testing.assert_array_equal(known, expected)


def test_what_no_form_stands_for_and_a_kind_that_was_not_taught_are_the_fallbacks():
    fabric, queries = load_fabric("voile"), mixed()
    fallback = Fallback(FakeMethod(), ())
    strange = fallback.out_of_domain(fabric, queries)
    np.testing.assert_array_equal(strange, (queries.wi[:, 2] < 0) | (queries.wo[:, 2] < 0))
    found = fallback.predict(fabric, queries)
    assert (found[~strange] == 1.0).all()
    np.testing.assert_array_equal(found[strange], fallback_answers(fabric, queries.take(strange), 0))
    # A recipe narrowed to a scene without light from behind teaches none, though the model could learn it.
    fallback = fallback_of(fabric, {}, {"behind", "stretch", "curvature"})
    assert fallback.out_of_domain(fabric, queries)[queries.behind].all()
    fallback.predict(fabric, queries)
    (asked,) = fallback.method.asked
    assert not asked.curvature.any() and not asked.behind.any()
    np.testing.assert_array_equal(asked.sigma, asked.sigma_minor)


def test_viewers_too_low_are_tilted_up_and_coverage_is_the_methods_own_up_to_its_curvature():
    """On either side of the cloth, to the same azimuth; others keep their bits."""
    queries = mixed()
    low = queries._replace(wo=queries.wo * np.float32([1, 1, 1e-4]))
    low.wo[:10] = queries.wo[:10]
    low.wo[:] /= np.linalg.norm(low.wo, axis=1, keepdims=True)
    raised = low.raised()
    np.testing.assert_array_equal(raised.wo[:10], low.wo[:10])
    assert np.isfinite(fallback_answers(DENIM, low, 3)).all()
    np.testing.assert_array_equal(fallback_answers(DENIM, low, 3), fallback_answers(DENIM, raised, 3))
    degrees = np.degrees(np.arccos(np.abs(raised.wo[10:, 2])))
    np.testing.assert_allclose(degrees, 89.0, atol=1e-3)
    assert (np.sign(raised.wo) == np.sign(low.wo)).all()
    np.testing.assert_allclose(raised.wo[10:, 0] * low.wo[10:, 1], raised.wo[10:, 1] * low.wo[10:, 0], atol=1e-6)
    # The method says .5 of curved cloth; flat cloth is covered, and nothing below the tangent plane.
    fabric = load_fabric("denim")
    queries = draw_queries(QueryOptions(curvature=(0.01, 0.5)), fabric.repeat, 5, 0, 40)
    low = queries._replace(wo=queries.wo * np.float32([1, 1, -1]))
    flat = queries._replace(curvature=np.zeros(40, np.float32))
    about = {"queries": QueryOptions(curvature=(0.01, 0.2)).model_dump(mode="json")}
    fallback = fallback_of(fabric, about, {"curvature"})
    np.testing.assert_array_equal(fallback.coverage(fabric, queries), quick_coverage(fabric, queries))
    fallback.method.coverage = lambda fabric, looks: np.full(len(looks.u), 0.5, np.float32)
    fallback = Fallback(fallback.method, {"curvature"})
    own = queries.curvature <= np.float32(0.2)
    assert 5 < own.sum() < 35
    expected = np.where(own, np.float32(0.5), quick_coverage(fabric, queries))
    np.testing.assert_array_equal(fallback.coverage(fabric, queries), expected)
    assert (fallback.coverage(fabric, low) == 0).all() and (fallback.coverage(fabric, flat) == 1).all()


@pytest.mark.parametrize("name", ["denim", slow("voile")])
def test_a_viewer_behind_the_cloth_is_in_front_of_its_back(name):
    """Soft nodes turn the cloth; the truth of the back is the reference."""
    fabric = load_fabric(name)
    queries = draw_queries(QueryOptions(behind=0.4, sigma=(0.3, 2.0), max_angle=60.0), (4, 4), 5, 0, 200)
    turned = queries.turned()
    assert (turned.wo[:, 2] < 0).all()
    truth = estimate(fabric, turned, TruthOptions(relative_error=0.02), 1)
    fallback = Fallback(SoftNodes(), {"stretch", "behind"})
    assert not fallback.out_of_domain(fabric, turned).any()
    found = fallback.predict(fabric, turned)
    np.testing.assert_array_equal(found, fallback.predict(fabric.back(), queries))
    assert colour_error(found, truth.mean) < 0.06
    clear = fallback.transparency(fabric, turned)
    assert np.sqrt(np.mean((clear - truth.transparency) ** 2)) < 0.01


def test_yarns_unlike_those_trained_on_are_left_to_the_fallback():
    fallback, queries = fallback_of(DENIM, {}), draw_queries(QueryOptions(sigma=(0.5, 1.0)), (4, 4), 3, 0, 20)
    assert not fallback.out_of_domain(DENIM, queries).any() and fallback.out_of_domain(ROUGH, queries).all()
    np.testing.assert_array_equal(fallback.predict(ROUGH, queries), fallback_answers(ROUGH, queries, 0))


@pytest.mark.parametrize(("turned", "bound"), [(0.5 * FLAT_TURN, 0.03), (3.0 * FLAT_TURN, 0.1)])
def test_what_stands_in_is_the_truth_of_ellipses_on_flat_and_on_curved_cloth(turned, bound):
    """Light from behind through open cloth, ellipses at all angles: RMSE over the mean against 4,096 points a query."""
    fabric = load_fabric("voile")
    kinds = QueryOptions(sigma=(0.4, 1.0), max_angle=60.0, behind=1.0, stretch=4.0)
    queries = draw_queries(kinds, fabric.weave.repeat, 6, 0, 64)
    size = np.sqrt(queries.sigma * queries.sigma_minor)
    queries = queries._replace(curvature=(turned / size).astype(np.float32))
    reference = estimate(fabric, queries, fixed(4096), 1).mean
    wrong = fallback_answers(fabric, queries, 0) - reference
    assert np.sqrt(np.square(wrong).sum(axis=1).mean()) < bound * reference.sum(axis=1).mean()


def test_beyond_the_ranges_trained_on_the_fallback_answers_and_within_them_the_method():
    fabric = load_fabric("voile")
    fallback = fallback_of(fabric, {"queries": {"sigma": [0.3, 1.0], "max_angle": 60.0}})
    queries = draw_queries(QueryOptions(sigma=(0.05, 32.0)), fabric.weave.repeat, 5, 0, 400)
    strange = fallback.out_of_domain(fabric, queries)
    steep = np.minimum(queries.wi[:, 2], queries.wo[:, 2]) < np.cos(np.radians(60.0))
    small = queries.sigma < 0.3
    assert 0 < strange.sum() < 400 and strange[small & steep].all()
    # The repeat of a plain weave is 2: a footprint of 1 yarn sees its average, and larger ones are asked as that.
    assert not strange[~small & ~steep].any()
    found = fallback.predict(fabric, queries)
    assert (found[~strange] == 1.0).all()
    np.testing.assert_array_equal(found[strange], fallback_answers(fabric, queries.take(strange), 0))
    (asked,) = fallback.method.asked
    assert asked.sigma.max() <= 1.03 and asked.sigma.min() >= 0.29
