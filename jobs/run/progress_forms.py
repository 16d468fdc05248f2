"""Ways to show progress: bars on a terminal, lines in a log, JSON objects for programs. All are written to stderr."""

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
from jobs.run.progress import Board, Event

ProgressForm = Literal["auto", "rich", "plain", "json"]
"""How progress is shown; auto: bars on a terminal, lines elsewhere."""

_SECONDS_BETWEEN_LINES: Final = 30.0
_SECONDS_BETWEEN_OBJECTS: Final = 1.0  # that only tell the share of a task


def form_of(name: ProgressForm, console: Console) -> Callable[[Event, Board], None]:
    """Return what shows an event on a console."""
    if name == "auto":
        name = "rich" if console.is_terminal else "plain"
    if name == "rich":
        return _Bars(console).show
    return _Lines(console).show if name == "plain" else _Objects(console).show


def _rate(board: Board) -> str:
    return f"{board.rate:.3g} tasks/s" if board.rate >= 0.1 else f"{60 * board.rate:.2g} tasks/min"


def _left(board: Board) -> str:
    """Return the time left in words; empty if it is not known."""
    if (seconds := board.seconds_left) is None:
        return ""
    minutes, rest = divmod(math.ceil(seconds), 60)
    return f"{minutes // 60}:{minutes % 60:02}:{rest:02} left"


def _failure(event: Event) -> str:
    assert event.task is not None
    return f"{event.name}: {event.task.stage} {event.task.title}: {event.message}"


class _Bars:
    """One bar for each stage; its length is the expected cost of what is done. The last one has the time left."""

    def __init__(self, console: Console) -> None:
        self._console = console
        self._status: Status | None = None
        self._rows: dict[str, TaskID] = {}
        columns = ["{task.description:<9}", "{task.fields[count]:>11}", "{task.fields[rate]}", "{task.fields[left]}"]
        name, *texts = map(TextColumn, columns)
        parts = name, BarColumn(bar_width=None), *texts, TimeElapsedColumn()
        self._bars = Progress(*parts, console=console, expand=True)

    def show(self, event: Event, board: Board) -> None:
        if event.name == "compile":
            self._status = self._status or self._console.status("")
            self._status.update(str(event.message))
            self._status.start()
            return
        if self._status and event.name in ("start", "stop"):
            self._status.stop()
            self._status = None
        if event.name == "start":
            if board.dashboard:
                self._print(f"dashboard: {board.dashboard}")
            for stage in board.all_work:
                self._update(stage, board)
            self._bars.start()
        if event.name == "stop":
            self._bars.stop()
        elif event.message:
            self._print(_failure(event) if event.task else event.message)
        if event.task:
            self._update(event.task.stage, board)
            share = sum(board.work.values()) / max(sum(board.all_work.values()), 1e-9)
            self._row("all", start=True, total=1.0, completed=share, left=_left(board))

    def _update(self, stage: Stage, board: Board) -> None:
        whole = board.ended[stage] == board.planned[stage]  # rounding must not leave a bar short of its end
        failed = f", {board.failed[stage]} failed" if board.failed[stage] else ""
        self._row(
            stage,
            start=board.work[stage] > 0,
            total=board.all_work[stage],
            completed=board.all_work[stage] if whole else board.work[stage],
            count=f"{board.ended[stage]}/{board.planned[stage]} tasks{failed}",
            rate=_rate(board) if board.ended[stage] else "",
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


class _Lines:
    """A line every half minute, and one for each failure and each finished stage."""

    def __init__(self, console: Console) -> None:
        self._console = console
        self._last = -math.inf

    def show(self, event: Event, board: Board) -> None:
        due = time.monotonic() - self._last >= _SECONDS_BETWEEN_LINES
        if event.name == "start":
            stages = ", ".join(f"{stage} {board.planned[stage]:,}" for stage in board.work)
            where = f"; dashboard: {board.dashboard}" if board.dashboard else ""
            self._print(f"{board.planned.total():,} tasks ({stages}) on {board.workers} workers{where}")
        elif event.task:
            if event.message:
                self._print(_failure(event))
            stage = event.task.stage
            ended = event.name in ("end", "failed") and board.ended[stage] == board.planned[stage]
            if due or ended:
                done = f"{stage} {board.ended[stage]:,} of {board.planned[stage]:,} tasks"
                failed = f"{board.failed.total()} failed" if board.failed.total() else ""
                rate = _rate(board) if board.ended.total() else ""
                numbers = ", ".join(filter(None, (failed, rate, _left(board))))
                self._print(f"{done}; all {board.ended.total():,} of {board.planned.total():,}, {numbers}")
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

    def show(self, event: Event, board: Board) -> None:
        if event.name == "progress":
            if time.monotonic() - self._last < _SECONDS_BETWEEN_OBJECTS:
                return
            self._last = time.monotonic()
        left, task = board.seconds_left, event.task
        content = {
            "event": event.name,
            "time": round(time.time(), 3),
            "task": task and task.id,
            "stage": task and task.stage,
            "title": task and task.title,
            "share": None if event.share is None else round(event.share, 4),
            "message": event.message,
            "done": board.ended.total() - board.failed.total(),
            "total": board.planned.total(),
            "failed": board.failed.total(),
            "rate": round(board.rate, 4),
            "seconds_left": None if left is None else round(left, 1),
            "workers": board.workers,
            "dashboard": board.dashboard,
        }
        with self._lock:
            self._console.file.write(json.dumps(content) + "\n")
            self._console.file.flush()
