"""Footprints of view rays by analytic methods: against the truth with parallax, and what parallax cannot change."""

from functools import cache, partial

import numpy as np
import pytest
from scipy.stats import qmc

from pipeline.analytic.soft_nodes.answer import query_sums
from pipeline.analytic.soft_nodes.nodes import tabulate
from pipeline.analytic.soft_nodes.shade import AREA
from pipeline.models.analytic.map_material import MapMaterialOptions
from pipeline.models.analytic.point_sampled import PointSampledOptions
from pipeline.models.analytic.prefiltered import PrefilteredOptions
from pipeline.models.analytic.soft_nodes import SoftNodes
from pipeline.truth.estimator import estimate
from pipeline.truth.options import TruthOptions
from pipeline.truth.query import Queries
from tests.directions import unit
from tests.pipeline.truth.cloths import LOPSIDED, equal_queries, woven
from tests.presets import slow

RAYS = TruthOptions(estimator="owen", relative_error=0.01)
PLANE = TruthOptions(estimator="owen", relative_error=0.01, parallax=False)


def _queries(fabric, count, seed, sigma=(0.06, 0.3), steepest=78.0):
    random = np.random.default_rng(seed)

    def directions():
        z = 1.0 - random.random(count) * (1.0 - np.cos(np.radians(steepest)))
        turn, sine = random.random(count) * 2.0 * np.pi, np.sqrt(1.0 - z * z)
        return np.stack([sine * np.cos(turn), sine * np.sin(turn), z], axis=-1).astype(np.float32)

    ends, picks = fabric.weave.repeat
    u, v = (np.float32(random.random(count) * period) for period in (ends, picks))
    size = np.float32(sigma[0] * (sigma[1] / sigma[0]) ** random.random(count))
    return Queries.round(u, v, size, directions(), directions())


def _kind(queries, kind):
    if kind == "stretch":
        turn = np.random.default_rng(2).random(len(queries.u)).astype(np.float32) * np.float32(3.0)
        return queries._replace(sigma=queries.sigma * 2, sigma_minor=queries.sigma / 2, angle=turn)
    if kind == "behind":
        return queries._replace(wi=queries.wi * np.float32([1, 1, -1]))
    if kind == "curvature":
        return queries._replace(curvature=np.full(len(queries.u), 0.05, np.float32))
    if kind == "rising":  # rays that turn above the lowest yarns and rise again
        flat = queries.wo[:, :2] / np.hypot(*queries.wo[:, :2].T)[:, None]
        steep = np.random.default_rng(7).uniform(np.radians(65.0), np.radians(84.0), len(flat))
        wo = np.concatenate([flat * np.sin(steep)[:, None], np.cos(steep)[:, None]], axis=1).astype(np.float32)
        return queries._replace(wo=wo, curvature=np.full(len(queries.u), 0.2, np.float32))
    return queries


def _error(method, fabric, queries, truth):
    method.prepare(fabric)
    return _differ(method.predict(fabric, queries), truth)


def _differ(found, truth):
    """Return the rms difference of the light of answers (N, 4) from that of the truth, over its root mean square."""
    found, expected = (components.sum(axis=1, dtype=np.float64) for components in (found, truth.mean))
    return np.sqrt(np.mean((found - expected) ** 2) / np.mean(expected**2))


@pytest.mark.parametrize(
    ("fabric", "kind", "most"),
    [
        (woven("denim"), "round", 0.035),
        (LOPSIDED, "round", 0.05),
        (woven("denim"), "stretch", 0.05),
        slow(woven("voile"), "behind", 0.08),
        slow(woven("denim"), "curvature", 0.06),
        (woven("denim"), "rising", 0.04),
        (woven("satin_8"), "fixed nodes", 0.05),
    ],
)
def test_soft_nodes_see_what_view_rays_see(fabric, kind, most):
    """Soft nodes, fixed or not, differ from the truth by a few per cent, the truth of the fabric plane far more."""
    seed, sigma, ratio = (5, (0.35, 0.7), 2.0) if kind == "fixed nodes" else (4, (0.06, 0.3), 1.5)
    queries = _kind(_queries(fabric, 60, seed, sigma), kind)
    truth = estimate(fabric, queries, RAYS, 1)
    error = _error(SoftNodes(2), fabric, queries, truth)
    assert error < most
    assert _differ(estimate(fabric, queries, PLANE, 1).mean, truth) > ratio * error


@pytest.mark.parametrize("name", ["denim", slow("satin_8"), slow("voile")])
def test_every_ray_of_an_even_footprint_ends(name):
    """With rims, areas of yarns and gaps sum to wo_z; without, steep views lose what walls hide."""
    queries = _queries(woven(name), 60, 6, sigma=(8.0, 9.0), steepest=88.0)
    areas = []
    for rims in (True, False):
        sums, gaps = query_sums(tabulate(woven(name), rims=rims), queries)
        areas.append((sums[:, :, AREA].sum(axis=1) + gaps) / queries.wo[:, 2])
    np.testing.assert_allclose(areas[0], 1.0, atol=5e-3)  # linear between angles
    assert areas[1].min() < 0.97
    assert areas[1].max() < 1.02


