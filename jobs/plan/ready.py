"""Ready tasks: those whose needs are done, most urgent first, in constant time a task and need.

The driver of a run and the simulated schedule of a plan hand tasks out by the same rule.
"""

import heapq
import math
from collections.abc import Iterable, Mapping, Sequence

from jobs.plan.task import Task


def chains(tasks: Sequence[Task], seconds: Mapping[str, float]) -> dict[str, float]:
    """Return for each task the seconds of the longest chain of tasks that starts with it, from those of each task.

    Taking the longest chain first is the classical list schedule [Graham1969Bounds]. The longest of all is the time
    that no number of workers beats.
    """
    after = dict.fromkeys((task.id for task in tasks), 0.0)
    chain = {}
    for task in reversed(tasks):  # a plan lists every task after those it needs
        chain[task.id] = seconds[task.id] + after[task.id]
        for need in after.keys() & set(task.needs):
            after[need] = max(after[need], chain[task.id])
    return chain


class Ready:
    """The tasks of a run that are not done: a heap of those that can start, and the number of unmet needs of each.

    They come each after those it needs; a need that is neither among them nor `finished` is never met.
    """

    def __init__(self, tasks: Sequence[Task], finished: Iterable[str]) -> None:
        self._done = set(finished)
        self._order = {id: -chain for id, chain in chains(tasks, {task.id: task.cost for task in tasks}).items()}
        self._waiting: dict[str, Task] = {}
        self._unmet: dict[str, int] = {}  # of every task that has ever waited; right for those that wait
        self._after: dict[str, list[str]] = {}
        # Entries of tasks that have started, or wait again for a need, are skipped when they come up.
        self._beside: list[tuple[float, int, Task]] = []
        self._alone: list[tuple[float, int, Task]] = []
        self._pushed = 0
        self._running: dict[str, Task] = {}
        self._one_alone = ""  # the last task that was started alone
        for task in tasks:
            self._wait(task)

    def take(self, slots: int, alone: bool = True) -> list[Task]:
        """Return the tasks to start now: one for each free slot, and one that must be alone only when nothing runs.

        Not `alone`: only tasks that run beside others.
        """
        taken: list[Task] = []
        if self._one_alone in self._running:
            return taken
        while len(self._running) < slots and (task := self._pop(self._beside)):
            taken.append(task)
        if alone and slots > 0 and not self._running and (task := self._pop(self._alone)):
            taken.append(task)
            self._one_alone = task.id
        return taken

    def free(self, task: Task) -> None:
        """Note that a started task has ended, so that its slot is free; what needs a task that failed stays waiting."""
        self._running.pop(task.id, None)

    def finish(self, task: Task) -> None:
        """Note that a started task is done; what waited for it alone is now ready."""
        self.free(task)
        self._done.add(task.id)
        for id in self._after.get(task.id, ()):
            if id in self._waiting:
                self._unmet[id] -= 1
                if not self._unmet[id]:
                    self._push(self._waiting[id])

    def again(self, task: Task) -> None:
        """Put a started task back, to be started once more when its needs are done."""
        self.free(task)
        self._wait(task)

    def reopen(self, task: Task) -> None:
        """Take a task that was done as not done; it comes first."""
        self._done.discard(task.id)
        for id in self._after.get(task.id, ()):
            if id in self._waiting:
                self._unmet[id] += 1
        self._order[task.id] = -math.inf
        self._wait(task)

    def lose(self, task: Task) -> None:
        """Take a task that was done as not done, and never do it; what needs it stays waiting."""
        self.reopen(task)
        del self._waiting[task.id]

    @property
    def running(self) -> list[Task]:
        """Tasks that were started and have not ended."""
        return list(self._running.values())

    @property
    def waiting(self) -> list[Task]:
        """Tasks that are to be started."""
        return list(self._waiting.values())

    def _wait(self, task: Task) -> None:
        needs = set(task.needs)
        if task.id not in self._unmet:
            for need in needs:
                self._after.setdefault(need, []).append(task.id)
        self._waiting[task.id] = task
        self._unmet[task.id] = sum(need not in self._done for need in needs)
        if not self._unmet[task.id]:
            self._push(task)

    def _push(self, task: Task) -> None:
        self._pushed += 1  # equally urgent tasks start in the order in which they became ready
        heapq.heappush(self._alone if task.slots == "all" else self._beside, (self._order[task.id], self._pushed, task))

    def _pop(self, heap: list[tuple[float, int, Task]]) -> Task | None:
        """Start the most urgent task of a heap that can start."""
        while heap:
            _, _, task = heapq.heappop(heap)
            if task.id in self._waiting and not self._unmet[task.id]:
                self._running[task.id] = self._waiting.pop(task.id)
                return task
        return None
