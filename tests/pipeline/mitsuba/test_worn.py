import math

import numpy as np
import pytest
from scipy import stats

from pipeline.mitsuba import worn as module
from pipeline.mitsuba.worn import LARGEST_FOOTPRINT, PIXEL, ClothOptions, Worn, _round_footprints, footprints_of
from pipeline.models.patch_bsdf import PatchBSDF
from pipeline.truth.query import Queries
from tests.directions import sphere, unit
from tests.pipeline.mitsuba.conftest import hits_of, worn_of
from weaves.errors import BadInput
from weaves.fabric import load_fabric


def test_the_viewer_is_mitsubas_wi_and_a_turned_cloth_is_the_cloth_seen_from_elsewhere():
    """Cotton twill, whose twisted yarns tell light from viewer: swapped, the answer is another one."""
    viewer, light = unit(20.0, 15.0), unit(65.0, 130.0)
    cloth, bsdf = worn_of("cotton_twill"), PatchBSDF(load_fabric("cotton_twill"))
    value = cloth.eval(hits_of(viewer), light[None])
    ways = ([light], [viewer]), ([viewer], [light])
    right, swapped = (bsdf.eval(Queries.round([0.62], [0.57], [0.3], *way)) for way in ways)
    np.testing.assert_allclose(value, right, rtol=1e-5)
    assert np.abs(right / swapped - 1.0).min() > 0.2
    # Turned by 90 degrees, u runs along the warp's opposite: (u, v) is (v, -u) in yarns, and so are directions.
    turned = worn_of("denim", turn=90.0).eval(hits_of(VIEWER), LIGHT)
    around = np.array([[0, 1, 0], [-1, 0, 0], [0, 0, 1.0]])
    plain = worn_of("denim").eval(hits_of(around @ VIEWER, 1, uv=(0.0057, -0.0062)), LIGHT @ around.T)
    np.testing.assert_allclose(turned, plain, rtol=1e-4)
    left = worn_of("denim").eval(hits_of(VIEWER, uv=(0.0062, -0.0057), handed=np.array([-1.0])), LIGHT)
    np.testing.assert_allclose(left, worn_of("denim").eval(hits_of(VIEWER), LIGHT), rtol=1e-6)


VIEWER, LIGHT = unit(30.0, 40.0), unit(50.0, 200.0)[None]


def test_derivatives_are_in_yarns_and_axes_their_singular_vectors():
    """100 and 50 yarns: a pixel of .004 by .004 in uv is an ellipse of deviations .2 and .1, along the weft. .5 of .002
    radians, 3 units of u to the radian, 100 yarns a unit: .3 yarns."""
    jacobian = np.array([[[0.004, 0.0], [0.0, 0.004]]])
    cloth = Worn(ClothOptions(fabric="denim", yarns=100.0, yarns_v=50.0))
    value = cloth.eval(hits_of(VIEWER, uv=(0.0062, 0.0114), jacobian=jacobian), LIGHT)
    query = Queries.round([0.62], [0.57], [0.2], LIGHT, [VIEWER])._replace(sigma_minor=np.float32([0.1]))
    np.testing.assert_allclose(value, PatchBSDF(load_fabric("denim")).eval(query), rtol=1e-4)
    value = Worn(ClothOptions(fabric="denim", pixel_angle=0.002)).eval(hits_of(VIEWER, spread=np.array([3.0])), LIGHT)
    np.testing.assert_allclose(value, worn_of("denim").eval(hits_of(VIEWER), LIGHT), rtol=1e-6)
    with pytest.raises(BadInput, match="use the integrator twillight_path, or state pixel_angle or sigma"):
        Worn(ClothOptions(fabric="denim")).eval(hits_of(VIEWER), LIGHT)
    jacobian = np.random.default_rng(0).standard_normal((500, 2, 2))
    sigma, sigma_minor, angle = footprints_of(jacobian)
    vectors, sizes, _ = np.linalg.svd(jacobian)
    np.testing.assert_allclose(sigma, PIXEL * sizes[:, 0], rtol=1e-5)
    np.testing.assert_allclose(sigma_minor, PIXEL * sizes[:, 1], rtol=1e-4, atol=2e-6)
    axis = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    np.testing.assert_allclose(np.abs(np.einsum("ni,ni->n", axis, vectors[:, :, 0])), 1.0, atol=1e-5)
    # A ratio of 1e6 between the axes, turned by .3: a difference of squares would lose the narrow one.
    turn = np.array([[np.cos(0.3), -np.sin(0.3)], [np.sin(0.3), np.cos(0.3)]])
    found = footprints_of((turn @ np.diag([10.0, 1e-5]))[None])
    np.testing.assert_allclose(np.concatenate(found), [5.0, 5e-6, 0.3], rtol=1e-5)
    for lost in (np.nan, np.inf, 1e30):
        assert footprints_of(np.array([[[lost, 0.0], [0.0, 1.0]]]))[0][0] == LARGEST_FOOTPRINT
    sigma, sigma_minor, _ = _round_footprints(np.array([0.5, 1e9, 0.0]))
    np.testing.assert_array_equal(sigma, sigma_minor)
    assert sigma[0] == 0.5 and sigma[1] == LARGEST_FOOTPRINT and sigma[2] > 0.0


