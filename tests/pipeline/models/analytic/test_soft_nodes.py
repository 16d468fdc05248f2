import numpy as np
import pytest

from pipeline.analytic.soft_nodes.components import read_queries
from pipeline.analytic.soft_nodes.groups import DETAILS
from pipeline.analytic.soft_nodes.nodes import tabulate
from pipeline.compiled.arrays import nbytes
from pipeline.models.analytic.soft_nodes import SoftNodes, SoftNodesOptions
from pipeline.models.registry import load_methods
from pipeline.shards.queries import QueryOptions, draw_queries
from tests.pipeline.models.against_truth import colour_error, truth_of
from weaves.fabric import load_fabric


def test_each_level_is_its_sums_in_chunks_and_rows_lit_on_both_sides_are_answered_one_by_one():
    fabric = load_fabric("polyester_lining")
    asked = draw_queries(QueryOptions(), fabric.weave.repeat, 2, 0, 5000)
    methods = load_methods(SoftNodesOptions())
    assert [method.setting for method in methods] == [f"k = {level}" for level in DETAILS]
    table = tabulate(fabric, level=2)
    np.testing.assert_array_equal(methods[2].predict(fabric, asked), read_queries(table, asked).components)
    assert methods[2].bytes_stored(fabric) == nbytes(table)
    fabric, method = load_fabric("voile"), SoftNodes()
    asked = draw_queries(QueryOptions(behind=0.5), fabric.weave.repeat, 2, 0, 300)
    behind = asked.wi[:, 2] < 0
    found = method.predict(fabric, asked)
    np.testing.assert_array_equal(found[~behind], method.predict(fabric, asked.take(~behind)))
    np.testing.assert_array_equal(found[behind], method.behind(fabric, asked.take(behind))[:, :4])


@pytest.mark.slow
@pytest.mark.parametrize("sigma", [(0.06, 0.3), (0.3, 1.5)])
@pytest.mark.parametrize("name", ["cotton_twill", "wool_gabardine"])
def test_curved_cloth_is_as_near_to_the_truth_as_flat_cloth(name, sigma):
    """Views or lights beyond 70 degrees; left out, curvature would be more than a tenth of the squared error."""
    fabric, method = load_fabric(name), SoftNodes()
    options = QueryOptions(curvature=(0.05, 0.6), sigma=sigma, max_angle=85.0)
    curved = draw_queries(options, fabric.weave.repeat, 2, 0, 2000)
    steep = np.minimum(curved.wi[:, 2], curved.wo[:, 2]) < np.cos(np.radians(70.0))
    curved = curved.take(np.flatnonzero(steep)[:400])
    flat = curved._replace(curvature=np.zeros_like(curved.curvature))
    of_curved, of_flat = (truth_of(fabric, queries, estimator="owen") for queries in (curved, flat))
    wrong = colour_error(method.predict(fabric, curved), of_curved)
    assert wrong < 1.2 * colour_error(method.predict(fabric, flat), of_flat)
    assert wrong**2 < 0.9 * colour_error(method.predict(fabric, flat), of_curved) ** 2
