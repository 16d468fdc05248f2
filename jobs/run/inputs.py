"""Inputs of a task: the products of the tasks that it needs, compared with their receipts before it starts.

The state of a task follows from sizes alone (`jobs.run.ledger`); its bytes are read here, once in a run, and only if a
task that is not done needs them. Products that this run has made were measured when they were made.
"""

from __future__ import annotations

from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from jobs.plan.task import Task
from jobs.run.ledger import Ledger
from pipeline.storage import is_local


class Inputs:
    """Which products of a plan are known to be sound."""

    def __init__(self, tasks: Iterable[Task], ledger: Ledger) -> None:
        self._tasks = {task.id: task for task in tasks}
        self._ledger = ledger
        self._sound: set[str] = set()

    def hashes(self, task: Task) -> dict[str, str]:
        """Return the hashes of the products that a task needs, by path, for workers that fetch them."""
        if is_local(self._ledger.out):
            return {}
        found = dict(task.reads)
        for need in (self._tasks[need] for need in task.needs if need in self._tasks):
            files = self._ledger.products(need)
            found |= {path: files[Path(path).name].sha256 for path in need.products if Path(path).name in files}
        return found

    def made(self, task: Task) -> None:
        """Note that the products of a task were just measured."""
        self._sound.add(task.id)

    def damaged(self, task: Task, anew: bool = False) -> list[Task]:
        """Return the tasks needed by a task whose products are damaged, and remove these products.

        Parameters
        ----------
        task : Task
            The task that is about to start, or that has failed.
        anew : bool
            Read also products that this run has read or made before.
        """
        needs = [self._tasks[need] for need in task.needs if need in self._tasks]
        unread = [need for need in needs if anew or need.id not in self._sound]
        if not unread or not (anew or is_local(self._ledger.out)):  # who fetches a file compares it
            return []
        with ThreadPoolExecutor() as pool:
            removed = list(pool.map(self._ledger.discard, unread))
        damaged = [
            need for need, paths in zip(unread, removed, strict=True) if not set(paths).isdisjoint(need.products)
        ]
        self._sound.update(need.id for need in unread)
        self._sound.difference_update(need.id for need in damaged)
        return damaged
