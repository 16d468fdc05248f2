import numpy as np
import pytest

from pipeline.analytic.soft_nodes.detail import DETAILS
from pipeline.analytic.soft_nodes.features import read_queries
from pipeline.analytic.soft_nodes.nodes import tabulate
from pipeline.models.method import Method
from pipeline.models.registry import load_methods
from pipeline.models.soft_nodes.model import SoftNodes
from pipeline.models.soft_nodes.options import SoftNodesOptions
from pipeline.shards.queries import QueryOptions, draw_queries
from weaves.errors import BadInput
from weaves.fabric import load_fabric


def test_each_level_is_its_sums_in_chunks():
    fabric = load_fabric("polyester_lining")
    asked = draw_queries(QueryOptions(), fabric.weave.repeat, 2, 0, 5000)
    methods = load_methods(SoftNodesOptions())
    assert [method.setting for method in methods] == [f"k = {level}" for level in DETAILS]
    for method, level in zip(methods, DETAILS, strict=True):
        assert isinstance(method, Method)
        assert method.covers(fabric)
        table = tabulate(fabric, level=level)
        np.testing.assert_array_equal(method.predict(fabric, asked), read_queries(table, asked)[1])
        assert method.bytes_stored(fabric) == table.nbytes


def test_curved_cloth_is_refused():
    fabric = load_fabric("polyester_lining")
    asked = draw_queries(QueryOptions(curvature=(0.1, 0.2)), fabric.weave.repeat, 2, 0, 20)
    with pytest.raises(BadInput, match="20 rows; first row 0: curvature"):
        SoftNodes().predict(fabric, asked)


def test_lights_on_both_sides_are_answered_row_by_row():
    fabric, method = load_fabric("voile"), SoftNodes()
    asked = draw_queries(QueryOptions(behind=0.5), fabric.weave.repeat, 2, 0, 300)
    behind = asked.wi[:, 2] < 0
    found = method.predict(fabric, asked)
    np.testing.assert_array_equal(found[~behind], method.predict(fabric, asked.take(~behind)))
    np.testing.assert_array_equal(found[behind], method.behind(fabric, asked.take(behind))[:, :4])


def test_viewers_behind_are_refused():
    fabric = load_fabric("polyester_lining")
    asked = draw_queries(QueryOptions(), fabric.weave.repeat, 2, 0, 20)
    with pytest.raises(BadInput, match="wo"):
        SoftNodes().predict(fabric, asked._replace(wo=-asked.wo))
