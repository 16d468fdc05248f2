from threading import Barrier

import numpy as np
import pytest

from pipeline.models.all_cores import AllCores
from pipeline.models.method import CHUNK_ROWS
from pipeline.models.named import own_method
from pipeline.shards.queries import QueryOptions, draw_queries
from weaves.fabric import load_fabric

DENIM = load_fabric("denim")
ROWS = 3 * CHUNK_ROWS + 17


def queries(rows=ROWS):
    return draw_queries(QueryOptions(behind=0.2, stretch=3.0), DENIM.weave.repeat, 11, 0, rows)


class Fake:
    """Answers with the seed that it is given, after it has met another thread."""

    name, setting = "fake", ""

    def __init__(self, together=1):
        self.barrier = Barrier(together)

    def predict(self, fabric, queries, seed=0):
        if seed:
            self.barrier.wait(timeout=300.0)
        return np.full((len(queries.u), 4), seed % 9973, np.float32)


@pytest.mark.parametrize("name", ["soft_nodes:1", "selvage"])
def test_no_bit_depends_on_the_number_of_threads(name):
    method = own_method(name, "test", "name")
    one, *others = (AllCores(method, threads).predict(DENIM, queries()) for threads in (1, 2, 5))
    assert one.shape == (ROWS, 4) and one.dtype == np.float32
    for other in others:
        np.testing.assert_array_equal(one, other)
    assert AllCores(method).predict(DENIM, queries(0)).shape == (0, 4)
    if name == "soft_nodes:1":  # products of matrices of other sizes may differ in the last bits
        np.testing.assert_array_equal(one, method.predict(DENIM, queries()))
    np.testing.assert_allclose(one, method.predict(DENIM, queries()), rtol=1e-4, atol=1e-6)


def test_two_runs_are_answered_at_a_time():
    """Two runs after the first wait for one another: one thread alone would wait for ever."""
    AllCores(Fake(together=2), threads=2).predict(DENIM, queries(3 * CHUNK_ROWS))


def test_runs_have_seeds_of_their_own_and_few_queries_have_the_callers():
    drawn = AllCores(Fake(), threads=2).predict(DENIM, queries(), seed=0)[:, 0]
    assert (drawn[:CHUNK_ROWS] == 0).all() and len(set(drawn[::CHUNK_ROWS].tolist())) == 4
    np.testing.assert_array_equal(drawn[CHUNK_ROWS:-17:CHUNK_ROWS], drawn[2 * CHUNK_ROWS - 1 :: CHUNK_ROWS])
    assert (AllCores(Fake(), threads=2).predict(DENIM, queries(7), seed=5) == 5).all()
