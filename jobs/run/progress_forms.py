"""Ways to show progress: bars on a terminal, lines in a log, JSON objects for programs. All are written to stderr."""

from __future__ import annotations

import json
import math
import threading
import time
from collections.abc import Sequence
from typing import Any, Final, Literal

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskID, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.status import Status

from jobs.plan.task import Stage, Task
from jobs.run.progress import Form, Tally

ProgressForm = Literal["auto", "rich", "plain", "json"]
"""How progress is shown; auto: bars on a terminal, lines elsewhere."""

_SECONDS_BETWEEN_LINES: Final = 30.0
_SECONDS_BETWEEN_OBJECTS: Final = 1.0  # that only tell the share of a task


def form_of(name: ProgressForm, console: Console) -> Form:
    """Return a way to show progress on a console."""
    if name == "auto":
        name = "rich" if console.is_terminal else "plain"
    forms: dict[str, type[Form]] = {"rich": Bars, "plain": Lines, "json": Objects}
    return forms[name](console)


def rate_and_left(tally: Tally) -> str:
    """Return rate, failures and time left in words."""
    parts = [f"{sum(tally.failed.values())} failed"] if sum(tally.failed.values()) else []
    if tally.ended.total():
        parts.append(_rate(tally))
    if tally.seconds_left is not None:
        parts.append(f"{_duration(tally.seconds_left)} left")
    return ", ".join(parts)


def _rate(tally: Tally) -> str:
    return f"{tally.rate:.3g} tasks/s" if tally.rate >= 0.1 else f"{60 * tally.rate:.2g} tasks/min"


def _duration(seconds: float) -> str:
    minutes, rest = divmod(math.ceil(seconds), 60)
    return f"{minutes // 60}:{minutes % 60:02}:{rest:02}"


def _compiling(done: int, total: int, kernels: int, under_way: Sequence[str]) -> str:
    groups = f"{done} of {total} groups done"
    return f"compiling kernels: {kernels} ready, {groups}; now {', '.join(under_way) or 'none'}"


class Bars:
    """One bar for each stage; its length is the expected cost of what is done."""

    def __init__(self, console: Console) -> None:
        self._console = console
        self._status: Status | None = None
        self._rows: dict[Stage, TaskID] = {}
        self._bars = Progress(
            TextColumn("{task.description:<9}"),
            BarColumn(bar_width=None),
            TextColumn("{task.fields[count]:>11}"),
            TextColumn("{task.fields[rate]}"),
            TextColumn("elapsed"),
            TimeElapsedColumn(),
            TextColumn("left"),
            TimeRemainingColumn(),
            console=console,
            expand=True,
        )

    def compiling(self, tally: Tally, done: int, total: int, kernels: int, under_way: Sequence[str]) -> None:
        """Show a line that changes."""
        line = _compiling(done, total, kernels, under_way)
        if self._status is None:
            self._status = self._console.status(line)
            self._status.start()
        self._status.update(line)
        if done == total:
            self._status.stop()
            self._status = None

    def begin(self, tally: Tally) -> None:
        """Show the bars."""
        if tally.dashboard:
            self.say(tally, f"dashboard: {tally.dashboard}")
        for stage in tally.all_work:
            self._update(tally, stage)
        self._bars.start()

    def task(self, event: str, tally: Tally, task: Task, reason: str = "") -> None:
        """Start the clock of a task's stage, or lengthen its bar."""
        if event == "begin" and not self._bars.tasks[self._row(task.stage)].started:
            self._bars.start_task(self._row(task.stage))
        if reason:
            self.say(tally, f"{event}: {task.stage} {task.title}: {reason}")
        self._update(tally, task.stage)

    def advance(self, tally: Tally, task: Task, share: float) -> None:
        """Lengthen the bar of a task's stage."""
        self._update(tally, task.stage)

    def say(self, tally: Tally, sentence: str) -> None:
        """Print a sentence above the bars."""
        self._bars.console.print(sentence, style="yellow", soft_wrap=True, highlight=False, markup=False)

    def end(self, tally: Tally) -> None:
        """Leave the bars as they are."""
        if self._status:
            self._status.stop()
        self._bars.stop()

    def _row(self, stage: Stage) -> TaskID:
        if stage not in self._rows:
            self._rows[stage] = self._bars.add_task(stage, total=None, start=False, count="", rate="")
        return self._rows[stage]

    def _update(self, tally: Tally, stage: Stage) -> None:
        whole = tally.ended[stage] == tally.planned[stage]  # rounding must not leave a bar short of its end
        completed = tally.all_work[stage] if whole else tally.work[stage]
        rate = _rate(tally) if tally.ended[stage] else ""
        total, count = tally.all_work[stage], _count(tally, stage)
        self._bars.update(self._row(stage), total=total, completed=completed, count=count, rate=rate)


