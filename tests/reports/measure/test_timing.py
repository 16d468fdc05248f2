import math
import threading
import time

import pytest
import torch

from reports.measure import timing
from reports.measure.timing import Contender, affordable, quartiles, thread_counts, time_side_by_side
from tests.pipeline.truth.cloths import equal_queries


def many_queries(rows):
    return [(None, equal_queries([0, 0, 1], [0, 0, 1], rows=rows))]


class Clock:
    """A clock that only the methods move."""

    now = 0

    def __init__(self, monkeypatch):
        monkeypatch.setattr(timing.time, "perf_counter_ns", self)

    def __call__(self):
        return self.now

    def method(self, calls, label, durations):
        durations = iter(durations)

        def predict(fabric, queries):
            calls.append(label)
            self.now += next(durations)

        return predict


def test_methods_take_turns_after_the_warm_up(monkeypatch):
    clock, calls = Clock(monkeypatch), []
    contenders = [
        Contender(clock.method(calls, "a", [10**9] * 2 + list(range(1000, 2100, 100))), many_queries(10)),
        Contender(clock.method(calls, "b", [10**9] * 4 + [500] * 22), many_queries(100) + many_queries(150)),
    ]
    a, b = time_side_by_side(contenders, repeats=11, warm_up=2)
    assert calls == ["a", "b", "b"] * 13
    # Calls of a take 1000, 1100, ... 2000 ns for 10 queries: median 1500, quartiles 1250 and 1750.
    assert a.samples == pytest.approx(range(100, 210, 10)) and quartiles(a.samples) == pytest.approx((125, 150, 175))
    assert quartiles(b.samples) == pytest.approx((4, 4, 4)) and len(a.samples) == 11


def test_on_several_threads_each_makes_the_call_at_the_same_time():
    """A barrier of three lets nobody through unless three threads are in the call at once."""
    barrier, names = threading.Barrier(3, timeout=300), set()

    def predict(fabric, queries):
        names.add(threading.current_thread().name)
        barrier.wait()

    contender = Contender(predict, many_queries(10), threads=3)
    time_side_by_side([contender], repeats=2, warm_up=1)
    assert contender.rows == 30 and len(names) == 3 and thread_counts([4, 2, 4]) == [2, 4]


@pytest.mark.parametrize(("cost", "rows"), [(1, 1000), (10_000, 1000), (40_000, 512), (300_000, 64), (10**9, 16)])
def test_slow_methods_answer_fewer_queries(cost, rows, monkeypatch):
    """Of each of two fabrics .05 s allow 2500, 625, 83 and no queries at 10, 40, 300 µs and 1 s a query."""
    clock = Clock(monkeypatch)

    def predict(fabric, queries):
        clock.now += cost * len(queries.u)

    chosen = affordable(Contender(predict, many_queries(1000) * 2), longest=0.05)
    assert [len(queries.u) for _, queries in chosen.queries] == [rows, rows]


def test_real_time_passes_on_one_thread_of_torch_and_what_a_method_did_not_run_is_waiting():
    """Asleep: other work can only add to it, and its own running is a tenth at most."""
    before = torch.get_num_threads()
    asleep = Contender(lambda fabric, queries: time.sleep(0.01), many_queries(10))
    try:
        (idle,) = time_side_by_side([asleep], repeats=5, warm_up=1)
        assert torch.get_num_threads() == 1
    finally:
        torch.set_num_threads(before)
    assert quartiles(idle.samples)[1] >= 1e6 and 0.85 < idle.waited < 1.0


def test_energy_is_that_of_all_packages_whose_counters_begin_again(tmp_path, monkeypatch):
    """Each call of ten queries takes 2 J of one package, whose counter begins again at 5 J, and 1 J of another."""
    used, zones = 0, [tmp_path / f"intel-rapl:{k}" for k in range(2)]
    for zone in (*zones, zones[0] / "intel-rapl:0:0"):
        zone.mkdir()
        (zone / "max_energy_range_uj").write_text("4999999\n")
        (zone / "energy_uj").write_text("0\n")

    def predict(fabric, queries):
        nonlocal used
        used += 1
        for zone, microjoules in zip(zones, (2_000_000 * used % 5_000_000, 1_000_000 * used % 5_000_000), strict=True):
            (zone / "energy_uj").write_text(f"{microjoules}\n")

    for folder, joules in ((tmp_path, 0.3), (tmp_path / "none", math.nan)):
        monkeypatch.setattr(timing, "_ZONES", folder)
        (measured,) = time_side_by_side([Contender(predict, many_queries(10))], repeats=7, warm_up=1)
        assert measured.joules == pytest.approx(joules, nan_ok=True)
