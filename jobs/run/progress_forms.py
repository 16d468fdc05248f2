"""Ways to show progress: bars on a terminal, lines in a log, JSON objects for programs. All are written to stderr."""

from __future__ import annotations

import json
import math
import threading
import time
from collections.abc import Callable
from typing import Final, Literal

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskID, TextColumn, TimeElapsedColumn
from rich.status import Status

from jobs.plan.task import Stage
from jobs.run.progress import Event, Tally

ProgressForm = Literal["auto", "rich", "plain", "json"]
"""How progress is shown; auto: bars on a terminal, lines elsewhere."""

_SECONDS_BETWEEN_LINES: Final = 30.0
_SECONDS_BETWEEN_OBJECTS: Final = 1.0  # that only tell the share of a task


def form_of(name: ProgressForm, console: Console) -> Callable[[Event, Tally], None]:
    """Return what shows an event on a console."""
    if name == "auto":
        name = "rich" if console.is_terminal else "plain"
    if name == "rich":
        return _Bars(console).show
    return _Lines(console).show if name == "plain" else _Objects(console).show


def _rate(tally: Tally) -> str:
    return f"{tally.rate:.3g} tasks/s" if tally.rate >= 0.1 else f"{60 * tally.rate:.2g} tasks/min"


def _left(tally: Tally) -> str:
    """Return the time left in words; empty if it is not known."""
    if (seconds := tally.seconds_left) is None:
        return ""
    minutes, rest = divmod(math.ceil(seconds), 60)
    return f"{minutes // 60}:{minutes % 60:02}:{rest:02} left"


def _failure(event: Event) -> str:
    """Return the line of a task that failed."""
    assert event.task is not None
    return f"{event.name}: {event.task.stage} {event.task.title}: {event.message}"


class _Bars:
    """One bar for each stage; its length is the expected cost of what is done. The last one has the time left."""

    def __init__(self, console: Console) -> None:
        self._console = console
        self._status: Status | None = None
        self._rows: dict[str, TaskID] = {}
        columns = ["{task.description:<9}", "{task.fields[count]:>11}", "{task.fields[rate]}", "{task.fields[left]}"]
        name, *texts = (TextColumn(column) for column in columns)
        self._bars = Progress(
            name, BarColumn(bar_width=None), *texts, TimeElapsedColumn(), console=console, expand=True
        )

    def show(self, event: Event, tally: Tally) -> None:
        if event.name == "compile":
            self._status = self._status or self._console.status("")
            self._status.update(str(event.message))
            self._status.start()
            return
        if self._status and event.name in ("start", "stop"):
            self._status.stop()
            self._status = None
        if event.name == "start":
            if tally.dashboard:
                self._print(f"dashboard: {tally.dashboard}")
            for stage in tally.all_work:
                self._update(stage, tally)
            self._bars.start()
        if event.name == "stop":
            self._bars.stop()
        elif event.message:
            self._print(_failure(event) if event.task else event.message)
        if event.task:
            self._update(event.task.stage, tally)
            self._row("all", start=True, total=1.0, completed=_share(tally), left=_left(tally))

    def _update(self, stage: Stage, tally: Tally) -> None:
        whole = tally.ended[stage] == tally.planned[stage]  # rounding must not leave a bar short of its end
        failed = f", {tally.failed[stage]} failed" if tally.failed[stage] else ""
        self._row(
            stage,
            start=tally.work[stage] > 0,
            total=tally.all_work[stage],
            completed=tally.all_work[stage] if whole else tally.work[stage],
            count=f"{tally.ended[stage]}/{tally.planned[stage]} tasks{failed}",
            rate=_rate(tally) if tally.ended[stage] else "",
        )

    def _row(self, name: str, start: bool, **fields: object) -> None:
        if name not in self._rows:
            self._rows[name] = self._bars.add_task(name, total=None, start=False, count="", rate="", left="")
        row = self._rows[name]
        if start and not self._bars.tasks[row].started:
            self._bars.start_task(row)
        self._bars.update(row, **fields)  # type: ignore[arg-type]

    def _print(self, sentence: str) -> None:
        self._bars.console.print(sentence, style="yellow", soft_wrap=True, highlight=False, markup=False)


def _share(tally: Tally) -> float:
    """Return the share of the work that is done."""
    return sum(tally.work.values()) / max(sum(tally.all_work.values()), 1e-9)


class _Lines:
    """A line every half minute, and one for each failure and each finished stage."""

    def __init__(self, console: Console) -> None:
        self._console = console
        self._last = -math.inf

    def show(self, event: Event, tally: Tally) -> None:
        due = time.monotonic() - self._last >= _SECONDS_BETWEEN_LINES
        if event.name == "start":
            stages = ", ".join(f"{stage} {tally.planned[stage]:,}" for stage in tally.work)
            where = f"; dashboard: {tally.dashboard}" if tally.dashboard else ""
            self._print(f"{tally.planned.total():,} tasks ({stages}) on {tally.workers} workers{where}")
        elif event.task:
            if event.message:
                self._print(_failure(event))
            stage = event.task.stage
            ended = event.name in ("end", "failed") and tally.ended[stage] == tally.planned[stage]
            if due or ended:
                done = f"{stage} {tally.ended[stage]:,} of {tally.planned[stage]:,} tasks"
                failed = f"{tally.failed.total()} failed" if tally.failed.total() else ""
                rate = _rate(tally) if tally.ended.total() else ""
                numbers = ", ".join(filter(None, (failed, rate, _left(tally))))
                self._print(f"{done}; all {tally.ended.total():,} of {tally.planned.total():,}, {numbers}")
        elif event.message and (event.name != "compile" or due or "; now " not in event.message):
            self._print(event.message)

    def _print(self, line: str) -> None:
        self._last = time.monotonic()
        self._console.print(line, soft_wrap=True, highlight=False, markup=False)


class _Objects:
    """One JSON object a line for each event, with the same keys in all (see `jobs/README.md`)."""

    def __init__(self, console: Console) -> None:
        self._console = console
        self._lock = threading.Lock()
        self._last = -math.inf

    def show(self, event: Event, tally: Tally) -> None:
        if event.name == "progress":
            if time.monotonic() - self._last < _SECONDS_BETWEEN_OBJECTS:
                return
            self._last = time.monotonic()
        left, task = tally.seconds_left, event.task
        content = {
            "event": event.name,
            "time": round(time.time(), 3),
            "task": task and task.id,
            "stage": task and task.stage,
            "title": task and task.title,
            "share": None if event.share is None else round(event.share, 4),
            "message": event.message,
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
