from functools import lru_cache

import numpy as np
import pytest

from pipeline.analytic.summed_area.answer import MOST_TAPS, answer, rounds
from pipeline.analytic.summed_area.tables import tabulate
from pipeline.shards.queries import QueryOptions, draw_queries
from tests.pipeline.models.against_truth import colour_error, truth_of
from weaves.fabric import load_fabric


@pytest.fixture(scope="module")
def denim():
    fabric = load_fabric("denim")
    return fabric, tabulate(fabric, 64)


@lru_cache
def asked(sigma):
    """Return queries of a range of sizes, and the truth without walls, which the tables leave out too."""
    fabric = load_fabric("denim")
    queries = draw_queries(QueryOptions(sigma=sigma, max_angle=75.0), fabric.weave.repeat, 3, 0, 200)
    return queries, truth_of(fabric, queries, walls="left_out")


@pytest.mark.slow
def test_more_clusters_err_less(denim):
    fabric, tables = denim
    queries, truth = asked((0.8, 8.0))
    assert colour_error(answer(tables, queries), truth) < 0.8 * colour_error(
        answer(tabulate(fabric, 16), queries), truth
    )


@pytest.mark.slow
def test_narrow_footprints_converge_with_the_texels_of_the_finest_level(monkeypatch, denim):
    """A footprint narrower than those of the table is answered wider: order 1 at least, until clusters err more."""
    queries, truth = asked((0.1, 0.4))
    texels, errors = [2, 4, 8], []
    for count in texels:
        monkeypatch.setattr("pipeline.analytic.summed_area.tables._finest", lambda cells, count=count: count)
        errors.append(colour_error(answer(tabulate(denim[0], 64), queries), truth))
    assert -np.polyfit(np.log(texels), np.log(errors), 1)[0] > 1.0, errors


def test_footprints_of_any_size_have_finite_answers(denim):
    fabric, tables = denim
    queries = draw_queries(QueryOptions(max_angle=89.9), fabric.weave.repeat, 5, 0, 400)
    for size in (1e-12, 1e-3, 1.0, 1e6, 1e30):
        sizes = np.full(len(queries.u), size, np.float32)
        found = answer(tables, queries._replace(sigma=sizes, sigma_minor=sizes))
        assert np.isfinite(found).all() and (found >= 0.0).all() and found.any()


def test_round_ones_stand_for_a_long_footprint():
    """Variance along both axes is kept, up to a ratio of the axes."""
    queries = draw_queries(QueryOptions(sigma=(0.1, 2.0), stretch=6.0), (4, 4), 6, 0, 500)
    found = rounds(queries)
    several = found.readings > 1
    np.testing.assert_allclose(np.hypot(found.sigma, found.spread)[several], queries.sigma[several], rtol=1e-5)
    np.testing.assert_allclose(found.sigma[several], queries.sigma_minor[several], rtol=1e-5)
    assert found.readings.min() == 1 and 2 < found.readings.max() <= MOST_TAPS
    angle = queries.angle - np.float32(np.pi / 2)
    again = rounds(queries._replace(sigma=queries.sigma_minor, sigma_minor=queries.sigma, angle=angle))
    np.testing.assert_allclose(again.sigma, found.sigma, rtol=1e-5)
    np.testing.assert_allclose(np.abs(again.cosine * found.cosine + again.sine * found.sine), 1.0, atol=1e-5)
