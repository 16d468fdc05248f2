import time
from typing import ClassVar

import pytest

from jobs.plan.ready import chains
from jobs.plan.schedule import Estimate, Schedule, doublings
from tests.jobs.fake_stages import task
from tests.jobs.plan.test_ready import Alone, Step


def of(tasks, seconds):
    return {task.id: value for task, value in zip(tasks, seconds, strict=True)}


@pytest.mark.parametrize(
    ("workers", "makespan", "tail"), [(1, 12.0, 0.0), (3, 4.0, 0.0), (5, 3.0, 1.0), (24, 1.0, 1.0)]
)
def test_equal_tasks_take_the_rounded_number_of_turns(workers, makespan, tail):
    tasks = [Step(name=str(index)) for index in range(12)]
    found = Schedule.of(tasks, of(tasks, [1.0] * 12), workers)
    assert (found.makespan, found.tail, found.work) == (makespan, tail, 12.0)
    assert found.efficiency == pytest.approx(12 / (workers * makespan))


def shards_and_net(count, length):
    """Return so many shards of a second, what needs them, and their seconds."""
    shards = [Step(name=str(index)) for index in range(count)]
    tasks = [*shards, Step(name="net", after=tuple(shard.id for shard in shards))]
    return tasks, of(tasks, [1.0] * count + [length])


def test_a_long_task_and_the_longest_chain_count_and_doubling_ends_where_it_saves_little():
    tasks, seconds = shards_and_net(8, 10.0)
    found = Schedule.of(tasks, seconds, 4)
    assert (found.makespan, found.tail) == (12.0, 10.0) and max(chains(tasks, seconds).values()) == 11.0
    assert Schedule.of(tasks[-1:], seconds, 4).makespan == 10.0  # what it needs is done
    tasks = [Step(name="a"), Step(name="b"), Alone(name="c"), Alone(name="d")]
    assert Schedule.of(tasks, of(tasks, [1.0, 1.0, 5.0, 5.0]), 8).makespan == 11.0
    # The last saves 3.7 %.
    found = doublings(*shards_and_net(64, 100.0))
    assert [one.makespan for one in found] == [164.0, 132.0, 116.0, 108.0, 104.0]
    (nothing,) = doublings([], {})
    assert nothing.makespan == nothing.tail == 0.0 and nothing.efficiency == 1.0
    a, b = costly("a", 10.0), costly("b", 10.0)
    c = costly("c", 10.0, [a])
    whole = 10.0
    for workers, lengths in ((1, 3), (2, 2), (9, 2)):
        assert Estimate().seconds_left([a, b, c], {}, workers) == pytest.approx(lengths * whole)
    assert Estimate().seconds_left([], {}, 1) == 0.0


class Costly(Step):
    stage: ClassVar = "train"
    kind: ClassVar = "costly"

    @property
    def group(self):
        return self.name.split()[0]


def costly(name, seconds, needs=()):
    return task(name, Costly, needs, seconds=seconds)


def test_a_kind_takes_what_its_tasks_took_others_what_their_stage_took_and_one_wrong_cost_moves_little():
    estimate, first, other = Estimate(), costly("a 1", 100.0), costly("b 1", 100.0)
    assert estimate.seconds(first) == 100.0
    for _ in range(20):
        estimate.learn(first, 700.0)
    assert estimate.seconds(costly("a 2", 50.0)) == pytest.approx(350.0, rel=0.02)
    assert estimate.seconds(other) == pytest.approx(700.0, rel=0.02)
    for _ in range(2):
        estimate.learn(other, 100.0)
    assert estimate.seconds(other) == pytest.approx(100.0, rel=0.02)
    # A second that took ten minutes, among tasks that took what they cost.
    estimate = Estimate()
    for number in range(10):
        estimate.learn(costly(f"a {number}", 5.0), 5.0)
    estimate.learn(costly("odd 1", 1.0), 600.0)
    assert estimate.seconds(costly("a 11", 100.0)) == pytest.approx(100.0, rel=0.01)
    assert estimate.seconds(costly("b 1", 100.0)) == pytest.approx(100.0, rel=0.15)


@pytest.mark.parametrize(
    ("elapsed", "share", "left"), [(30.0, 0.75, 10.0), (10.0, 0.0, 90.0), (200.0, 0.0, 100.0), (60.0, 0.01, 113.6)]
)
def test_a_task_under_way_is_judged_by_its_share_when_that_is_sure(elapsed, share, left):
    """One that takes longer than estimated goes on; a first share, which includes its start, says little."""
    a = costly("a", 100.0)
    assert Estimate().seconds_left([a], {a.id: (time.monotonic() - elapsed, share)}, 1) == pytest.approx(left, rel=0.01)
