import math

import numpy as np
import pytest

from pipeline.truth.cloth import cloth_side
from pipeline.truth.geometry.march import ray
from pipeline.truth.geometry.opacity import coverage, grazing_cosine, hits, opacity
from pipeline.truth.options import TruthOptions
from pipeline.truth.query import Queries
from tests.pipeline.truth.cloths import CORDUROY, fixed, woven
from tests.pipeline.truth.geometry.marches import leaves
from tests.refusals import refusal
from weaves.fabric import load_fabric
from weaves.surface import GAP, surface_at

STEP = 0.0025


def _wo(cosines, azimuth=0.0):
    cosines = np.asarray(cosines, np.float64)
    sines = np.sqrt(1 - cosines**2)
    return np.stack([sines * np.cos(azimuth), sines * np.sin(azimuth), cosines], axis=-1).astype(np.float32)


def _queries(wo, curvature, sigma=8.0):
    column = np.ones(len(wo), np.float32)
    queries = Queries.round(0.3 * column, 0.4 * column, sigma * column, wo, wo)
    return queries._replace(curvature=np.float32(curvature) * column)


@pytest.mark.parametrize("name", ["denim", "silk_charmeuse"])
@pytest.mark.parametrize(("curvature", "cosine"), [(0.04, 0.03), (0.1, 0.08), (0.5, 0.25)])
def test_hits_match_a_march(name, curvature, cosine):
    fabric = load_fabric(name)
    model = cloth_side(fabric, TruthOptions())
    generator = np.random.default_rng(round(100 * curvature))
    ends, picks = fabric.weave.repeat
    x, y = generator.random((2, 600)) * np.array([[ends], [picks]])
    w = -_wo(cosine, generator.random() * 2 * math.pi).astype(np.float64)
    exact = [hits(model.front, model.back, a, b, ray(*w, curvature)) for a, b in zip(x, y, strict=True)]
    marched = ~leaves(fabric, x, y, np.full(len(x), model.front.highest), w, curvature)
    assert 0.05 < marched.mean() < 0.95
    assert (marched != np.array(exact)).mean() < 0.005


@pytest.mark.parametrize(("name", "curvature"), [("denim", 0.1), ("polyester_lining", 0.3)])
def test_opacity_is_the_share_of_rays_that_hit_and_states_its_error(name, curvature):
    """Box of one repeat against a fine grid; z-scores of 40 seeds, whose rms is 1 within 35 % for the stated error."""
    fabric = load_fabric(name)
    ends, picks = fabric.weave.repeat
    wo = _wo([math.sqrt(0.04 * curvature)], 0.5)
    options = fixed(512, footprint="box")
    queries = _queries(wo, curvature, sigma=ends / math.sqrt(12))
    model, towards = cloth_side(fabric, options), ray(*(-wo[0].astype(np.float64)), curvature)
    x, y = np.meshgrid((np.arange(80) + 0.5) * ends / 80, (np.arange(80) + 0.5) * picks / 80)
    exact = np.mean([hits(model.front, model.back, a, b, towards) for a, b in zip(x.flat, y.flat, strict=True)])
    assert 0.1 < exact < 0.9
    repeated = queries.take(np.zeros(40, np.int64))
    mean, error = opacity(fabric, repeated, options, 3)
    assert abs(mean.mean() - exact) < 0.004
    assert 0.65 < np.sqrt((((mean - exact) / error) ** 2).mean()) < 1.35
    # Rows are named by their index: any cut gives the same numbers.
    cut, _ = opacity(fabric, repeated.take(slice(7, 9)), options, 3, start=7)
    np.testing.assert_array_equal(cut, mean[7:9])


def test_closed_forms_and_limits_known_without_sampling():
    """Along the warps a ray keeps its distance x from a crest: it touches where q^2 / (2 kappa) = 1/2 - height(x)."""
    x = np.linspace(0.02, 0.98, 13)
    height = np.sqrt(0.25 - (x - 0.5) ** 2)
    for curvature in (1e-4, 0.03, 1.0):
        q = np.sqrt(2 * curvature * (0.5 - height))
        found = grazing_cosine(CORDUROY, x, 0.0, np.array([[math.pi / 2], [-math.pi / 2]]), curvature)
        np.testing.assert_allclose(found, np.broadcast_to(q / np.sqrt(1 + q * q), (2, 13)), rtol=1e-6, atol=1e-8)

        # The share of a period whose height exceeds 1/2 - depth.
        depth = np.array([0.01, 0.1, 0.3])
        q = np.sqrt(2 * curvature * depth)
        wo = _wo(q / np.sqrt(1 + q * q), math.pi / 2)
        options = TruthOptions(relative_error=1e-3, max_count=1 << 14)
        mean, error = opacity(CORDUROY, _queries(wo, curvature), options, 5)
        share = 2 * np.sqrt(0.25 - (0.5 - depth) ** 2)
        assert (np.abs(mean - share) < 4 * error + 1e-5).all() and (error < 2e-3).all()
    fabric = load_fabric("denim")
    beyond = _queries(_wo([-1.0, -0.5, -1e-3, 0.0]), 0.3)
    np.testing.assert_array_equal(opacity(fabric, beyond, TruthOptions(), 0), np.zeros((2, 4)))
    flat = _queries(_wo([1e-4, 0.1, 0.9, 1.0]), 0.0)
    np.testing.assert_array_equal(opacity(fabric, flat, TruthOptions(), 0), [[1] * 4, [0] * 4])
    nearly = opacity(fabric, _queries(_wo([0.02, 0.9]), 1e-5), TruthOptions(), 0)
    np.testing.assert_array_equal(nearly, opacity(fabric, _queries(_wo([0.02, 0.9]), 0.0), TruthOptions(), 0))
    # Points that all agree are no proof.
    mean, error = opacity(fabric, _queries(_wo([1e-4]), 1.0), TruthOptions(), 0)
    assert mean[0] == 0 and 1e-3 < error[0] < 1e-2
    # A gap is open from above.
    mean, error = opacity(woven("denim", width=0.8), _queries(_wo([1.0]), 0.3), TruthOptions(relative_error=1e-3), 1)
    assert abs(mean[0] - 0.96) < 4 * error[0]
    # The same bits without gaps; with them, flat cloth covers all, and of rays that stay a share meets yarns.
    options, wo = fixed(1024), _wo(np.linspace(0.02, 0.98, 20), 0.3)
    solid, holed = load_fabric("denim"), woven("denim", width=0.8)
    for fabric in (solid, holed):
        covered, _ = coverage(fabric, _queries(wo, 0.3), options, 3)
        met, _ = opacity(fabric, _queries(wo, 0.3), options, 3)
        assert (covered == met).all() if fabric is solid else ((covered >= met).all() and (covered > met).any())
    mean, error = coverage(holed, _queries(wo, 0.0), options, 3)
    assert (mean == 1).all() and (error == 0).all()