def test_no_light_leaks_through_an_interpolated_normal():
    """The geometric normal is tilted by 60 degrees: a light at 80 degrees on its far side is below the surface."""
    outward, viewer = unit(60.0, 0.0)[None], unit(10.0, 0.0)
    cloth, hits = worn_of("denim"), hits_of(viewer, outward=outward)
    assert (cloth.eval(hits, unit(80.0, 180.0)[None]) == 0.0).all()
    assert (cloth.eval(hits, unit(80.0, 0.0)[None]) > 0.0).any()
    many = hits_of(viewer, 2000, outward=np.tile(outward, (2000, 1)))
    sample = cloth.sample(many, np.random.default_rng(0).random((2000, 3)))
    hidden = ~sample.straight & (sample.wi[:, 2] * (sample.wi @ outward[0]) < 0.0)
    assert hidden.any() and (sample.weight[hidden] == 0.0).all()


@pytest.mark.slow
@pytest.mark.parametrize("method", ["soft_nodes:2", "point_sampled:1"])
def test_runs_and_kept_lobes_change_nothing(method, monkeypatch):
    hits = hits_of(unit(40.0, 30.0), 50)._replace(uv=np.random.default_rng(1).random((50, 2)))
    light = sphere(5, 10)
    cloth = worn_of("denim", method=method)
    values, pdf = cloth.eval(hits, light), cloth.pdf(hits, light)
    np.testing.assert_array_equal(cloth.pdf(hits, light), pdf)
    np.testing.assert_array_equal(cloth.eval(hits, light), values)
    monkeypatch.setattr(module, "RUN", 7)
    again = worn_of("denim", method=method)
    np.testing.assert_array_equal(again.pdf(hits, light), pdf)
    if method == "soft_nodes:2":
        np.testing.assert_array_equal(again.eval(hits, light), values)


def test_points_are_drawn_anew_for_each_direction():
    """One point a query: equal queries in two calls with other light beside them see other points."""
    hits, cloth = hits_of(unit(40.0, 30.0), 400), worn_of("denim", 2.0, method="point_sampled:1")
    first, second = (np.tile(unit(50.0, phi), (400, 1)) for phi in (100.0, 100.001))
    one, other = (cloth.eval(hits, light)[:, 1] for light in (first, second))
    assert abs(np.corrcoef(one, other)[0, 1]) < stats.norm.isf(0.005) / math.sqrt(400)
    np.testing.assert_array_equal(one, cloth.eval(hits, first)[:, 1])


def at_a_rim(count=1, azimuth=0.0):
    """Return hits on a tube of ten yarn spacings' radius, seen where its rays may leave it again."""
    viewer = unit(86.0, azimuth)
    stride = np.tile([math.cos(math.radians(azimuth)), math.sin(math.radians(azimuth))], (count, 1))
    return hits_of(viewer, count, stride=stride, bend=np.full(count, 0.1 * 100.0))


def test_a_rim_covers_what_the_method_says_and_lets_the_rest_pass():
    """100 yarns a unit: curvature .1. Values are the patch BSDF's times the coverage."""
    hits, light, cloth = at_a_rim(), unit(50.0, 200.0), worn_of("denim")
    bsdf = PatchBSDF(load_fabric("denim"))
    query = Queries.round([0.62], [0.57], [0.3], light[None], hits.viewer)._replace(curvature=np.float32([0.1]))
    covered = bsdf.method.coverage(bsdf.fabric, query)
    assert 0.05 < covered[0] < 0.95
    np.testing.assert_allclose(cloth._seen(hits)[2], covered, rtol=1e-6)
    np.testing.assert_allclose(cloth.eval(hits, light[None]), covered[0] * bsdf.eval(query), rtol=1e-5)
    through = bsdf.method.transparency(bsdf.fabric, query._replace(wi=query.wo), 0)
    np.testing.assert_allclose(cloth.transparency(hits), 1 - covered + covered * through, rtol=1e-5)
    assert cloth._seen(hits._replace(bend=np.zeros(1)))[2] == 1.0
    assert cloth._seen(hits._replace(viewer=hits.viewer * [1, 1, -1]))[2] == 1.0


def test_samples_at_a_rim_have_the_density_and_the_weight_of_their_lobe():
    """The density integrates to what does not go straight on; each weight is its value over its density."""
    cloth, wi = worn_of("denim"), sphere(64, 128)
    many = at_a_rim(len(wi), 20.0)
    straight = 1.0 - cloth.pdf(many, wi).mean() * 4.0 * math.pi
    covered = cloth._seen(many)[2][0]
    flat = 1.0 - cloth.pdf(many._replace(bend=np.zeros(len(wi))), wi).mean() * 4.0 * math.pi
    assert straight == pytest.approx(1.0 - covered + covered * flat, abs=1e-3) and 0.1 < covered < 0.9
    count = 4000
    hits = at_a_rim(count, 20.0)
    sample = cloth.sample(hits, np.random.default_rng(3).random((count, 3)))
    share = sample.straight.mean()
    assert abs(share - straight) < 0.01 + 3.3 * math.sqrt(share * (1 - share) / count)
    light = sample.wi.astype(np.float64)
    rest, through = ~sample.straight, cloth.transparency(hits)
    np.testing.assert_allclose(sample.pdf[rest], cloth.pdf(hits, light)[rest], rtol=2e-3)
    np.testing.assert_allclose(
        sample.weight[rest], cloth.eval(hits, light)[rest] / sample.pdf[rest, None], rtol=5e-3, atol=1e-6
    )
    expected = (through / sample.pdf)[sample.straight, None]
    np.testing.assert_allclose(sample.weight[sample.straight], np.repeat(expected, 3, axis=1), rtol=1e-5)
    assert expected.max() < 1.1
