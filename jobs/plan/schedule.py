"""Schedule: how long a plan takes on some workers, simulated with the rule by which a run starts its tasks."""

from __future__ import annotations

import heapq
from collections.abc import Mapping, Sequence
from typing import Final, NamedTuple

from jobs.plan.ready import Ready
from jobs.plan.task import Task

LEAST_GAIN: Final = 0.05
"""Share of the time that twice the workers must save; else the plan has stopped scaling."""


class Schedule(NamedTuple):
    """A simulated run.

    Attributes
    ----------
    workers : int
        Number of workers.
    makespan : float
        Seconds from the first start to the last end.
    work : float
        Seconds of all tasks.
    tail : float
        Seconds at the end in which not all workers are busy: the straggler tail.
    """

    workers: int
    makespan: float
    work: float
    tail: float

    @property
    def efficiency(self) -> float:
        """Share of the workers' time in which they are busy."""
        return self.work / (self.makespan * self.workers) if self.makespan else 1.0


def schedule(tasks: Sequence[Task], seconds: Mapping[str, float], workers: int) -> Schedule:
    """Simulate a run.

    Parameters
    ----------
    tasks : sequence of Task
        The tasks to do; needs outside them count as done.
    seconds : mapping
        Duration of each task, by its id.
    workers : int
        Number of workers, each with one task at a time.
    """
    own = {task.id for task in tasks}
    ready = Ready(tasks, {need for task in tasks for need in task.needs if need not in own})
    running: list[tuple[float, int, Task]] = []  # with the time of its end
    now = full = 0.0
    number = 0
    while True:
        for task in ready.take(workers):
            number += 1
            heapq.heappush(running, (now + seconds[task.id], number, task))
        if not running:
            return Schedule(workers, now, sum(seconds[task.id] for task in tasks), now - full)
        if len(running) == workers:
            full = running[0][0]  # all are busy until the first ends
        now, _, ended = heapq.heappop(running)
        ready.finish(ended)


def doublings(tasks: Sequence[Task], seconds: Mapping[str, float]) -> list[Schedule]:
    """Return the schedules of 1, 2, 4, … workers, up to the first number that stops scaling."""
    found = [schedule(tasks, seconds, 1)]
    while found[-1].makespan > 0 and found[-1].workers < len(tasks):
        found.append(schedule(tasks, seconds, 2 * found[-1].workers))
        if found[-1].makespan > (1 - LEAST_GAIN) * found[-2].makespan:
            break
    return found


def longest_chain(tasks: Sequence[Task], seconds: Mapping[str, float]) -> float:
    """Return the seconds of the longest chain of tasks that need each other; no number of workers is faster."""
    end: dict[str, float] = {}
    for task in tasks:  # each after those it needs
        end[task.id] = seconds[task.id] + max((end.get(need, 0.0) for need in task.needs), default=0.0)
    return max(end.values(), default=0.0)
