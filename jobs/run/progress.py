"""Progress of a run: numbers of tasks by stage, rate and time left, and a word when nothing is reported.

How they are shown is the matter of `jobs.run.progress_forms`.
"""

from __future__ import annotations

import math
import time
from collections import Counter
from collections.abc import Iterable, Sequence
from threading import Lock
from types import TracebackType
from typing import Any, Final, Protocol

from rich.console import Console

from jobs.plan.task import STAGES, Stage, Task
from pipeline import patience

TOPIC: Final = "progress"
"""Dask topic on which workers report the progress of a task, {"task": id, "fraction": share done}, or a sentence."""

KERNELS: Final = "kernels"
"""Dask topic on which workers name each kernel that is compiled or read from the cache."""

LOOK: Final = 5.0
"""Seconds between two looks at how long nothing was reported."""

_SILENCE: Final = 60.0  # seconds without a report until the first line says so
_MOST_NAMED: Final = 5  # tasks in that line


class Tally:
    """Numbers of a run. Work is measured by what each task is expected to cost, in seconds on one core.

    Parameters
    ----------
    tasks : sequence of Task
        The tasks to do.
    """

    def __init__(self, tasks: Sequence[Task]) -> None:
        self.planned: Counter[Stage] = Counter()
        self.ended: Counter[Stage] = Counter()
        """Tasks by stage, done or failed."""
        self.failed: Counter[Stage] = Counter()
        stages = {task.stage for task in tasks}
        self.work = {stage: 0.0 for stage in STAGES if stage in stages}
        """Expected cost of what is done, by stage."""
        self.all_work = dict(self.work)
        """Expected cost of everything, by stage."""
        for task in tasks:
            self.add(task)
        self.workers = 0
        self.dashboard: str | None = None
        self._began = time.monotonic()

    def add(self, task: Task) -> None:
        """Count a task to do."""
        self.planned[task.stage] += 1
        self.all_work[task.stage] = self.all_work.get(task.stage, 0.0) + task.cost
        self.work.setdefault(task.stage, 0.0)

    def begin(self) -> None:
        """Start the clock."""
        self._began = time.monotonic()

    @property
    def seconds(self) -> float:
        """Seconds since the run began."""
        return time.monotonic() - self._began

    @property
    def rate(self) -> float:
        """Tasks that ended, a second."""
        return self.ended.total() / max(self.seconds, 1e-3)

    @property
    def seconds_left(self) -> float | None:
        """Time that the rest takes if the work goes on as fast as so far; None before any was done."""
        if self.ended == self.planned:
            return 0.0
        done = sum(self.work.values())
        return self.seconds * max(0.0, sum(self.all_work.values()) - done) / done if done > 0 else None


class Form(Protocol):
    """A way to show progress. Calls come from the driver's thread and from that of its dask client."""

    def __init__(self, console: Console) -> None:
        """Show it on this console."""

    def compiling(self, tally: Tally, done: int, total: int, kernels: int, under_way: Sequence[str]) -> None:
        """Show how many groups of kernels are compiled, and which are under way; `done` equals `total` at the end."""

    def begin(self, tally: Tally) -> None:
        """Show the start of the tasks."""

    def task(self, event: str, tally: Tally, task: Task, reason: str = "") -> None:
        """Show that a task has begun (``begin``), ended (``end``), ``failed`` or is tried ``again``."""

    def advance(self, tally: Tally, task: Task, share: float) -> None:
        """Show the finished share of a task under way."""

    def say(self, tally: Tally, sentence: str) -> None:
        """Show a sentence about the run."""

    def end(self, tally: Tally) -> None:
        """Show the end of the run, also if it was stopped or never began."""


class Compiling:
    """Numbers of kernels that are compiled before the tasks start."""

    def __init__(self, groups: int, form: Form, tally: Tally) -> None:
        self._form, self._tally = form, tally
        self._total, self._ended = groups, 0
        self._under_way: list[str] = []
        self._ready: set[str] = set()

    def begin(self, group: str) -> None:
        """Show that a group of kernels is being compiled."""
        self._under_way.append(group)
        self._show()

    def hear(self, event: tuple[float, Any]) -> None:
        """Take the name of a kernel that is ready."""
        self._ready.add(event[1])
        self._show()

    def end(self, group: str) -> None:
        """Count a group as compiled."""
        self._ended += 1
        self._under_way.remove(group)
        self._show()

    def _show(self) -> None:
        self._form.compiling(self._tally, self._ended, self._total, len(self._ready), list(self._under_way))


