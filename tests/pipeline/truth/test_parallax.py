"""Patches of view rays: against points of the fabric that the viewer sees displaced, and what cannot depend on size.

The rays that meet the cloth around a visible point p cross the reference plane at p - (h(p) - z0) wo_xy / wo_z, in an
area of A(p, wo) dp / wo_z. Points of the fabric with that place in the footprint are another way to the same mean.
"""

import numpy as np
import pytest

from pipeline.truth.estimator import estimate
from pipeline.truth.geometry.heightfield import height_field, surface_at
from pipeline.truth.geometry.pieces import reference_plane
from pipeline.truth.options import TruthOptions
from pipeline.truth.scattering.thread_colours import component_colours
from tests.directions import unit
from tests.pipeline.truth.cloths import LOPSIDED, PALETTE, coloured, drawn, equal_queries, woven
from tests.presets import slow
from tests.refusals import refusal
from weaves.validation import validated

COLOUR = np.array([0.2, 0.2, 0.5, 0.5])


def _answers(fabric, queries, parallax=True, estimator="owen", **options):
    options = {"relative_error": 0.005, "max_count": 1 << 14} | options
    return estimate(fabric, queries, TruthOptions(estimator=estimator, parallax=parallax, **options), 1)


@pytest.mark.parametrize("fabric", [LOPSIDED, woven("voile"), woven("denim")], ids=["narrow", "open", "closed"])
@pytest.mark.parametrize("sigma", [0.1, slow(0.6)])
def test_rays_and_displaced_points_of_the_fabric_have_the_same_mean(fabric, sigma):
    """Rays are sampled; quadrature integrates over the fabric, cut where light or view is lost. A third of the lights
    are behind the cloth. The bounds hold for 99.7 % of answers."""
    queries = drawn(fabric, 5, 60, sigma=(sigma, 2 * sigma), max_angle=75.0, behind=0.3)
    options = {"walls": "left_out", "max_count": 1 << 16}
    rays, points = (_answers(fabric, queries, estimator=name, **options) for name in ("owen", "quadrature"))
    difference = rays.mean - points.mean
    assert (np.abs(difference) < points.bound + 3 * rays.standard_error + 1e-6).mean() > 0.99
    front, size = ~queries.behind, np.linalg.norm(rays.mean)
    assert np.linalg.norm(difference[front]) < 0.005 * size
    seen = np.abs(rays.transparency - points.transparency)
    assert (seen < points.transparency_bound + 3 * rays.transparency_standard_error + 1e-6).mean() > 0.98
    flat = _answers(fabric, queries, parallax=False).mean - points.mean
    assert sigma > 0.1 or np.linalg.norm(flat[front]) > 0.02 * size  # the heights are seen


@pytest.mark.parametrize("estimator", ["r2", "auto"])
def test_a_footprint_of_a_repeat_sees_no_parallax(estimator):
    query = equal_queries(unit(35.0, 200.0), unit(80.0, 70.0), sigma=4.0)
    rays, flat = (_answers(LOPSIDED, query, parallax, estimator, walls="left_out") for parallax in (True, False))
    assert (np.abs(rays.mean - flat.mean) < 4 * np.hypot(rays.standard_error, flat.standard_error) + 1e-6).all()
    doubt = np.hypot(rays.transparency_standard_error, flat.transparency_standard_error)
    assert (np.abs(rays.transparency - flat.transparency) < 4 * doubt + 1e-6).all()


@pytest.mark.parametrize("walls", [slow("left_out"), "rim"])
def test_with_rims_no_place_weighs_less(walls):
    """A satin, of which a tenth of the rays meet walls; 4,096 places of a lattice, whose mean has an error of .5 %."""
    fabric, wi, wo = woven("satin_8"), unit(30.0, 115.0), unit(60.0, 29.0)
    wide, number = equal_queries(wi, wo, sigma=24.0), np.arange(4096)
    small = equal_queries(wi, wo, sigma=0.03, rows=4096)
    small = small._replace(u=np.float32(number * 0.75487767 % 1 * 8), v=np.float32(number * 0.56984029 % 1 * 8))
    options = {"min_count": 32, "max_count": 32}
    near = _answers(fabric, small, walls=walls, **options).mean.mean(axis=0) @ COLOUR
    far = _answers(fabric, wide, walls=walls).mean[0] @ COLOUR
    assert near == pytest.approx(far, rel=0.02) if walls == "rim" else near < 0.95 * far


@pytest.mark.parametrize("options", [
    {"frame": "macro"}, {"shadows": False}, {"parallax": False, "walls": "rim"},
    {"estimator": "quadrature"}, {"estimator": "quadrature", "walls": "left_out", "footprint": "box"},
])  # fmt: skip
def test_rays_need_the_ply_model_estimators_of_rays_and_a_viewer_not_too_low(options):
    assert "parallax" in refusal(validated, TruthOptions, options, "recipe.toml")
    assert "89 degrees" in refusal(_answers, LOPSIDED, equal_queries(unit(20.0, 0.0), unit(89.5, 50.0)))


def test_a_crest_has_its_own_colour_where_the_viewer_sees_it():
    """The viewer sees the crest of a red warp across the threads, where flat cloth has a blue one."""
    cloth = coloured(woven("basket", ("##.", ".##", "#.#")), ends=[["red", 1], ["blue", 2]])
    field = height_field(cloth)
    crest = surface_at(field, 0.5, 0.5, 0, 0)
    wo = unit(78.0, 0.0)
    shift = (crest[2] - reference_plane(field)) * wo[0] / wo[2]
    assert 0.5 < shift < 1.5
    query = equal_queries(unit(50.0, 0.0), wo, sigma=0.002, centre=((0.5 - shift) % 3, 0.5))
    options = TruthOptions(relative_error=0.01)
    found = component_colours(cloth, query, options, 1).mean[0, 2]
    np.testing.assert_allclose(found, PALETTE["red"]["diffuse"], atol=1e-6)
