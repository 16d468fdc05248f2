"""Progress of a run: kernels being compiled, then one bar per stage.

Bars are weighted by what each task is expected to cost.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Iterable, Sequence
from types import TracebackType
from typing import Any, Final

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskID, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from jobs.plan.task import STAGES, Stage, Task

TOPIC = "progress"
"""Dask topic on which workers report the progress of a task: {"task": id, "fraction": share done}."""


KERNELS = "kernels"
"""Dask topic on which workers name each kernel that is compiled or read from the cache."""

LOOK: Final = 5.0
"""Seconds between two looks at how long nothing was reported."""

_SILENCE: Final = 60.0  # seconds without a report until the first line says so


class Compiling:
    """The line shown while kernels are compiled; a context manager."""

    def __init__(self, groups: int, console: Console) -> None:
        self._total, self._ended = groups, 0
        self._under_way: list[str] = []
        self._ready: set[str] = set()
        self._status = console.status(self._line())

    def __enter__(self) -> Compiling:
        self._status.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._status.stop()

    def begin(self, group: str) -> None:
        """Show that a group of kernels is being compiled."""
        self._under_way.append(group)
        self._status.update(self._line())

    def hear(self, event: tuple[float, Any]) -> None:
        """Take the name of a kernel that is ready."""
        self._ready.add(event[1])
        self._status.update(self._line())

    def end(self, group: str) -> None:
        """Count a group as compiled."""
        self._ended += 1
        self._under_way.remove(group)
        self._status.update(self._line())

    def _line(self) -> str:
        groups = f"{self._ended} of {self._total} groups done"
        return f"compiling kernels: {len(self._ready)} ready, {groups}; now {', '.join(self._under_way) or 'none'}"


class Board:
    """The bars of a run; a context manager. Fractions may arrive from another thread than the driver's."""

    def __init__(self, tasks: Sequence[Task], console: Console) -> None:
        self._bars = Progress(
            TextColumn("{task.description:<9}"),
            BarColumn(bar_width=None),
            TextColumn("{task.fields[count]:>11}"),
            TextColumn("elapsed"),
            TimeElapsedColumn(),
            TextColumn("left"),
            TimeRemainingColumn(),
            console=console,
            expand=True,
        )
        self._tasks = {task.id: task for task in tasks}
        self._fractions = dict.fromkeys(self._tasks, 0.0)
        self._planned = Counter(task.stage for task in tasks)
        self._ended: Counter[Stage] = Counter()
        self._rows: dict[Stage, TaskID] = {}
        self._heard, self._silence = time.monotonic(), _SILENCE
        for stage in STAGES:
            if total := sum(task.cost for task in tasks if task.stage == stage):
                self._rows[stage] = self._bars.add_task(stage, total=total, start=False, count=self._count(stage))

    def __enter__(self) -> Board:
        self._bars.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._bars.stop()

    def add(self, task: Task) -> None:
        """Add a task that was done before and is made again."""
        self._tasks[task.id], self._fractions[task.id] = task, 0.0
        self._planned[task.stage] += 1
        if task.stage not in self._rows:
            self._rows[task.stage] = self._bars.add_task(task.stage, total=0.0, start=False, count="")
        row = self._rows[task.stage]
        self._bars.update(row, total=(self._bars.tasks[row].total or 0.0) + task.cost, count=self._count(task.stage))

    def begin(self, task: Task) -> None:
        """Start the clock of a task's stage."""
        if not self._bars.tasks[self._rows[task.stage]].started:
            self._bars.start_task(self._rows[task.stage])
        self._reported()

    def hear(self, event: tuple[float, Any]) -> None:
        """Take a message of a worker about a task under way."""
        _, message = event
        self.advance(message["task"], float(message["fraction"]))

    def advance(self, id: str, fraction: float) -> None:
        """Show the finished share of a task under way."""
        self._reported()
        if task := self._tasks.get(id):
            self._advance(task, min(1.0, fraction))

    def waiting_for(self, tasks: Iterable[Task], workers: int) -> None:
        """Name the tasks under way when nothing was reported for a minute, and again after 2, 4, … minutes."""
        silence = time.monotonic() - self._heard
        if silence < self._silence:
            return
        self._silence *= 2
        titles = ", ".join(f"{task.stage} {task.title}" for task in tasks)
        where = f"{workers} workers" if workers > 1 else "1 process" if workers else "no worker: the scheduler has none"
        self._bars.console.print(f"nothing reported for {silence:.0f} s; under way: {titles} ({where})", style="yellow")

    def end(self, task: Task) -> None:
        """Count a task as ended, done or failed."""
        self._reported()
        self._ended[task.stage] += 1
        self._advance(task, 1.0)
        self._tasks.pop(task.id, None)

    def _reported(self) -> None:
        self._heard, self._silence = time.monotonic(), _SILENCE

    def _advance(self, task: Task, fraction: float) -> None:
        step = fraction - self._fractions[task.id]
        self._fractions[task.id] = fraction
        self._bars.update(self._rows[task.stage], advance=task.cost * step, count=self._count(task.stage))
        if self._ended[task.stage] == self._planned[task.stage]:  # rounding must not leave a bar short of its end
            self._bars.update(self._rows[task.stage], completed=self._bars.tasks[self._rows[task.stage]].total)

    def _count(self, stage: Stage) -> str:
        return f"{self._ended[stage]}/{self._planned[stage]} tasks"
