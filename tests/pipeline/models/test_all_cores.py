from threading import Barrier

import numpy as np
import pytest

from pipeline.models.all_cores import AllCores
from pipeline.models.method import CHUNK_ROWS
from pipeline.models.named import loaded
from pipeline.models.woven.model import Woven, WovenNetwork
from pipeline.shards.queries import QueryOptions, draw_queries
from tests.pipeline.models.stand_ins import SMALL
from weaves.fabric import load_fabric

DENIM = load_fabric("denim")
ROWS = 3 * CHUNK_ROWS + 17


ANY = QueryOptions(behind=0.2, stretch=3.0)


def queries(rows=ROWS, options=ANY):
    return draw_queries(options, DENIM.weave.repeat, 11, 0, rows)


class Fake:
    """Answers with the seed that it is given, after it has met another thread."""

    name, setting = "fake", ""

    def __init__(self, together=1):
        self.barrier = Barrier(together)

    def predict(self, fabric, queries, seed=0):
        if seed:
            self.barrier.wait(timeout=300.0)
        return np.full((len(queries.u), 4), seed % 9973, np.float32)


@pytest.mark.parametrize("name", ["soft_nodes:1", "selvage:.02", "woven"])
def test_no_bit_depends_on_the_number_of_threads(name):
    network = name == "woven"
    method = Woven(WovenNetwork(SMALL[name])) if network else loaded(name, "test", "name")[0]
    drawn = queries(options=QueryOptions() if network else ANY)
    one, *others = (AllCores(method, threads).predict(DENIM, drawn) for threads in (1, 2, 5))
    assert one.shape == (ROWS, 4) and one.dtype == np.float32
    for other in others:
        np.testing.assert_array_equal(one, other)
    assert AllCores(method).predict(DENIM, queries(0)).shape == (0, 4)
    whole = method.predict(DENIM, drawn)
    if name == "soft_nodes:1":
        np.testing.assert_array_equal(one, whole)
    elif network:  # products of matrices of other sizes may differ in the last bits
        np.testing.assert_allclose(one, whole, rtol=1e-4, atol=1e-6)


def test_two_runs_are_answered_at_a_time_with_seeds_of_their_own():
    """Two runs after the first wait for one another: one thread alone would wait for ever."""
    AllCores(Fake(together=2), threads=2).predict(DENIM, queries(3 * CHUNK_ROWS))
    drawn = AllCores(Fake(), threads=2).predict(DENIM, queries(), seed=0)[:, 0]
    assert (drawn[:CHUNK_ROWS] == 0).all() and len(set(drawn[::CHUNK_ROWS].tolist())) == 4
    np.testing.assert_array_equal(drawn[CHUNK_ROWS:-17:CHUNK_ROWS], drawn[2 * CHUNK_ROWS - 1 :: CHUNK_ROWS])
    assert (AllCores(Fake(), threads=2).predict(DENIM, queries(7), seed=5) == 5).all()
