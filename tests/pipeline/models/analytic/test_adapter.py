import numpy as np
import pytest

from pipeline.models.analytic.map_material import MapMaterialOptions
from pipeline.models.analytic.prefiltered import PrefilteredOptions
from pipeline.models.method import Method
from pipeline.models.registry import load_methods
from pipeline.shards.queries import QueryOptions, draw_queries
from tests.refusals import refusal
from weaves.fabric import load_fabric

DENIM = load_fabric("denim")


@pytest.mark.parametrize(("options", "texel"), [(MapMaterialOptions(size=64), 16), (PrefilteredOptions(), 27 * 4)])
def test_it_is_a_method_of_its_own_kinds_of_queries(options, texel):
    """It stores 64 x 64 texels, and all coarser ones."""
    (method,) = load_methods(options)
    assert isinstance(method, Method) and method.covers(DENIM) and method.setting == ""
    queries, bent = (
        draw_queries(QueryOptions(curvature=curvature), DENIM.weave.repeat, 1, 0, 16)
        for curvature in ((0.0, 0.0), (0.1, 0.5))
    )
    answers = method.predict(DENIM, queries)
    assert answers.shape == (16, 4) and answers.dtype == np.float32
    assert method.bytes_stored(DENIM) == sum(4**level for level in range(7)) * texel
    assert "flat cloth" in refusal(method.predict, DENIM, bent)
    assert "wo" in refusal(method.predict, DENIM, queries._replace(wo=-queries.wo))
