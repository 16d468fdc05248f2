"""Progress of a run as events, each with the numbers of its tasks, and a word when nothing is reported.

How they are shown is the matter of `jobs.run.progress_forms`.
"""

from __future__ import annotations

import math
import time
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence
from threading import Lock
from typing import Any, Final, Literal, NamedTuple

from jobs.plan.schedule import Estimate
from jobs.plan.task import Stage, Task
from pipeline import patience

_SILENCE: Final = 60.0  # seconds without a report until the first line says so
_MOST_NAMED: Final = 5  # tasks in that line

EventName = Literal["compile", "start", "begin", "progress", "end", "failed", "again", "message", "stop"]
"""Kernels are ready; the tasks start; a task begins, advances, ends, failed, or failed and is tried again; a sentence;
the end, also if the tasks never began."""


class Event(NamedTuple):
    """Something that happened in a run."""

    name: EventName
    task: Task | None = None
    share: float | None = None  # finished share of the task
    message: str | None = None  # reason of a failure, or a sentence


class Board:
    """The tasks of a run as they begin, advance and end, in numbers; a context manager that ends what is shown.

    Work is measured by what each task is expected to cost, in seconds on one core; the estimate learns how long tasks
    take. `show` receives each event with the numbers after it, from threads of the driver and of its dask client.
    """

    def __init__(self, tasks: Sequence[Task], estimate: Estimate, show: Callable[[Event, Board], None]) -> None:
        self.planned: Counter[Stage] = Counter()
        self.ended: Counter[Stage] = Counter()  # tasks by stage, done or failed
        self.failed: Counter[Stage] = Counter()
        self.work: defaultdict[Stage, float] = defaultdict(float)  # expected cost of what is done, by stage
        self.all_work: defaultdict[Stage, float] = defaultdict(float)  # expected cost of everything, by stage
        self.workers = 0
        self.dashboard: str | None = None
        self._estimate, self._show = estimate, show
        self._left: dict[str, Task] = {}
        self._under_way: dict[str, tuple[float, float]] = {}  # begin and finished share, by id
        self._began: float | None = None
        self._kernels: set[str] = set()
        self._heard, self._silence = time.monotonic(), _SILENCE
        self._said: dict[str, float] = {}  # when each sentence was last said
        self._lock = Lock()
        for task in tasks:
            self.add(task)

    def __enter__(self) -> Board:
        patience.tell(self.say_once)
        return self

    def __exit__(self, *error: object) -> None:
        patience.tell(None)
        self._show(Event("stop"), self)

    @property
    def rate(self) -> float:
        """Tasks that ended, a second."""
        began = math.inf if self._began is None else self._began
        return self.ended.total() / max(time.monotonic() - began, 1e-3)

    @property
    def seconds_left(self) -> float | None:
        """Time that the rest takes on these workers, as far as is known; None before the tasks start."""
        if self._began is None:
            return None
        return self._estimate.seconds_left(list(self._left.values()), dict(self._under_way), self.workers)

    def add(self, task: Task) -> None:
        """Count a task to do, also one that was done before and is made again."""
        self.planned[task.stage] += 1
        self.all_work[task.stage] += task.cost
        self.work.setdefault(task.stage, 0.0)
        self._left[task.id] = task

    def start(self, workers: int, dashboard: str | None) -> None:
        """Start the clock and show the start of the tasks."""
        self._began, self.workers, self.dashboard = time.monotonic(), workers, dashboard
        self._show(Event("start"), self)

    def compiling(self, done: int, groups: int, under_way: Iterable[str]) -> None:
        """Show how many groups of kernels are compiled, and which are under way."""
        now = "" if done == groups else f"; now {', '.join(under_way)}"
        kernels = f"{len(self._kernels)} ready, {done} of {groups} groups done"
        self._show(Event("compile", message=f"compiling kernels: {kernels}{now}"), self)

    def say(self, sentence: str) -> None:
        """Show a sentence about the run."""
        self._show(Event("message", message=sentence), self)

    def say_once(self, sentence: str) -> None:
        """Show a sentence that several processes may say, unless it was said in the last minute."""
        self._reported()
        with self._lock:
            now = time.monotonic()
            new, self._said[sentence] = now - self._said.get(sentence, -math.inf) >= _SILENCE, now
        if new:
            self.say(sentence)

    def hear(self, message: Mapping[str, Any]) -> None:
        """Take a message of a worker (`jobs.run.crew`)."""
        self._reported()
        if "sentence" in message:
            self.say_once(message["sentence"])
        elif "kernel" in message:
            self._kernels.add(message["kernel"])
        elif (task := self._left.get(message["task"])) and task.id in self._under_way:
            share = min(1.0, message["share"])
            self._advance(task, share)
            self._show(Event("progress", task, share), self)

    def begin(self, task: Task) -> None:
        """Show that a task begins."""
        self._reported()
        self._advance(task, 0.0)
        self._show(Event("begin", task), self)

    def end(self, task: Task, reason: str = "", *, seconds: float = 0.0, again: bool = False) -> None:
        """Count a task as done in some seconds, or as failed for a reason; `again`: it is tried once more."""
        self._reported()
        self._advance(task, 0.0 if again else 1.0)
        self._under_way.pop(task.id)
        if not again:
            self.ended[task.stage] += 1
            self.failed[task.stage] += bool(reason)
            self._left.pop(task.id, None)
        if not reason:
            self._estimate.learn(task, seconds)
        self._show(Event("again" if again else "failed" if reason else "end", task, message=reason or None), self)

    def waiting_for(self, tasks: Iterable[Task]) -> None:
        """Name the tasks under way when nothing was reported for a minute, and again after 2, 4, … minutes."""
        silence = time.monotonic() - self._heard
        if silence < self._silence:
            return
        self._silence *= 2
        names = [f"{task.stage} {task.title}" for task in tasks]
        more = f" and {len(names) - _MOST_NAMED} more" if len(names) > _MOST_NAMED else ""
        counts = {0: "no worker: the scheduler has none", 1: "1 process"}
        where = counts.get(self.workers, f"{self.workers} workers")
        self.say(f"nothing reported for {silence:.0f} s; under way: {', '.join(names[:_MOST_NAMED])}{more} ({where})")

    def _advance(self, task: Task, share: float) -> None:
        with self._lock:
            began, before = self._under_way.get(task.id, (0.0, 0.0))
            self._under_way[task.id] = began if share else time.monotonic(), share  # it may have waited at its worker
            self.work[task.stage] += task.cost * (share - before)

    def _reported(self) -> None:
        self._heard, self._silence = time.monotonic(), _SILENCE
