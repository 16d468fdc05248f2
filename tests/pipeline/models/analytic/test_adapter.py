import numpy as np
import pytest

from pipeline.models.analytic.map_material import MapMaterialOptions
from pipeline.models.analytic.prefiltered import PrefilteredOptions
from pipeline.models.analytic.soft_nodes import SoftNodesOptions
from pipeline.models.method import Method
from pipeline.models.registry import load_methods
from pipeline.shards.queries import QueryOptions, draw_queries
from tests.refusals import refusal
from weaves.errors import BadInput
from weaves.fabric import load_fabric

DENIM = load_fabric("denim")
BENT = {"curvature": (0.1, 0.5)}, "flat cloth"
# 64 x 64 texels of 16 bytes, or of 27 numbers, and all coarser ones.
CASES = [
    (MapMaterialOptions(size=64), "", sum(4**level for level in range(7)) * 16, [BENT]),
    (PrefilteredOptions(), "", sum(4**level for level in range(7)) * 27 * 4, [BENT]),
    (SoftNodesOptions(levels=[1]), "k = 1", None, []),
]


@pytest.mark.parametrize(("options", "setting", "size", "refused"), CASES, ids=lambda case: getattr(case, "model", ""))
def test_it_is_a_method_of_its_own_kinds_of_queries(options, setting, size, refused):
    (method,) = load_methods(options)
    assert isinstance(method, Method) and method.covers(DENIM) and method.setting == setting
    queries = draw_queries(QueryOptions(), DENIM.weave.repeat, 1, 0, 16)
    answers = method.predict(DENIM, queries)
    assert answers.shape == (16, 4) and answers.dtype == np.float32
    assert method.bytes_stored(DENIM) == size if size else method.bytes_stored(DENIM) > 0
    for kinds, says in refused:
        with pytest.raises(BadInput, match=says):
            method.predict(DENIM, draw_queries(QueryOptions(**kinds), DENIM.weave.repeat, 1, 0, 16))
    assert "wo" in refusal(method.predict, DENIM, queries._replace(wo=-queries.wo))