@pytest.mark.parametrize(
    ("name", "sigma", "most"),
    [
        ("denim", (0.05, 0.3), 0.04),
        slow("satin_8", (0.05, 0.3), 0.04),
        ("polyester_lining", (1.0, 4.0), 0.016),
        slow("voile", (1.0, 4.0), 0.025),
    ],
)
def test_rims_where_floats_end_hide_light_from_behind(name, sigma, most):
    """With rims that all light from behind reaches, denim and lining are off by .1; that none reaches, satin by .05."""
    fabric = woven(name)
    queries = _kind(_queries(fabric, 60, 11, sigma=sigma, steepest=75.0), "behind")
    assert _error(SoftNodes(4), fabric, queries, estimate(fabric, queries, RAYS, 1)) < most


@pytest.mark.parametrize("name", ["denim", *(slow(name) for name in ("satin_8", "silk_shantung", "voile", "crepe"))])
@pytest.mark.parametrize("degrees", [slow(0.0), slow(30.0), slow(60.0), 75.0, slow(85.0)])
def test_light_does_not_depend_on_how_finely_one_looks(name, degrees):
    """The mean over 1,024 places of narrow footprints against the truth of a wide one; three lights together."""
    fabric, narrow, wide = woven(name), 0.0, 0.0
    nodes = SoftNodes(2)
    nodes.prepare(fabric)
    places = (qmc.Sobol(2, seed=1).random(1024) * fabric.weave.repeat).astype(np.float32)
    exact = RAYS.model_copy(update={"relative_error": 0.002, "max_count": 1 << 16})
    for azimuth, light in ((20.0, (40.0, 200.0)), (110.0, (60.0, 10.0)), (250.0, (20.0, 300.0))):
        look = unit(*light), unit(degrees, azimuth)
        asked = equal_queries(*look, sigma=0.03, rows=1024)._replace(u=places[:, 0], v=places[:, 1])
        narrow += nodes.predict(fabric, asked).sum(axis=1).mean(dtype=np.float64)
        wide += estimate(fabric, equal_queries(*look, sigma=3.0 * max(fabric.weave.repeat)), exact, 1).mean.sum()
    assert narrow == pytest.approx(wide, rel=0.01)


@pytest.mark.parametrize("kind", ["stretch", "behind"])
def test_points_along_view_rays_converge_to_the_truth(kind):
    """The mean squared error of R2 points falls by more than four times from 16 to 256 of them."""
    fabric = LOPSIDED
    queries = _kind(_queries(fabric, 40, 9), kind)
    truth = estimate(fabric, queries, RAYS, 1)
    few, many = PointSampledOptions(counts=[16, 256], parallax=True, sequence="r2").methods()
    error = _error(many, fabric, queries, truth)
    assert error < 0.05
    assert _error(few, fabric, queries, truth) > 2.0 * error
    assert not np.array_equal(many.predict(fabric, queries, 1), many.predict(fabric, queries, 2))


TABLES = {"prefiltered": PrefilteredOptions, "map_material": partial(MapMaterialOptions, size=128)}


@cache
def rays_and_plane(name):
    """Return a method with parallax and one without, which keep the tables of their cloths for every test."""
    (rays,), (plane,) = (TABLES[name](parallax=parallax).methods() for parallax in (True, False))
    return rays, plane


@pytest.mark.parametrize(
    ("name", "fabric", "most", "ratio"),
    [("prefiltered", woven("silk_shantung"), 0.35, 1.2), ("map_material", woven("silk_shantung"), 0.45, 1.1)],
)
def test_tables_are_read_where_view_rays_end(name, fabric, most, ratio):
    """The error against the truth of view rays is below `most`, that of the fabric plane `ratio` times as large.

    The tables know no walls: rays that meet one are left out."""
    queries = _queries(fabric, 100, 4)
    truth = estimate(fabric, queries, RAYS.model_copy(update={"walls": "left_out"}), 1)
    rays, plane = rays_and_plane(name)
    error = _error(rays, fabric, queries, truth)
    assert error < most
    assert _error(plane, fabric, queries, truth) > ratio * error
    assert rays.bytes_stored(fabric) > plane.bytes_stored(fabric)


@pytest.mark.parametrize("name", TABLES)
def test_neither_wide_footprints_nor_views_from_above_see_parallax(name):
    fabric, (rays, plane) = woven("polyester_lining"), rays_and_plane(name)
    wide, narrow = _queries(fabric, 40, 6, sigma=(16.0, 32.0)), _queries(fabric, 40, 7)
    above = narrow._replace(wo=np.tile(np.float32([0, 0, 1]), (40, 1)))
    np.testing.assert_array_equal(rays.predict(fabric, above), plane.predict(fabric, above))
    np.testing.assert_allclose(rays.predict(fabric, wide), plane.predict(fabric, wide), rtol=1e-5, atol=1e-9)
    assert not np.allclose(rays.predict(fabric, narrow), plane.predict(fabric, narrow), rtol=0.05)