class Board:
    """The tasks of a run as they begin, advance and end; a context manager that ends what is shown.

    Shares of tasks may arrive from another thread than the driver's.
    """

    def __init__(self, tasks: Sequence[Task], form: Form) -> None:
        self.tally = Tally(tasks)
        self._form = form
        self._tasks = {task.id: task for task in tasks}
        self._shares: dict[str, float] = {}  # of the tasks under way
        self._heard, self._silence = time.monotonic(), _SILENCE
        self._said: dict[str, float] = {}  # when each sentence was last said
        self._lock = Lock()

    def __enter__(self) -> Board:
        patience.tell(self.say_once)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        patience.tell(None)
        self._form.end(self.tally)

    def start(self, workers: int, dashboard: str | None) -> None:
        """Show the start of the tasks, and start the clock."""
        self.tally.workers, self.tally.dashboard = workers, dashboard
        self.tally.begin()
        self._form.begin(self.tally)

    def compiling(self, groups: int) -> Compiling:
        """Return what shows that groups of kernels are compiled before the tasks start."""
        return Compiling(groups, self._form, self.tally)

    def say(self, sentence: str) -> None:
        """Show a sentence about the run."""
        self._form.say(self.tally, sentence)

    def say_once(self, sentence: str) -> None:
        """Show a sentence that several processes may say, unless it was said in the last minute."""
        self._reported()
        with self._lock:
            now = time.monotonic()
            new, self._said[sentence] = now - self._said.get(sentence, -math.inf) >= _SILENCE, now
        if new:
            self.say(sentence)

    def add(self, task: Task) -> None:
        """Add a task that was done before and is made again."""
        self._tasks[task.id] = task
        self.tally.add(task)
        self._form.advance(self.tally, task, 0.0)

    def begin(self, task: Task) -> None:
        """Show that a task begins."""
        self._reported()
        self._shares[task.id] = 0.0
        self._form.task("begin", self.tally, task)

    def hear(self, event: tuple[float, Any]) -> None:
        """Take a message of a worker: about a task under way, or a sentence."""
        _, message = event
        if "sentence" in message:
            self.say_once(message["sentence"])
            return
        self.advance(message["task"], float(message["fraction"]))

    def advance(self, id: str, share: float) -> None:
        """Show the finished share of a task under way."""
        self._reported()
        if id in self._shares:
            task = self._tasks[id]
            self._count(task, min(1.0, share))
            self._form.advance(self.tally, task, share)

    def again(self, task: Task, reason: str) -> None:
        """Show that a task failed and is tried again."""
        self._reported()
        self._count(task, 0.0)
        self._shares.pop(task.id, None)
        self._form.task("again", self.tally, task, reason)

    def end(self, task: Task, reason: str = "") -> None:
        """Count a task as done, or as failed for a reason."""
        self._reported()
        self._count(task, 1.0)
        self._shares.pop(task.id, None)
        self.tally.ended[task.stage] += 1
        self.tally.failed[task.stage] += bool(reason)
        self._form.task("failed" if reason else "end", self.tally, task, reason)

    def waiting_for(self, tasks: Iterable[Task], workers: int) -> None:
        """Name the tasks under way when nothing was reported for a minute, and again after 2, 4, … minutes."""
        silence = time.monotonic() - self._heard
        if silence < self._silence:
            return
        self._silence *= 2
        names = [f"{task.stage} {task.title}" for task in tasks]
        more = f" and {len(names) - _MOST_NAMED} more" if len(names) > _MOST_NAMED else ""
        titles = ", ".join(names[:_MOST_NAMED]) + more
        where = f"{workers} workers" if workers > 1 else "1 process" if workers else "no worker: the scheduler has none"
        self.say(f"nothing reported for {silence:.0f} s; under way: {titles} ({where})")

    def _reported(self) -> None:
        self._heard, self._silence = time.monotonic(), _SILENCE

    def _count(self, task: Task, share: float) -> None:
        self.tally.work[task.stage] += task.cost * (share - self._shares.get(task.id, 0.0))
        self._shares[task.id] = share
