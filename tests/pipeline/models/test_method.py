import numpy as np
import pytest
import torch

from pipeline.models.method import in_chunks, loaded
from pipeline.shards.queries import QueryOptions, draw_queries

QUERIES = draw_queries(QueryOptions(), (4, 4), 0, 0, 37)
CPU = torch.device("cpu")


@pytest.mark.parametrize("chunk", [1, 10, 37, 100])
def test_chunks_keep_the_order_of_rows_and_columns(chunk, monkeypatch):
    monkeypatch.setattr("pipeline.models.method.CHUNK", chunk)
    asked = in_chunks(QUERIES, lambda wo, u: torch.cat([u[:, None], wo], dim=-1), CPU, ("wo", "u"), 4)
    np.testing.assert_array_equal(asked, np.concatenate([QUERIES.u[:, None], QUERIES.wo], axis=1))


def test_answers_are_as_wide_as_asked_even_of_no_rows():
    for rows in (37, 0):
        answers = in_chunks(QUERIES.take(slice(0, rows)), lambda u: u[:, None], CPU, ("u",), 1)
        assert answers.shape == (rows, 1) and answers.dtype == np.float32


def test_weights_of_another_network_are_refused():
    weights = torch.nn.Linear(2, 3).state_dict()
    assert torch.equal(loaded(torch.nn.Linear(2, 3), weights).weight, weights["weight"])
    with pytest.raises(RuntimeError):
        loaded(torch.nn.Linear(3, 2), weights)
