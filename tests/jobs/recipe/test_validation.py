"""Queries that a recipe may ask of the estimator `node_table`."""

import pytest

from jobs.recipe.validation import table_refusal
from pipeline.shards.queries import QueryOptions, draw_queries
from pipeline.truth.cloth import cloth_side, columns_of
from pipeline.truth.node_table.tables import FINE
from pipeline.truth.options import TruthOptions
from weaves.fabric import load_fabric


@pytest.mark.parametrize("walls", ["left_out", "rim"])
@pytest.mark.parametrize("name", ["denim", "voile", "silk_shantung"])
def test_a_table_knows_the_view_rays_that_a_recipe_may_ask_for(name, walls):
    fabric, angle = load_fabric(name), 80.0
    rays = TruthOptions(walls=walls)
    reason = table_refusal(rays, QueryOptions(sigma=(0.05, 8.0), max_angle=angle), [fabric])
    assert name in reason
    least = float(reason.split("from ")[1].split()[0]) * 1.05
    options = QueryOptions(sigma=(least, 8.0), max_angle=angle, directions="hemisphere")
    assert table_refusal(rays, options, [fabric]) == ""
    assert table_refusal(TruthOptions(parallax=False), QueryOptions(sigma=(0.05, 8.0)), [fabric]) == ""
    queries = draw_queries(options, fabric.weave.repeat, 1, 0, 200)
    assert FINE.knows(cloth_side(fabric, rays), columns_of(queries)).all()


def test_boxes_of_view_rays_and_rims_of_very_open_cloth_are_for_other_estimators():
    box = TruthOptions(footprint="box")
    assert "Gaussian" in table_refusal(box, QueryOptions(sigma=(4.0, 8.0)), [load_fabric("denim")])
    fabric = load_fabric("gauze")
    sheer = fabric.model_copy(update={"weft": fabric.weft.model_copy(update={"width": 0.55})})
    queries = QueryOptions(sigma=(4.0, 8.0), max_angle=60.0)
    assert table_refusal(TruthOptions(), queries, [fabric]) == ""
    words = "it knows rims of yarns at least 0.6 wide, gauze has 0.55"
    assert table_refusal(TruthOptions(), queries, [fabric, sheer]) == words
