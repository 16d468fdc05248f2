"""Estimate: how long tasks take on this machine, from the costs that they state and the times that others took."""

from __future__ import annotations

import math
import time
from collections import defaultdict
from collections.abc import Mapping, Sequence
from typing import Final

from jobs.plan.schedule import schedule
from jobs.plan.task import Task

# Seconds of work that count as much as what is assumed before: of everything, of a stage, of a kind. Short tasks, whose
# cost is less than what any task takes, say nothing about long ones.
_WEIGHTS: Final = (10.0, 10.0, 0.5)
_LEAST_SHARE: Final = 0.05  # of a task under way, from which its own speed is known
_MOST_LOAD: Final = 0.02  # of the driver's time that goes into estimates
_SECONDS_BETWEEN: Final = 1.0  # two estimates


class Estimate:
    """Seconds that tasks take.

    What finished tasks took is compared with their cost, by kind, by stage and overall. A kind of which little was done
    is assumed to be as its stage, and a stage as everything. Before anything was done a cost is taken as it is.
    """

    def __init__(self) -> None:
        self._sums: dict[str, list[float]] = defaultdict(lambda: [0.0, 0.0])  # seconds and costs, by kind
        self._end = self._next = -math.inf  # of the run, as last estimated; when the next estimate is due

    def learn(self, task: Task, seconds: float) -> None:
        """Take the time of a finished task."""
        for kind in _kinds(task):
            self._sums[kind][0] += seconds
            self._sums[kind][1] += task.cost

    def seconds(self, task: Task) -> float:
        """Return how long a task takes on one worker."""
        ratio = 1.0
        for kind, weight in zip(_kinds(task), _WEIGHTS, strict=True):
            seconds, cost = self._sums.get(kind, (0.0, 0.0))
            ratio = (seconds + ratio * weight) / (cost + weight)
        return ratio * task.cost

    def seconds_left(self, tasks: Sequence[Task], under_way: Mapping[str, tuple[float, float]], workers: int) -> float:
        """Return how long a run goes on, by a simulation of its schedule, which is renewed now and then.

        Parameters
        ----------
        tasks : sequence of Task
            The tasks that have not ended, each after those it needs.
        under_way : mapping
            Of those that have begun the time of the beginning, by `time.monotonic`, and the finished share; by id.
        workers : int
            Number of workers.
        """
        now = time.monotonic()
        if not tasks:
            return 0.0
        if now >= self._next:
            seconds = {task.id: self.seconds(task) for task in tasks}
            for id, (began, share) in under_way.items():
                if id in seconds:
                    seconds[id] = _rest(seconds[id], now - began, share)
            self._end = now + schedule(tasks, seconds, max(1, workers)).makespan
            self._next = now + max(_SECONDS_BETWEEN, (time.monotonic() - now) / _MOST_LOAD)
        return max(0.0, self._end - now)


def _rest(seconds: float, elapsed: float, share: float) -> float:
    """Return how long a task under way goes on; `seconds` is the estimate of the whole."""
    if share >= _LEAST_SHARE:
        return elapsed * (1 - share) / share
    return max(seconds - elapsed, 0.1 * elapsed)


def _kinds(task: Task) -> tuple[str, str, str]:
    """Return the names under which times are collected, the narrowest last."""
    return "", task.stage, f"{task.stage} {task.group}"
