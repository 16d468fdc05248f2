"""Time left: learnt by kind, counted along the schedule and not by the number of tasks."""

import time
from typing import ClassVar

import pytest

from jobs.plan.estimate import Estimate
from tests.jobs.fake_stages import FakeTraining, task


class Costly(FakeTraining):
    kind: ClassVar = "costly"

    @property
    def cost(self):
        return self.seconds

    @property
    def group(self):
        return self.name.split()[0]


def costly(name, seconds, needs=()):
    return task(name, Costly, needs, seconds=seconds)


def test_a_kind_takes_what_its_tasks_took_and_others_what_their_stage_took():
    estimate, first, other = Estimate(), costly("a 1", 100.0), costly("b 1", 100.0)
    assert estimate.seconds(first) == 100.0
    for _ in range(2):
        estimate.learn(first, 700.0)
    assert estimate.seconds(costly("a 2", 50.0)) == pytest.approx(350.0, rel=0.02)
    assert estimate.seconds(other) == pytest.approx(700.0, rel=0.02)
    estimate.learn(other, 100.0)
    assert estimate.seconds(other) == pytest.approx(100.0, rel=0.02)


def test_the_longest_chain_and_the_number_of_workers_count():
    a, b = costly("a", 10.0), costly("b", 10.0)
    c = costly("c", 10.0, [a])
    whole = 10.0
    for workers, lengths in ((1, 3), (2, 2), (9, 2)):
        assert Estimate().seconds_left([a, b, c], {}, workers) == pytest.approx(lengths * whole)
    # A task that is 3/4 done after 30 s goes on for 10 s.
    began = time.monotonic() - 30.0
    assert Estimate().seconds_left([a], {a.id: (began, 0.75)}, 1) == pytest.approx(10.0, rel=0.01)
    assert Estimate().seconds_left([], {}, 1) == 0.0
