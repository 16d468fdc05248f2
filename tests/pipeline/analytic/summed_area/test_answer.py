"""Answers of tables against the truth: how far off, by how much less with more of them, and what must not matter."""

from functools import lru_cache

import numpy as np
import pytest

from pipeline.analytic.summed_area.answer import MOST_TAPS, answer, rounds
from pipeline.analytic.summed_area.tables import tabulate
from pipeline.shards.queries import QueryOptions, draw_queries
from pipeline.truth.estimator import estimate
from pipeline.truth.options import TruthOptions
from pipeline.truth.query import Queries
from weaves.fabric import load_fabric

COLOUR = np.array([0.3, 0.3, 0.5, 0.5])


@pytest.fixture(scope="module")
def denim():
    fabric = load_fabric("denim")
    return fabric, tabulate(fabric, 64)


def rmse(found, truth):
    return np.sqrt(np.mean(((found - truth) @ COLOUR) ** 2)) / np.mean(truth @ COLOUR)


@lru_cache
def asked(sigma):
    """Return queries of a range of sizes, and the truth."""
    fabric = load_fabric("denim")
    queries = draw_queries(QueryOptions(sigma=sigma, max_angle=75.0), fabric.weave.repeat, 3, 0, 200)
    return queries, estimate(fabric, queries, TruthOptions(relative_error=0.01), 1).mean


NARROW, MIDDLE, WIDE = (0.1, 0.4), (0.25, 0.8), (0.8, 8.0)


def test_more_clusters_err_less(denim):
    fabric, tables = denim
    queries, truth = asked(WIDE)
    assert rmse(answer(tables, queries), truth) < 0.8 * rmse(answer(tabulate(fabric, 16), queries), truth)


def test_narrow_footprints_converge_with_the_texels_of_the_finest_level(monkeypatch, denim):
    """A footprint narrower than those of the table is answered wider: order 1 at least, until clusters err more."""
    queries, truth = asked(NARROW)
    texels, errors = [2, 4, 8], []
    for count in texels:
        monkeypatch.setattr("pipeline.analytic.summed_area.tables._finest", lambda cells, count=count: count)
        errors.append(rmse(answer(tabulate(denim[0], 64), queries), truth))
    assert -np.polyfit(np.log(texels), np.log(errors), 1)[0] > 1.0, errors


def test_footprints_of_any_size_have_finite_answers(denim):
    fabric, tables = denim
    queries = draw_queries(QueryOptions(max_angle=89.9), fabric.weave.repeat, 5, 0, 400)
    for size in (1e-12, 1e-3, 1.0, 1e6, 1e30):
        sizes = np.full(len(queries.u), size, np.float32)
        found = answer(tables, queries._replace(sigma=sizes, sigma_minor=sizes))
        assert np.isfinite(found).all() and (found >= 0.0).all() and found.any()


def test_a_footprint_far_larger_than_the_repeat_has_no_place(denim):
    _, tables = denim
    up, none = np.tile([[0.6, 0.0, 0.8]], (5, 1)), np.zeros(5)
    queries = Queries.round(np.linspace(0, 3, 5), np.linspace(0, 3, 5), none + 50.0, up, up)
    found = answer(tables, queries)
    np.testing.assert_array_equal(found, found[:1].repeat(5, axis=0))


def test_round_ones_stand_for_a_long_footprint():
    """Variance along both axes is kept, up to a ratio of the axes."""
    queries = draw_queries(QueryOptions(sigma=(0.1, 2.0), stretch=6.0), (4, 4), 6, 0, 500)
    found = rounds(queries)
    np.testing.assert_allclose(
        np.hypot(found.sigma, found.spread)[found.readings > 1], queries.sigma[found.readings > 1], rtol=1e-5
    )
    np.testing.assert_allclose(found.sigma[found.readings > 1], queries.sigma_minor[found.readings > 1], rtol=1e-5)
    assert found.readings.min() == 1 and 2 < found.readings.max() <= MOST_TAPS
    swapped = queries._replace(
        sigma=queries.sigma_minor, sigma_minor=queries.sigma, angle=queries.angle - np.float32(np.pi / 2)
    )
    again = rounds(swapped)
    np.testing.assert_allclose(again.sigma, found.sigma, rtol=1e-5)
    np.testing.assert_allclose(np.abs(again.cosine * found.cosine + again.sine * found.sine), 1.0, atol=1e-5)
