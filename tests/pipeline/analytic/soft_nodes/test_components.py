"""Components and bounds that queries read of the sums, with the light in front and behind."""

import math

import numpy as np
import pytest

from pipeline.analytic.soft_nodes.components import read_behind, read_queries
from pipeline.analytic.soft_nodes.nodes import tabulate
from pipeline.truth.estimator import estimate
from pipeline.truth.options import TruthOptions
from tests.pipeline.analytic.methods import soft_table
from tests.pipeline.models.against_truth import colour_error
from tests.pipeline.truth.cloths import LOPSIDED, drawn, woven
from tests.presets import slow
from weaves.fabric import load_fabric


def test_rows_do_not_depend_on_each_other_nor_the_front_on_the_back():
    table = soft_table(LOPSIDED)
    asked = drawn(LOPSIDED, 3, 60)
    whole, part = read_queries(table, asked), read_queries(table, asked.take(slice(20, 40)))
    for all_rows, some in zip(whole, part, strict=True):
        np.testing.assert_array_equal(some, all_rows[20:40])
    fabric = load_fabric("cotton_twill")
    front, both = soft_table(fabric), soft_table(fabric, behind=True)
    for name in ("nodes", "mean", "sharpness", "grid", "evenly"):
        np.testing.assert_array_equal(getattr(front, name), getattr(both, name))
    assert not front.behind_mean.size and both.behind_grid.shape == both.grid.shape


def test_yarns_that_never_change_side():
    """A float without end is straight: numbers stay finite, beneath and on top, with and without room around."""
    for width in (0.7, 1.0):
        fabric = woven("denim", ("##", "##"), width=width)
        asked = drawn(fabric, 4, 200)
        for found in read_queries(tabulate(fabric), asked):
            assert np.isfinite(found).all()


def asked(fabric, count=100, **options):
    queries = drawn(fabric, 3, count, behind=1.0, max_angle=75.0, **options)
    assert (queries.wi[:, 2] < 0).all()
    return queries


@pytest.mark.parametrize("name", ["voile", slow("satin_8")])
@pytest.mark.parametrize(
    ("sigma", "bound", "clear"),
    [slow((0.05, 0.25), 0.18, 0.03), slow((0.25, 1.0), 0.06, 0.006), ((1.0, 8.0), 0.035, 0.005)],
)
def test_it_is_near_the_truth(name, sigma, bound, clear):
    """RMSE of a grey cloth's colour over its mean, and of the transparency; rays that meet walls are left out.

    With rims nodes are 1 % brighter on voile: a wall has the light of its box, which is more than that of its rim.
    """
    fabric = load_fabric(name)
    queries = asked(fabric, sigma=sigma)
    truth = estimate(fabric, queries, TruthOptions(relative_error=0.01, walls="left_out"), 1)
    found = read_behind(tabulate(fabric, behind=True, rims=False), queries)
    assert colour_error(found[:, :4], truth.mean) < bound
    assert math.sqrt(np.mean((found[:, 4] - truth.transparency) ** 2)) < clear


def test_no_light_changes_the_transparency_and_only_thick_cloth_without_gaps_is_opaque():
    fabric = load_fabric("voile")
    table, queries = tabulate(fabric, behind=True), asked(fabric)
    found = read_behind(table, queries)[:, 4]
    np.testing.assert_allclose(found, read_behind(table, queries._replace(wi=-queries.wo))[:, 4], rtol=1e-5)
    assert (found >= 0).all() and (found <= 1).all()
    thick, thin = (load_fabric("denim").model_copy(update={"optical_thickness": depth}) for depth in (100.0, 1e-3))
    queries = asked(thick)
    assert read_behind(tabulate(thick, behind=True), queries)[:, 4].max() < 1e-3
    assert read_behind(tabulate(thin, behind=True), queries)[:, 4].min() > 0.95
