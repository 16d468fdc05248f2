"""Patches of view rays: against points of the fabric that the viewer sees displaced, and what cannot depend on size.

The rays that meet the cloth around a visible point p cross the reference plane at p - (h(p) - z0) wo_xy / wo_z, in an
area of A(p, wo) dp / wo_z. Points of the fabric with that place in the footprint are another way to the same mean.
"""

import math

import numpy as np
import pytest

from pipeline.shards.queries import QueryOptions, draw_queries
from pipeline.truth.cloth import cloth_side, columns_of
from pipeline.truth.estimator import estimate
from pipeline.truth.geometry.heightfield import GAP, height_field, surface_at
from pipeline.truth.geometry.pieces import reference_plane
from pipeline.truth.node_table.tables import FINE
from pipeline.truth.options import TruthOptions
from pipeline.truth.query import Queries
from pipeline.truth.scattering.point import Choices, directions_of, point_share
from pipeline.truth.scattering.thread_colours import component_colours
from tests.pipeline.truth.cloths import LOPSIDED, PALETTE, coloured, direction, equal_queries, woven
from tests.presets import slow
from weaves.errors import BadInput
from weaves.validation import validated

COLOUR = np.array([0.2, 0.2, 0.5, 0.5])
CHOICES = Choices(macro=False, shadows=True)


def _answers(fabric, queries, parallax=True, estimator="owen", **options):
    options = {"relative_error": 0.005, "max_count": 1 << 14} | options
    return estimate(fabric, queries, TruthOptions(estimator=estimator, parallax=parallax, **options), 1)


def _from_displaced_points(fabric, query, count=60_000):
    """Return components and transparency of one front query from even points of the fabric, (5,), and their error."""
    front, back = height_field(fabric), height_field(fabric.back())
    plane, (ends, picks) = reference_plane(front), fabric.weave.repeat
    wi, wo, sigma = query.wi[0].astype(float), query.wo[0].astype(float), float(query.sigma[0])
    directions = directions_of(*wi, *wo, 0.0)
    # Everything whose place in the footprint is within five deviations.
    shift = np.abs(wo[:2]) / wo[2] * max(front.highest - plane, plane - front.lowest)
    random = np.random.default_rng(7)
    low = np.array([query.u[0], query.v[0]]) - 5 * sigma - shift
    points = low + random.random((count, 2)) * 2 * (5 * sigma + shift)
    sums = np.zeros((count, 6))
    for k, (x, y) in enumerate(points):
        own_x, own_y = x % ends, y % picks
        family, area, specular, diffuse, through = point_share(front, back, own_x, own_y, directions, CHOICES)
        height = 0.0 if family == GAP else surface_at(front, own_x, own_y, int(own_x), int(own_y))[2]
        at = np.array([x, y]) - (height - plane) * wo[:2] / wo[2] - [query.u[0], query.v[0]]
        weight = math.exp(-0.5 * (at @ at) / sigma**2)
        if family != GAP:
            sums[k, family], sums[k, 2 + family] = weight * specular, weight * diffuse
        sums[k, 4:] = weight * through, weight * area
    mean = sums[:, :5].sum(axis=0) / sums[:, 5].sum()
    residual = (sums[:, :5] - mean * sums[:, 5:]) * math.sqrt(count) / sums[:, 5].sum()
    return mean, residual.std(axis=0)


@pytest.mark.parametrize("fabric", [LOPSIDED, woven("voile"), woven("denim")], ids=["narrow", "open", "closed"])
@pytest.mark.parametrize(("degrees", "light"), [slow(30.0, 40.0), slow(65.0, 20.0), (65.0, 150.0)])
def test_rays_and_displaced_points_have_the_same_mean(fabric, degrees, light):
    """z-tests of five numbers in nine cases, Šidák-corrected to 1e-3; the light of 150 degrees is behind the cloth."""
    query = equal_queries(direction(light, 100.0), direction(degrees, 25.0), sigma=0.25, centre=(0.8, 1.3))
    answers = _answers(fabric, query, walls="left_out")
    expected, doubt = _from_displaced_points(fabric, query)
    found = np.append(answers.mean[0], answers.transparency[0])
    own = np.append(answers.standard_error[0], answers.transparency_standard_error[0])
    assert (np.abs(found - expected) < 4.3 * np.hypot(doubt, own) + 1e-7).all()
    if fabric is not LOPSIDED:
        return
    flat = _answers(fabric, query, parallax=False)
    doubt = np.hypot(flat.standard_error, answers.standard_error)
    assert (np.abs(flat.mean - answers.mean) > 4.3 * doubt).any()  # the heights are seen


@pytest.mark.parametrize("estimator", ["mc", "r2", "owen", "auto"])
@pytest.mark.parametrize("degrees", [slow(0.0), slow(50.0), 80.0])
def test_a_footprint_of_a_repeat_sees_no_parallax(estimator, degrees):
    query = equal_queries(direction(35.0, 200.0), direction(degrees, 70.0), sigma=4.0)
    rays, flat = (_answers(LOPSIDED, query, parallax, estimator, walls="left_out") for parallax in (True, False))
    assert (np.abs(rays.mean - flat.mean) < 4 * np.hypot(rays.standard_error, flat.standard_error) + 1e-6).all()
    doubt = np.hypot(rays.transparency_standard_error, flat.transparency_standard_error)
    assert (np.abs(rays.transparency - flat.transparency) < 4 * doubt + 1e-6).all()


