"""Cloths and lights of which the answer is known: every method against a formula, and its error against its size."""

import math

import numpy as np
import pytest

from pipeline.analytic.soft_nodes.answer import query_sums
from pipeline.analytic.soft_nodes.shade import AREA, BARE_AREA, BARE_DIFFUSE, BARE_SPECULAR
from pipeline.shards.queries import QueryOptions, draw_queries
from pipeline.truth.estimator import estimate
from pipeline.truth.options import TruthOptions
from pipeline.truth.query import Queries
from tests.pipeline.analytic.methods import (
    ALL,
    horizon_points,
    points,
    soft_nodes,
    soft_table,
    summed_area,
    woven,
)


def quadrature(fabric, queries):
    return estimate(fabric, queries, TruthOptions(estimator="quadrature", relative_error=1e-3), 1).mean


@pytest.mark.parametrize("method", [*ALL, quadrature])
def test_a_lamp_at_the_eye_lights_all_that_is_seen(method):
    """Diffuse parts with cosines to the cloth alone: cos / pi, whatever the weave, the footprint and the direction.

    Of a patch hidden almost wholly the soft methods answer less.
    """
    fabric = woven("cotton_twill", blend=0.0)
    queries = draw_queries(
        QueryOptions(sigma=(0.3, 4.0), max_angle=70.0, stretch=3.0), fabric.weave.repeat, 3, 0, 60
    )  # fmt: skip
    found = method(fabric, queries._replace(wi=queries.wo))[:, 2:].sum(axis=1)
    np.testing.assert_allclose(found * math.pi, queries.wo[:, 2], rtol=2e-3)


def straight(blend):
    """Return a cloth of round warps side by side that never bend: cylinders of diameter 1 at distance 1."""
    return woven("denim", ("##", "##"), blend=blend, twist=20.0)


def from_above(count=40, most=1.4):
    """Return wide queries from straight above, the light anywhere."""
    random = np.random.default_rng(2)
    theta, phi = random.uniform(0.0, most, count), random.uniform(0.0, 2.0 * math.pi, count)
    wi = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=1)
    up, wide = np.tile([0.0, 0.0, 1.0], (count, 1)), np.full(count, 8.0)
    return Queries.round(random.random(count) * 2, random.random(count) * 2, wide, wi, up)


def shadowed(wi, blend):
    """Return the diffuse component of `straight` from straight above.

    Across the yarns the light has the angle t to the normal. It meets a yarn from v = t - pi/2, where its surface turns
    away, to where the neighbour's shadow begins: sin(v - t) = 2 cos t - 1.
    """
    x, z = np.abs(wi[:, 0]).astype(np.float64), wi[:, 2].astype(np.float64)
    t = np.arctan2(x, z)
    ends = t - math.pi / 2, np.minimum(t + np.arcsin(2.0 * np.cos(t) - 1.0), math.pi / 2)
    macro, ply = (
        np.subtract(*(integral(v) for v in reversed(ends))) / 2.0
        for integral in (np.sin, lambda v: 0.5 * v * np.cos(t) + 0.25 * np.sin(2.0 * v - t))
    )
    return ((1.0 - blend) * z * macro + blend * np.hypot(x, z) * ply) / math.pi


def shadow_error(method, blend, **options):
    """Return the rms error over the mean."""
    queries = from_above()
    exact = shadowed(queries.wi, blend)
    found = method(straight(blend), queries, **options)
    assert not found[:, [1, 3]].any()  # no weft is seen
    return math.sqrt(np.mean((found[:, 2] - exact) ** 2)) / exact.mean()


@pytest.mark.parametrize("blend", [0.0, 1.0])
@pytest.mark.parametrize(
    ("method", "bound"),
    [(soft_nodes, 0.04), (summed_area, 0.04), (horizon_points, 0.02), (points, 0.006), (quadrature, 2.5e-3)],
)
def test_shadows_of_cylinders_on_each_other(method, bound, blend):
    """Without the neighbour's shadow the answer would be 17 % off, without shadow and terminator 37 %."""
    assert shadow_error(method, blend) < bound


def slope(counts, errors):
    """Return the order of convergence, fitted to logarithms."""
    return -np.polyfit(np.log(counts), np.log(errors), 1)[0]


@pytest.mark.parametrize("blend", [0.0, 1.0])
def test_shadows_converge_with_points_and_with_the_grid_of_horizons(blend):
    """A line across the yarns is cut at a few places: R2 points err by 1 / n, a grid of horizons by half a node."""
    counts, grids = [64, 256, 1024, 4096], [8, 16, 32, 64]
    assert 0.8 < slope(counts, [shadow_error(points, blend, count=n) for n in counts]) < 1.7
    assert 0.7 < slope(grids, [shadow_error(horizon_points, blend, count=2048, grid=n) for n in grids]) < 1.3


def test_the_seen_area_of_a_closed_surface_is_the_projected_one():
    """Straight yarns side by side hide one another, but no light passes: the area seen is cos, at any angle.

    From k = 2 to 4 a yarn has twice the nodes across, and a ramp half as wide: the error falls by order 1 at least.
    """
    fabric, errors = straight(0.5), []
    queries = draw_queries(QueryOptions(sigma=(6.0, 8.0), max_angle=80.0), fabric.weave.repeat, 3, 0, 60)
    for level in (2, 4):
        sums, gaps = query_sums(soft_table(fabric, level), queries)
        assert not gaps.any()
        errors.append(np.abs(sums[:, :, AREA].sum(axis=1) / queries.wo[:, 2] - 1.0).mean())
    assert errors[0] < 0.03 and slope([8, 16], errors) > 1.0, errors


@pytest.mark.parametrize(
    ("sigma", "stretch"), [(0.08, 1.0), (0.2, 1.0), (0.2, 3.0), (0.45, 1.0), (0.45, 2.0), (0.8, 1.0)]
)
def test_footprints_on_a_lattice_cover_the_cloth_evenly(sigma, stretch):
    """The mean over centres of the bare sums is that of a footprint far wider than the repeat, in every regime.

    Weights are shares of the footprint up to the tail that is cut off, alike for all sums, and to the error of rules.
    """
    fabric = woven("polyester_lining", twist=20.0, width=0.9)
    ends, picks = fabric.weave.repeat
    u, v = (axis.ravel() for axis in np.mgrid[0:ends:0.125, 0:picks:0.125] + 0.0625)
    wi, wo = (np.tile(np.float32(w), (u.size, 1)) for w in ([0.16, -0.12, 0.9798], [-0.12, 0.16, 0.9798]))
    queries = Queries.round(u, v, np.full(u.size, sigma * stretch), wi, wo)
    queries = queries._replace(sigma_minor=np.full_like(queries.u, sigma), angle=np.full_like(queries.u, 0.7))
    wide = Queries.round([0.0], [0.0], [1e3], wi[:1], wo[:1])
    means = []
    for asked in (queries, wide):
        sums, _ = query_sums(soft_table(fabric), asked)
        means.append(sums[:, :, [BARE_AREA, BARE_DIFFUSE, BARE_SPECULAR]].mean(axis=0).astype(np.float64))
    ratio = means[0] / means[1]
    assert 0.96 < ratio.mean() < 1.01
    np.testing.assert_allclose(ratio / ratio.mean(), 1.0, atol=0.015)