def test_a_low_relief_is_met_at_any_cosine_and_bad_input_is_refused():
    """A relief beta makes depths beta times smaller; beta = .01 is all but the smooth cylinder, met at any cosine."""
    flat = woven("denim", ("#",), relief=0.01)
    q = math.sqrt(2 * 0.1 * 0.01 * (0.5 - math.sqrt(0.25 - 0.09)))
    np.testing.assert_allclose(grazing_cosine(flat, 0.2, 0.0, math.pi / 2, 0.1), q / math.sqrt(1 + q * q), rtol=1e-6)
    assert opacity(flat, _queries(_wo([0.04, 0.3]), 0.1), TruthOptions(), 0)[0].tolist() == [1.0, 1.0]
    fabric = load_fabric("denim")
    bent = _queries(_wo([-0.5]), 2.0)
    assert "curvature[0] = 2.0: must be from 0 to 1" in refusal(opacity, fabric, bent, TruthOptions(), 0)
    assert "unit length" in refusal(opacity, fabric, _queries(2 * _wo([-0.5]), 0.5), TruthOptions(), 0)


@pytest.mark.parametrize("name", ["denim", "silk_charmeuse"])
def test_grazing_cosine_is_the_step_of_opacity(name):
    fabric = load_fabric(name)
    model = cloth_side(fabric, TruthOptions())
    generator = np.random.default_rng(4)
    x, y = generator.random((2, 100)) * fabric.weave.repeat[0]
    azimuth, curvature = generator.random(100) * 2 * math.pi, generator.random(100)
    edge = grazing_cosine(fabric, x, y, azimuth, curvature)
    for factor, expected in ((1 - 1e-6, False), (1 + 1e-6, True)):
        w = -np.stack([*(np.sqrt(1 - (edge * factor) ** 2) * (np.cos(azimuth), np.sin(azimuth))), edge * factor], -1)
        for row in range(100):
            towards = ray(*w[row], curvature[row])
            assert hits(model.front, model.back, x[row], y[row], towards) == expected
    np.testing.assert_allclose(grazing_cosine(fabric, x + 40.0, y - 40.0, azimuth, curvature), edge, rtol=1e-9)


@pytest.mark.parametrize(("width", "curvature", "depth"), [(0.8, 0.0, 2.5), (0.1, 1.0, 0.12)])
def test_gaps_let_rays_through(width, curvature, depth):
    """Narrow yarns against a march through yarns with two sides, per ray, and their share of a patch. `depth` says how
    far beneath the fabric plane the ray would sink (for flat cloth, its slope): in the last case it comes up again, and
    some rays do so through another gap or the same one. Both take yarns for solid from their surface to the plane.
    Strips beside a narrow yarn are searched at points: .6 % of the rays may differ."""
    fabric = woven("denim", width=width)
    model = cloth_side(fabric, TruthOptions())
    highest, lowest = model.front.highest, -model.back.highest
    slope = math.sqrt(2 * curvature * (highest + depth)) if curvature else depth
    wo = _wo([slope / math.hypot(1, slope)], 0.3)
    w = -wo[0].astype(np.float64)
    x, y = np.random.default_rng(2).random((2, 4000)) * 4
    hit, rows, k = np.zeros(len(x), bool), np.arange(len(x)), 0
    while rows.size:
        k += 1
        s = k * STEP
        z, rises = highest + s * (0.5 * curvature * s - slope), curvature * s > slope
        at = x[rows] + s * math.cos(0.3) * -1, y[rows] + s * math.sin(0.3) * -1
        above, below = surface_at(fabric, *at), surface_at(fabric.back(), *at)
        inside = (above.yarn != GAP) & ((above.height > z) if z > 0 else (below.height > -z))
        hit[rows[inside]] = True
        rows = rows[~inside] if z > lowest and not (rises and z > highest) else rows[:0]
    towards = ray(*w, curvature)
    found = np.array([hits(model.front, model.back, a, b, towards) for a, b in zip(x, y, strict=True)])
    assert 0.01 < 1 - hit.mean() < 0.95
    assert (found != hit).mean() < 0.006
    mean, error = opacity(fabric, _queries(wo, curvature), TruthOptions(relative_error=1e-2, max_count=1 << 13), 1)
    assert abs(mean[0] - hit.mean()) < 4 * math.hypot(0.5 / math.sqrt(len(x)), error[0])