@pytest.mark.parametrize("degrees", [slow(0.0), slow(45.0), 75.0, slow(85.0)])
def test_the_mean_over_places_does_not_depend_on_the_size_of_the_footprint(degrees):
    """Where no ray meets a wall: warps that never bend, side by side, seen across, of which each hides a part. The mean
    over a lattice of 256 places errs by less than .2 % for a smooth integrand with a few kinks."""
    fabric = woven("denim", ("##", "##"), {"width": 1.0})
    wi, wo = direction(30.0, 120.0), direction(degrees, 0.0)
    small = equal_queries(wi, wo, sigma=0.03, rows=256)
    small = small._replace(u=np.float32(np.arange(256) / 128))
    wide = equal_queries(wi, wo, sigma=4.0)
    near, far = (_answers(fabric, queries).mean.mean(axis=0) @ COLOUR for queries in (small, wide))
    assert near == pytest.approx(far, rel=0.005)
    if degrees > 70:
        flat = _answers(fabric, small, parallax=False).mean.mean(axis=0) @ COLOUR
        assert flat < 0.9 * far


def test_a_viewer_behind_sees_the_back():
    wi, wo = (np.float32([direction(*at)]) for at in ((160.0, 10.0), (125.0, 60.0)))
    query = Queries.round([0.4], [1.1], [0.2], wi, wo)
    behind, front = _answers(LOPSIDED, query), _answers(LOPSIDED.back(), query.turned())
    np.testing.assert_array_equal(behind.mean, front.mean)


@pytest.mark.parametrize("walls", [slow("left_out"), "rim"])
def test_with_rims_no_place_weighs_less(walls):
    """A satin, of which a tenth of the rays meet walls; 4,096 places of a lattice, whose mean has an error of .5 %."""
    fabric, wi, wo = woven("satin_8"), direction(30.0, 115.0), direction(60.0, 29.0)
    wide, number = equal_queries(wi, wo, sigma=24.0), np.arange(4096)
    small = equal_queries(wi, wo, sigma=0.03, rows=4096)
    small = small._replace(u=np.float32(number * 0.75487767 % 1 * 8), v=np.float32(number * 0.56984029 % 1 * 8))
    options = {"min_count": 32, "max_count": 32}
    near = _answers(fabric, small, walls=walls, **options).mean.mean(axis=0) @ COLOUR
    far = _answers(fabric, wide, walls=walls).mean[0] @ COLOUR
    assert near == pytest.approx(far, rel=0.02) if walls == "rim" else near < 0.95 * far


@pytest.mark.parametrize("options", [
    {"frame": "macro"}, {"shadows": False}, {"parallax": False, "walls": "rim"}, {"estimator": "quadrature"},
])  # fmt: skip
def test_rays_need_the_ply_model_estimators_of_rays_and_a_viewer_not_too_low(options):
    with pytest.raises(BadInput, match="parallax"):
        validated(TruthOptions, options, "recipe.toml")
    with pytest.raises(BadInput, match="89 degrees"):
        _answers(LOPSIDED, equal_queries(direction(20.0, 0.0), direction(89.5, 50.0)))


@pytest.mark.parametrize("walls", ["left_out", "rim"])
@pytest.mark.parametrize("fabric", [slow(woven("denim")), slow(woven("satin_8")), LOPSIDED, slow(woven("voile"))])
def test_tables_answer_footprints_of_rays(fabric, walls):
    """Round, elliptic and rotated ones, views to 80 degrees, the light of every third query behind the cloth."""
    options = QueryOptions(sigma=(0.8, 4.0), stretch=3.0, max_angle=75.0, behind=0.3)
    queries = draw_queries(options, fabric.weave.repeat, 6, 0, 120)
    physics = TruthOptions(walls=walls)
    queries = queries.take(FINE.knows(cloth_side(fabric, physics), columns_of(queries)))
    assert len(queries.u) > 60
    exact = _answers(fabric, queries, walls=walls, relative_error=0.002, max_count=1 << 15)
    found = estimate(fabric, queries, physics.model_copy(update={"estimator": "node_table"}), 1)
    size = np.linalg.norm(exact.mean, axis=1)
    wrong = np.linalg.norm(found.mean - exact.mean, axis=1)
    assert np.median(wrong / size) < 0.01
    assert (np.abs(found.mean - exact.mean) < found.bound + 3 * exact.standard_error + 1e-6).mean() > 0.99
    assert np.abs(found.transparency - exact.transparency).max() < 0.02


def test_a_crest_has_its_own_colour_where_the_viewer_sees_it():
    """The viewer sees the crest of a red warp across the threads, where flat cloth has a blue one."""
    cloth = coloured(woven("basket", ("##.", ".##", "#.#")), ends=[["red", 1], ["blue", 2]])
    field = height_field(cloth)
    crest = surface_at(field, 0.5, 0.5, 0, 0)
    wo = direction(78.0, 0.0)
    shift = (crest[2] - reference_plane(field)) * wo[0] / wo[2]
    assert 0.5 < shift < 1.5
    query = equal_queries(direction(50.0, 0.0), wo, sigma=0.002, centre=((0.5 - shift) % 3, 0.5))
    options = TruthOptions(relative_error=0.01)
    found = component_colours(cloth, query, options, 1).mean[0, 2]
    np.testing.assert_allclose(found, PALETTE["red"]["diffuse"], atol=1e-6)