def _count(tally: Tally, stage: Stage) -> str:
    failed = f", {tally.failed[stage]} failed" if tally.failed[stage] else ""
    return f"{tally.ended[stage]}/{tally.planned[stage]} tasks{failed}"


class Lines:
    """A line every half minute, and one for each failure and each finished stage."""

    def __init__(self, console: Console) -> None:
        self._console = console
        self._last = -math.inf

    def compiling(self, tally: Tally, done: int, total: int, kernels: int, under_way: Sequence[str]) -> None:
        """Print a line now and then."""
        if done == total or self._due():
            self._print(_compiling(done, total, kernels, under_way))

    def begin(self, tally: Tally) -> None:
        """Print what there is to do, and the dashboard."""
        stages = ", ".join(f"{stage} {tally.planned[stage]:,}" for stage in tally.work)
        where = f"; dashboard: {tally.dashboard}" if tally.dashboard else ""
        self._print(f"{tally.planned.total():,} tasks ({stages}) on {tally.workers} workers{where}")

    def task(self, event: str, tally: Tally, task: Task, reason: str = "") -> None:
        """Print a failure at once."""
        if reason:
            self._print(f"{event}: {task.stage} {task.title}: {reason}")
        ended = tally.ended[task.stage] == tally.planned[task.stage]
        self._progress(tally, task.stage, always=ended and event in ("end", "failed"))

    def advance(self, tally: Tally, task: Task, share: float) -> None:
        """Print a line now and then."""
        self._progress(tally, task.stage)

    def say(self, tally: Tally, sentence: str) -> None:
        """Print a sentence."""
        self._print(sentence)

    def end(self, tally: Tally) -> None:
        """Print nothing: the last stage has ended, or a sentence follows."""

    def _progress(self, tally: Tally, stage: Stage, always: bool = False) -> None:
        if not always and not self._due():
            return
        done = f"{stage} {tally.ended[stage]:,} of {tally.planned[stage]:,} tasks"
        self._print(f"{done}; all {tally.ended.total():,} of {tally.planned.total():,}, {rate_and_left(tally)}")

    def _due(self) -> bool:
        return time.monotonic() - self._last >= _SECONDS_BETWEEN_LINES

    def _print(self, line: str) -> None:
        self._last = time.monotonic()
        self._console.print(line, soft_wrap=True, highlight=False, markup=False)


class Objects:
    """One JSON object a line for each event, with the same keys in all (see `jobs/README.md`)."""

    def __init__(self, console: Console) -> None:
        self._console = console
        self._lock = threading.Lock()
        self._last = -math.inf

    def compiling(self, tally: Tally, done: int, total: int, kernels: int, under_way: Sequence[str]) -> None:
        """Write ``compile``."""
        self._write("compile", tally, message=_compiling(done, total, kernels, under_way))

    def begin(self, tally: Tally) -> None:
        """Write ``start``."""
        self._write("start", tally)

    def task(self, event: str, tally: Tally, task: Task, reason: str = "") -> None:
        """Write ``begin``, ``end``, ``failed`` or ``again``."""
        self._write(event, tally, task, message=reason or None)

    def advance(self, tally: Tally, task: Task, share: float) -> None:
        """Write ``progress``, once a second at most."""
        if time.monotonic() - self._last >= _SECONDS_BETWEEN_OBJECTS:
            self._last = time.monotonic()
            self._write("progress", tally, task, share=round(share, 4))

    def say(self, tally: Tally, sentence: str) -> None:
        """Write ``message``."""
        self._write("message", tally, message=sentence)

    def end(self, tally: Tally) -> None:
        """Write ``stop``."""
        self._write("stop", tally)

    def _write(
        self, event: str, tally: Tally, task: Task | None = None, *, share: float | None = None, message: Any = None
    ) -> None:
        left = tally.seconds_left
        content = {
            "event": event,
            "time": round(time.time(), 3),
            "task": task and task.id,
            "stage": task and task.stage,
            "title": task and task.title,
            "share": share,
            "message": message,
            "done": tally.ended.total() - tally.failed.total(),
            "total": tally.planned.total(),
            "failed": tally.failed.total(),
            "rate": round(tally.rate, 4),
            "seconds_left": None if left is None else round(left, 1),
            "workers": tally.workers,
            "dashboard": tally.dashboard,
        }
        with self._lock:
            self._console.file.write(json.dumps(content) + "\n")
            self._console.file.flush()
