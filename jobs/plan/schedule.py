"""How long tasks take on this machine, and a plan on some workers.

Times of tasks follow from the costs that they state and the times that others took. A schedule is simulated with the
rule by which a run starts its tasks.
"""

from __future__ import annotations

import heapq
import math
import time
from collections import defaultdict
from collections.abc import Mapping, Sequence
from typing import Final, NamedTuple

from jobs.plan.ready import Ready
from jobs.plan.task import Task

LEAST_GAIN: Final = 0.05  # share of the time that twice the workers must save; else the plan has stopped scaling

# Seconds of work that count as much as what is assumed before: of everything, of a stage, of a kind. The first tasks of
# a run, which load kernels and are short, say little about other stages.
_WEIGHTS: Final = (60.0, 10.0, 0.5)
_SURE_SHARE: Final = 0.2  # of a task under way, from which its own speed alone counts
_LONGER: Final = 0.5  # a task that takes longer than estimated goes on for this share of its time
_MOST_LOAD: Final = 0.02  # of the driver's time that goes into estimates
_SHORTEST: Final = 1e-3  # seconds of a task, at least
_SECONDS_BETWEEN: Final = 1.0  # two estimates


class Schedule(NamedTuple):
    """A simulated run."""

    workers: int
    makespan: float  # seconds from the first start to the last end
    work: float  # seconds of all tasks
    tail: float  # seconds at the end in which not all workers are busy: the straggler tail

    @classmethod
    def of(cls, tasks: Sequence[Task], seconds: Mapping[str, float], workers: int) -> Schedule:
        """Simulate a run on workers with one task at a time each; needs outside the tasks count as done."""
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
                return cls(workers, now, sum(seconds[task.id] for task in tasks), now - full)
            if len(running) == workers:
                full = running[0][0]  # all are busy until the first ends
            now, _, ended = heapq.heappop(running)
            ready.finish(ended)

    @property
    def efficiency(self) -> float:
        """Share of the workers' time in which they are busy."""
        return self.work / (self.makespan * self.workers) if self.makespan else 1.0


def doublings(tasks: Sequence[Task], seconds: Mapping[str, float]) -> list[Schedule]:
    """Return the schedules of 1, 2, 4, … workers, up to the first number that stops scaling."""
    schedules = [Schedule.of(tasks, seconds, 1)]
    while schedules[-1].makespan > 0 and schedules[-1].workers < len(tasks):
        schedules.append(Schedule.of(tasks, seconds, 2 * schedules[-1].workers))
        if schedules[-1].makespan > (1 - LEAST_GAIN) * schedules[-2].makespan:
            break
    return schedules


class Estimate:
    """Seconds that tasks take.

    What finished tasks took is compared with their cost, by kind, by stage and overall. A kind of which little was done
    is assumed to be as its stage, and a stage as everything. Before anything was done a cost is taken as it is. Means
    are geometric: a short task that waited for its kernels, or a wrong cost of one kind, moves no other by much.
    """

    def __init__(self) -> None:
        # By kind: costs, and costs times logarithms of ratios.
        self._sums: dict[str, list[float]] = defaultdict(lambda: [0.0, 0.0])
        self._end = self._next = -math.inf  # of the run, as last estimated; when the next estimate is due

    def learn(self, task: Task, seconds: float) -> None:
        """Take the time of a finished task."""
        for kind in _kinds(task):
            self._sums[kind][0] += task.cost
            self._sums[kind][1] += task.cost * math.log(max(seconds, _SHORTEST) / task.cost)

    def seconds(self, task: Task) -> float:
        """Return how long a task takes on one worker."""
        ratio = 0.0  # its logarithm
        for kind, weight in zip(_kinds(task), _WEIGHTS, strict=True):
            cost, ratios = self._sums.get(kind, (0.0, 0.0))
            ratio = (ratios + ratio * weight) / (cost + weight)
        return math.exp(ratio) * task.cost

    def seconds_left(self, tasks: Sequence[Task], under_way: Mapping[str, tuple[float, float]], workers: int) -> float:
        """Return how long a run goes on, by a simulation of its schedule, which is renewed now and then.

        `tasks` have not ended, and each comes after those it needs. `under_way` has, by their ids, when tasks began (by
        `time.monotonic`) and the finished share.
        """
        now = time.monotonic()
        if not tasks:
            return 0.0
        if now >= self._next:
            seconds = {task.id: self.seconds(task) for task in tasks}
            for id, (began, share) in under_way.items():
                if id in seconds:
                    seconds[id] = _rest(seconds[id], now - began, share)
            self._end = now + Schedule.of(tasks, seconds, max(1, workers)).makespan
            self._next = now + max(_SECONDS_BETWEEN, (time.monotonic() - now) / _MOST_LOAD)
        return max(0.0, self._end - now)


def _rest(seconds: float, elapsed: float, share: float) -> float:
    """Return how long a task under way goes on; `seconds` is the estimate of the whole."""
    if share == 0.0:
        return max(seconds - elapsed, _LONGER * elapsed)
    sure = min(share / _SURE_SHARE, 1.0) ** 2
    return (1.0 - share) * (sure * elapsed / share + (1.0 - sure) * max(seconds, elapsed))


def _kinds(task: Task) -> tuple[str, str, str]:
    """Return the names under which times are collected, the narrowest last."""
    return "", task.stage, f"{task.stage} {task.group}"
