"""Do one task in a process of its own, for a task that measures time: no other work has run in that process before.

The process is not a dask worker. A fresh worker would need `Client.restart`, which can stand still: dask's local
cluster looks for each lost worker 15 seconds after its loss (`distributed.deploy.lost-worker-timeout`), and if another
restart is under way at that moment it closes the worker's supervisor, and the worker never comes back.
"""

from __future__ import annotations

import multiprocessing
import os
import threading
from collections.abc import Mapping
from multiprocessing.connection import Connection, wait
from pathlib import Path
from typing import Final
from unittest import mock

from jobs.plan.task import Task
from jobs.run.child import ONE_THREAD, interrupts_held
from jobs.run.outcome import KILLED, Outcome, work
from jobs.run.progress import LOOK, Board
from pipeline import patience
from pipeline.storage import place

_TRIES: Final = 3  # a little more than once, as dask does for a task whose worker dies


def run_alone(task: Task, out: Path, inputs: Mapping[str, str], board: Board) -> Outcome:
    """Do a task in a fresh process and wait for its end; a process that dies is replaced, twice at most.

    Parameters
    ----------
    task : Task
        The task.
    out : Path
        Place of all products.
    inputs : mapping
        As for `jobs.run.workspace.workspace`.
    board : Board
        Shows the progress of the task.
    """
    context = multiprocessing.get_context("spawn")
    for _ in range(_TRIES):
        here, there = context.Pipe(duplex=False)
        process = context.Process(target=_serve, args=(task, str(out), inputs, there), name=task.title)
        with interrupts_held(), mock.patch.dict(os.environ, ONE_THREAD):
            process.start()
        there.close()  # so that the end of the process closes the pipe
        try:
            outcome = _received(task, here, board)
        finally:
            process.kill()
            process.join()
            here.close()
        if outcome is not None:
            return outcome
    return Outcome({}, 0.0, KILLED)


def _received(task: Task, pipe: Connection, board: Board) -> Outcome | None:
    """Show progress until the outcome arrives; None if the process ended without one."""
    while True:
        if not wait([pipe], LOOK):
            board.waiting_for([task], workers=1)
            continue
        try:
            message = pipe.recv()
        except EOFError:
            return None
        if isinstance(message, Outcome):
            return message
        if isinstance(message, str):
            board.say_once(message)
        else:
            board.advance(task.id, message)


def _serve(task: Task, out: str, inputs: Mapping[str, str], pipe: Connection) -> None:
    """Do the task in the new process, which ends with the driver."""
    parent = multiprocessing.parent_process()
    assert parent is not None
    threading.Thread(target=_end_with, args=(parent.sentinel,), daemon=True).start()
    patience.tell(pipe.send)
    pipe.send(work(task, place(out), pipe.send, inputs))


def _end_with(sentinel: int) -> None:
    """End this process at once when the process of `sentinel` has ended."""
    wait([sentinel])
    os._exit(1)
