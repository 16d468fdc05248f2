"""What other work does to times: measured against work of the test's own, and said in a sentence."""

import math
import time

import pytest

from reports.measure.timing import Contender, time_side_by_side
from reports.record import Record
from reports.tables.machine_load import QUIET, busy, waited, waiting
from tests.reports.measure.test_timing import many_queries


def spinning(seconds, share):
    """Return a method that runs for a share of a time and sleeps for the rest, as if others had the processor."""

    def predict(fabric, queries):
        end = time.thread_time() + seconds * share
        while time.thread_time() < end:
            pass
        time.sleep(seconds * (1.0 - share))

    return predict


def test_time_that_a_method_did_not_run_is_waiting():
    """Asleep for nine tenths: other work can only add to it, and its own running is a tenth at most."""
    idle, many = time_side_by_side(
        [
            Contender(spinning(0.01, 0.1), many_queries(10)),
            Contender(spinning(0.01, 0.1), many_queries(10), threads=2),
        ],
        repeats=5,
        warm_up=1,
    )
    assert 0.85 < idle.waited < 1.0
    assert math.isnan(many.waited)


def of(*shares):
    return [Record(method=f"m{k}").of("waited", share, 20) for k, share in enumerate(shares)]


def test_the_median_over_methods_is_said():
    assert waited(of(0.0, 0.25, 0.9)) == 0.25
    (sentence,) = waiting(of(0.0, 0.25, 0.9))
    assert "25.0 % of the time" in sentence and "too long" in sentence
    (sentence,) = waiting(of(0.001))
    assert "0.1 % of the time" in sentence and "too long" not in sentence
    assert waiting([]) == [] and math.isnan(waited([]))


@pytest.mark.parametrize(("a", "b", "said"), [(0.0, 0.0, ""), (0.0, 0.3, "B waited 30 %"), (0.4, 0.3, "A waited 40 %")])
def test_a_comparison_warns_of_busy_machines_alone(a, b, said):
    sentences = busy(of(a), of(b))
    assert len(sentences) == bool(said)
    assert all(said in sentence for sentence in sentences)
    assert busy(of(QUIET), []) and busy([], []) == []
