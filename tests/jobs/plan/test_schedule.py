"""Schedules against closed forms."""

from typing import ClassVar

import pytest

from jobs.plan.schedule import doublings, longest_chain, schedule
from jobs.plan.task import Task


class Step(Task):
    stage: ClassVar = "generate"

    name: int
    after: tuple[str, ...] = ()

    @property
    def needs(self):
        return self.after

    def versions(self):
        return {}


class Alone(Step):
    slots: ClassVar = "all"


def of(tasks, seconds):
    return {task.id: value for task, value in zip(tasks, seconds, strict=True)}


@pytest.mark.parametrize(
    ("workers", "makespan", "tail"), [(1, 12.0, 0.0), (3, 4.0, 0.0), (5, 3.0, 1.0), (24, 1.0, 1.0)]
)
def test_equal_tasks_take_the_rounded_number_of_turns(workers, makespan, tail):
    tasks = [Step(name=index) for index in range(12)]
    found = schedule(tasks, of(tasks, [1.0] * 12), workers)
    assert (found.makespan, found.tail, found.work) == (makespan, tail, 12.0)
    assert found.efficiency == pytest.approx(12 / (workers * makespan))


def test_a_long_task_at_the_end_is_the_tail():
    shards = [Step(name=index) for index in range(8)]
    net = Step(name=9, after=tuple(shard.id for shard in shards))
    tasks = [*shards, net]
    seconds = of(tasks, [1.0] * 8 + [10.0])
    found = schedule(tasks, seconds, 4)
    assert (found.makespan, found.tail) == (12.0, 10.0)
    assert longest_chain(tasks, seconds) == 11.0
    assert schedule([net], seconds, 4).makespan == 10.0  # what it needs is done


def test_tasks_that_measure_time_run_one_by_one():
    tasks = [Step(name=0), Step(name=1), Alone(name=2), Alone(name=3)]
    assert schedule(tasks, of(tasks, [1.0, 1.0, 5.0, 5.0]), 8).makespan == 11.0


def test_doubling_ends_where_it_saves_little():
    shards = [Step(name=index) for index in range(64)]
    net = Step(name=99, after=tuple(shard.id for shard in shards))
    tasks = [*shards, net]
    found = doublings(tasks, of(tasks, [1.0] * 64 + [100.0]))
    # 164, 132, 116, 108, 104: the last saves 3.7 %.
    assert [one.makespan for one in found] == [164.0, 132.0, 116.0, 108.0, 104.0]


def test_nothing_to_do_takes_no_time():
    found = schedule([], {}, 4)
    assert found.makespan == found.tail == 0.0 and found.efficiency == 1.0
    assert len(doublings([], {})) == 1
