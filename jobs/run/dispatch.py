"""Dispatch: hand tasks to the workers of a dask scheduler, and take their outcomes as they end."""

from __future__ import annotations

import time
import traceback
from collections.abc import Collection, Iterator, Mapping
from functools import cache
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import Any, Final

from jobs.plan.task import Task
from jobs.run.outcome import KILLED, Outcome, one_line, work
from jobs.run.progress import LOOK, TOPIC
from jobs.run.receipt import Product
from jobs.run.software import digest
from jobs.run.workers import Workers
from pipeline.storage import place

_OUTCOMES: Final = "outcomes"  # begins the name of the topic of a run
_SECONDS_BETWEEN_SIGNS: Final = 0.2


class Dispatch:
    """The tasks that are with the scheduler.

    Parameters
    ----------
    client : distributed.Client
        Client of the scheduler.
    workers : Workers
        Its workers.
    out : Path
        Output folder, as every worker must see it.
    run : str
        Name of the run: another run of the same task, with another folder, must not share its result.
    """

    def __init__(self, client: Any, workers: Workers, out: Path, run: str) -> None:
        self._client, self._workers, self._out, self._run = client, workers, out, run
        self._running: dict[str, tuple[Task, Any]] = {}  # with its future, by key
        self._ended: SimpleQueue[str] = SimpleQueue()  # keys; filled by threads of dask's
        self._outcomes: dict[str, Outcome] = {}
        self._begun: set[str] = set()
        self._number = 0
        client.subscribe_topic(self._topic, self._hear)

    @property
    def running(self) -> Iterator[Task]:
        """Tasks that have not ended."""
        return (task for task, _ in self._running.values())

    def start(self, task: Task, inputs: Mapping[str, str], avoided: Collection[str] = ()) -> None:
        """Give a task with its inputs to a worker, to none of `avoided` if there is a choice."""
        self._number += 1  # a second try must not get the first one's result
        key = f"{task.stage}-{task.id}-{self._run}-{self._number}"
        where = self._workers.restriction(avoided)
        given = task, str(self._out), inputs, self._topic, self._workers.digest
        future = self._client.submit(_work, *given, key=key, **where)
        self._running[key] = task, future
        future.add_done_callback(lambda future: self._ended.put(future.key))

    def ended(self, seconds: float) -> list[tuple[Task, Outcome]]:
        """Wait for a task to end, so many seconds at most; return all that have ended, with their outcomes."""
        keys, found = [], []
        try:
            keys.append(self._ended.get(timeout=seconds))
            while True:
                keys.append(self._ended.get_nowait())
        except Empty:
            pass
        for key in keys:
            if key not in self._running:
                continue  # an outcome comes as a message, and its future ends
            outcome = self._outcomes.pop(key, None) or _failure(self._running[key][1], key in self._begun)
            self._begun.discard(key)
            found.append((self._running.pop(key)[0], outcome))
        return found

    @property
    def _topic(self) -> str:
        return f"{_OUTCOMES}-{self._run}"

    def _hear(self, event: tuple[float, Any]) -> None:
        """Take the outcome of a task from its worker, or nothing: that it begins.

        A message costs a tenth of a result that dask gathers.
        """
        key, message = event[1]
        if message is None:
            self._begun.add(key)
            return
        files = {name: Product(**product) for name, product in message.pop("files").items()}
        self._outcomes[key] = Outcome(files, **message)
        self._ended.put(key)


def _failure(future: Any, begun: bool) -> Outcome:
    """Return the outcome of a task that ended without a message.

    Dask blames the death of a worker on all tasks that were with it; one that had not begun is innocent.
    """
    from distributed import KilledWorker

    error = future.exception(timeout=LOOK)
    if isinstance(error, KilledWorker):
        innocent = "its worker died before it began"
        return Outcome({}, 0.0, KILLED) if begun else Outcome({}, 0.0, innocent, refused=True)
    error = error or RuntimeError("its worker sent no outcome")
    return Outcome({}, 0.0, one_line(error), "".join(traceback.format_exception(error)))


def _work(task: Task, out: str, inputs: Mapping[str, str], topic: str, expected: str) -> None:
    """Do one task in a worker, unless the worker's software is not the `expected` one, and send the outcome."""
    from distributed import get_worker

    worker, last = get_worker(), 0.0

    def progress(fraction: float) -> None:
        nonlocal last
        if (now := time.monotonic()) - last >= _SECONDS_BETWEEN_SIGNS:
            worker.log_event(TOPIC, {"task": task.id, "fraction": float(fraction)})
            last = now

    worker.log_event(topic, (worker.get_current_task(), None))
    if expected and expected != _digest():
        outcome = Outcome({}, 0.0, "its worker has other software than the driver", refused=True)
    else:
        outcome = work(task, place(out), progress, inputs)
    files = {name: product.model_dump() for name, product in outcome.files.items()}
    message = outcome._asdict() | {"files": files, "worker": worker.address}
    worker.log_event(topic, (worker.get_current_task(), message))


_digest = cache(digest)
