"""Do one task and measure its products. A failure becomes a reason, never an exception, so it can cross processes."""

from __future__ import annotations

import time
import traceback
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple

from jobs.plan.task import Progress, Task
from jobs.run.receipt import Product, measure
from jobs.run.workspace import workspace
from pipeline.own_process import ProcessEnded, in_own_process
from pipeline.patience import StorageFailed
from pipeline.storage import explained, is_local
from weaves.errors import BadInput, WorkFailed

KILLED = "the process that ran it was killed several times over; is there enough memory?"
"""Reason of a task whose process died before it could report."""


class Outcome(NamedTuple):
    """Result of a task: its products, or the reason of its failure.

    Attributes
    ----------
    files : dict
        Products by file name.
    seconds : float
        Time that the task took.
    reason : str
        One line; empty if the task is done.
    traceback : str
        That of an unexpected exception, which may not occur elsewhere; empty for bad input and for work that failed.
    worker : str
        Address of the worker; empty if it is not known.
    refused : bool
        True if nothing was computed: the worker's software is not the driver's, or the worker died before.
    storage_failed : bool
        True if the storage failed for longer than it is waited for, or refused: no other task can be done either.
    """

    files: dict[str, Product]
    seconds: float
    reason: str = ""
    traceback: str = ""
    worker: str = ""
    refused: bool = False
    storage_failed: bool = False


def work(
    task: Task, out: Path, progress: Progress, inputs: Mapping[str, str] = MappingProxyType({}), threads: int = 1
) -> Outcome:
    """Do a task, in a process of its own if it measures time, or must not share one with other tasks.

    Parameters
    ----------
    task : Task
        The task.
    out : Path
        Place of all products.
    progress : callable
        Receives the finished share.
    inputs : mapping
        As for `jobs.run.workspace.workspace`.
    threads : int
        Tasks that this process may do at the same time.
    """
    own = task.alone or (threads > 1 and not task.shares_process)
    start = time.perf_counter()
    try:
        with workspace(task, out, inputs) as folder:
            in_own_process(task.run, folder, progress=progress) if own else task.run(folder, progress)
            files = {Path(path).name: measure(folder / path) for path in task.products}
    except ProcessEnded as error:
        return Outcome({}, time.perf_counter() - start, str(error), traceback.format_exc())
    except (BadInput, WorkFailed) as error:
        failed = isinstance(error, StorageFailed)
        return Outcome({}, time.perf_counter() - start, str(error), storage_failed=failed)
    except Exception as error:
        if not is_local(out) and (found := explained(error)):
            return Outcome({}, time.perf_counter() - start, str(found), storage_failed=True)
        return Outcome({}, time.perf_counter() - start, one_line(error), traceback.format_exc())
    return Outcome(files, time.perf_counter() - start)


def one_line(error: BaseException) -> str:
    """Return an unexpected exception in one line."""
    lines = str(error).strip().splitlines() or [""]
    return f"{type(error).__name__}: {lines[0]}" if lines[0] else type(error).__name__
