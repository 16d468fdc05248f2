"""Progress of a run as events, each with the numbers of its tasks, and a word when nothing is reported.

How they are shown is the matter of `jobs.run.progress_forms`.
"""

from __future__ import annotations

import math
import time
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from threading import Lock
from types import TracebackType
from typing import Any, Final, Literal, NamedTuple

from jobs.plan.estimate import Estimate
from jobs.plan.task import STAGES, Stage, Task
from pipeline import patience

_SILENCE: Final = 60.0  # seconds without a report until the first line says so
_MOST_NAMED: Final = 5  # tasks in that line


class Event(NamedTuple):
    """Something that happened in a run.

    Attributes
    ----------
    name : str
        ``compile``: kernels are ready; ``start`` of the tasks; ``begin`` of a task, ``progress``, ``end``, ``failed``,
        ``again``: it failed and is tried again; ``message``: a sentence; ``stop``: the end, also if it never began.
    task : Task or None
        The task that it is about.
    share : float or None
        Its finished share.
    message : str or None
        Reason of a failure, or a sentence.
    """

    name: Literal["compile", "start", "begin", "progress", "end", "failed", "again", "message", "stop"]
    task: Task | None = None
    share: float | None = None
    message: str | None = None


class Tally:
    """Numbers of a run. Work is measured by what each task is expected to cost, in seconds on one core.

    Parameters
    ----------
    tasks : sequence of Task
        The tasks to do.
    estimate : Estimate
        Knows how long they take.
    """

    def __init__(self, tasks: Sequence[Task], estimate: Estimate) -> None:
        self.planned: Counter[Stage] = Counter()
        self.ended: Counter[Stage] = Counter()
        """Tasks by stage, done or failed."""
        self.failed: Counter[Stage] = Counter()
        stages = {task.stage for task in tasks}
        self.work = {stage: 0.0 for stage in STAGES if stage in stages}
        """Expected cost of what is done, by stage."""
        self.all_work = dict(self.work)
        """Expected cost of everything, by stage."""
        self.workers = 0
        self.dashboard: str | None = None
        self._estimate = estimate
        self._left: dict[str, Task] = {}
        self._under_way: dict[str, tuple[float, float]] = {}  # begin and finished share, by id
        self._began: float | None = None
        for task in tasks:
            self.add(task)

    def add(self, task: Task) -> None:
        """Count a task to do."""
        self.planned[task.stage] += 1
        self.all_work[task.stage] = self.all_work.get(task.stage, 0.0) + task.cost
        self.work.setdefault(task.stage, 0.0)
        self._left[task.id] = task

    def start(self, workers: int, dashboard: str | None) -> None:
        """Start the clock."""
        self._began, self.workers, self.dashboard = time.monotonic(), workers, dashboard

    def advance(self, task: Task, share: float) -> None:
        """Take the finished share of a task under way."""
        began, before = self._under_way.get(task.id, (0.0, 0.0))
        self._under_way[task.id] = began if share else time.monotonic(), share  # it may have waited at its worker
        self.work[task.stage] += task.cost * (share - before)

    def end(self, task: Task, *, failed: bool = False, again: bool = False) -> None:
        """Take the end of a task; `again`: it is to be done once more."""
        self.advance(task, 0.0 if again else 1.0)
        self._under_way.pop(task.id)
        if not again:
            self.ended[task.stage] += 1
            self.failed[task.stage] += failed
            self._left.pop(task.id, None)

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


class Board:
    """The tasks of a run as they begin, advance and end; a context manager that ends what is shown.

    Parameters
    ----------
    tasks : sequence of Task
        The tasks to do.
    estimate : Estimate
        Knows how long they take.
    show : callable
        Shows an event, with the numbers after it. Calls come from the driver's thread and from that of its dask client.
    """

    def __init__(self, tasks: Sequence[Task], estimate: Estimate, show: Callable[[Event, Tally], None]) -> None:
        self.tally = Tally(tasks, estimate)
        self._show = show
        self._tasks = {task.id: task for task in tasks}
        self._under_way: set[str] = set()
        self._kernels: set[str] = set()
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
        self._emit(Event("stop"))

    def start(self, workers: int, dashboard: str | None) -> None:
        """Show the start of the tasks."""
        self.tally.start(workers, dashboard)
        self._emit(Event("start"))

    def compiling(self, done: int, groups: int, under_way: Iterable[str]) -> None:
        """Show how many groups of kernels are compiled, and which are under way."""
        now = "" if done == groups else f"; now {', '.join(under_way)}"
        kernels = f"{len(self._kernels)} ready, {done} of {groups} groups done"
        self._emit(Event("compile", message=f"compiling kernels: {kernels}{now}"))

    def say(self, sentence: str) -> None:
        """Show a sentence about the run."""
        self._emit(Event("message", message=sentence))

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
        elif message["task"] in self._under_way:
            task, share = self._tasks[message["task"]], min(1.0, message["share"])
            with self._lock:
                self.tally.advance(task, share)
            self._emit(Event("progress", task, share))

    def add(self, task: Task) -> None:
        """Add a task that was done before and is made again."""
        self._tasks[task.id] = task
        self.tally.add(task)

    def begin(self, task: Task) -> None:
        """Show that a task begins."""
        self._reported()
        self._under_way.add(task.id)
        with self._lock:
            self.tally.advance(task, 0.0)
        self._emit(Event("begin", task))

    def end(self, task: Task, reason: str = "", *, again: bool = False) -> None:
        """Count a task as done, or as failed for a reason; `again`: it is tried once more."""
        self._reported()
        self._under_way.discard(task.id)
        with self._lock:
            self.tally.end(task, failed=bool(reason), again=again)
        self._emit(Event("again" if again else "failed" if reason else "end", task, message=reason or None))

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

    def _emit(self, event: Event) -> None:
        self._show(event, self.tally)

    def _reported(self) -> None:
        self._heard, self._silence = time.monotonic(), _SILENCE
