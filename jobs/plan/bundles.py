"""Bundles: short shards go to a worker several at a time, because dask takes a millisecond to hand over one task."""

from __future__ import annotations

from typing import Final

from jobs.plan.task import Task

SECONDS: Final = 0.1
"""Time that a bundle should take."""

MOST_SECONDS: Final = 0.5
"""Time after which a worker gives the rest of a bundle back."""

_SHORT: Final = 0.05  # seconds; a task that takes longer goes alone
_MOST: Final = 64  # tasks of a bundle
_WEIGHT: Final = 0.1  # of the last task in the mean time


class Bundles:
    """How many tasks go to a worker at once, by the time that the last ones took."""

    def __init__(self) -> None:
        self._mean = 1.0  # seconds; no bundle before some thirty tasks have been short

    def ended(self, task: Task, seconds: float) -> None:
        """Take the time of a task that is done."""
        if self.allows(task):
            self._mean += _WEIGHT * (seconds - self._mean)

    @property
    def size(self) -> int:
        """Tasks of a bundle; 1 while tasks are not short."""
        return 1 if self._mean > _SHORT else min(_MOST, int(SECONDS / max(self._mean, SECONDS / _MOST)))

    @staticmethod
    def allows(task: Task) -> bool:
        """Return whether a task may be in a bundle: a shard, which needs nothing that another task has made."""
        return task.stage == "generate" and not task.needs and not task.reads
