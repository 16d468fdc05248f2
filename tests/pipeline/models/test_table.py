import numpy as np
import pytest

from pipeline.models.method import Method
from pipeline.models.options import TableOptions
from pipeline.models.registry import load_methods
from pipeline.shards.queries import QueryOptions, draw_queries
from pipeline.truth.estimator import estimate
from pipeline.truth.options import TruthOptions
from weaves.errors import BadInput
from weaves.fabric import load_fabric


def test_it_is_the_truth_s_table_and_more_nodes_err_less():
    fabric = load_fabric("polyester_lining")
    queries = draw_queries(QueryOptions(sigma=(0.05, 0.29)), fabric.weave.repeat, 1, 0, 64)
    expected = estimate(fabric, queries, TruthOptions(estimator="table"), 1, 0).mean
    coarse, fine = load_methods(TableOptions(nodes=[8, 32]))
    assert isinstance(fine, Method) and fine.covers(fabric) and fine.setting == "k = 32"
    # Narrow footprints ask the truth's fine table, which for a cloth of two different cells has 32 nodes as well.
    np.testing.assert_allclose(fine.predict(fabric, queries), expected, rtol=1e-5, atol=1e-7)
    assert np.abs(coarse.predict(fabric, queries) - expected).max() > 1e-3
    assert coarse.bytes_stored(fabric) < 0.2 * fine.bytes_stored(fabric)


def test_it_answers_plain_queries_only():
    (method,) = load_methods(TableOptions(nodes=[8]))
    fabric = load_fabric("polyester_lining")
    queries = draw_queries(QueryOptions(behind=0.5), fabric.weave.repeat, 1, 0, 16)
    with pytest.raises(BadInput, match="light from the viewer's side"):
        method.predict(fabric, queries)
