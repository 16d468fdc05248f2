import numpy as np
import pytest

from pipeline.truth.query import Queries
from reports.timing import Contender, set_threads, synchronise, time_side_by_side


def questions(rows):
    vectors = np.tile(np.float32([0, 0, 1]), (rows, 1))
    scalars = np.zeros(rows, np.float32)
    return [(None, Queries.round(scalars, scalars, scalars + 1, vectors, vectors))]


class Clock:
    """A clock that only the methods move."""

    def __init__(self):
        self.now = 0

    def __call__(self):
        return self.now


def method(clock, calls, label, durations):
    durations = iter(durations)

    def predict(fabric, queries):
        calls.append(label)
        clock.now += next(durations)

    return predict


def test_methods_take_turns_after_the_warm_up():
    clock, calls = Clock(), []
    contenders = [
        Contender(method(clock, calls, "a", [10**9] * 2 + list(range(1000, 2100, 100))), questions(10)),
        Contender(method(clock, calls, "b", [10**9] * 4 + [500] * 22), questions(100) + questions(150)),
    ]
    a, b = time_side_by_side(contenders, repeats=11, warm_up=2, clock=clock)
    assert calls == ["a", "b", "b"] * 13
    # Calls of a take 1000, 1100, ... 2000 ns for 10 queries: median 1500, quartiles 1250 and 1750.
    assert (a.median, a.first_quartile, a.third_quartile) == pytest.approx((150, 125, 175))
    assert (b.median, b.first_quartile, b.third_quartile) == pytest.approx((4, 4, 4))
    assert (a.rows, b.rows, a.repeats) == (10, 250, 11)


def test_real_time_passes():
    work = np.random.default_rng(0).random((60, 60))
    slow = Contender(lambda fabric, queries: [work @ work for _ in range(20)], questions(1))
    fast = Contender(lambda fabric, queries: None, questions(1))
    timed = time_side_by_side([slow, fast], repeats=20)
    assert timed[0].median > timed[1].median > 0


def test_threads_are_set_where_the_libraries_are_loaded():
    torch = pytest.importorskip("torch")
    before = torch.get_num_threads()
    try:
        set_threads(1)
        assert torch.get_num_threads() == 1
    finally:
        torch.set_num_threads(before)
    synchronise()
