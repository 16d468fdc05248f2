"""Dispatch: hand tasks to the workers of a dask scheduler, and take their outcomes as they end.

A worker does the tasks of a bundle (`jobs.plan.bundles`) one after another. Their outcomes come as messages, which cost
a tenth of a result that dask gathers.
"""

from __future__ import annotations

import time
import traceback
from collections.abc import Collection, Iterator, Mapping, Sequence
from functools import cache, partial
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import Any, Final

from jobs.plan.bundles import MOST_SECONDS, SECONDS
from jobs.plan.task import Task
from jobs.run.outcome import KILLED, Outcome, one_line, work
from jobs.run.progress import LOOK, TOPIC
from jobs.run.receipt import Product
from jobs.run.software import digest
from jobs.run.workers import Workers
from pipeline import patience
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
        self._running: dict[str, tuple[dict[str, Task], Any]] = {}  # tasks by id, and their future, by key
        # Keys with messages; without one: the future has ended. Filled by threads of dask's.
        self._heard: SimpleQueue[tuple[str, Mapping[str, Any] | None]] = SimpleQueue()
        self._begun: set[str] = set()
        self._number = 0
        client.subscribe_topic(self._topic, self._hear)

    @property
    def running(self) -> Iterator[Task]:
        """Tasks that have not ended."""
        return (task for tasks, _ in self._running.values() for task in tasks.values())

    def start(self, tasks: Sequence[Task], inputs: Mapping[str, str], avoided: Collection[str] = ()) -> None:
        """Give tasks to a worker, which does one after another.

        Parameters
        ----------
        tasks : sequence of Task
            A bundle, or one task.
        inputs : mapping
            Hashes of the products that they need, by path.
        avoided : collection of str
            Addresses of workers that do not get them if there is a choice.
        """
        self._number += 1  # a second try must not get the first one's result
        key = f"{tasks[0].stage}-{tasks[0].id}-{self._run}-{self._number}"
        where = self._workers.restriction(avoided)
        given = tasks, str(self._out), inputs, self._topic, self._workers.digest
        future = self._client.submit(_work, *given, key=key, **where)
        self._running[key] = {task.id: task for task in tasks}, future
        future.add_done_callback(lambda future: self._heard.put((future.key, None)))

    def ended(self, seconds: float) -> list[tuple[Task, Outcome | None]]:
        """Wait for a task to end, so many seconds at most; return all that have ended, with their outcomes.

        Tasks that a worker gives back, because their bundle takes too long, have none.
        """
        heard: list[tuple[str, Mapping[str, Any] | None]] = []
        found: list[tuple[Task, Outcome | None]] = []
        try:
            heard.append(self._heard.get(timeout=seconds))
            while True:
                heard.append(self._heard.get_nowait())
        except Empty:
            pass
        for key, outcomes in heard:
            if key not in self._running:
                continue  # its outcomes came as messages, and now its future ends
            tasks, future = self._running[key]
            if outcomes is None:
                failure = _failure(future, key in self._begun)
                found += [(task, failure) for task in tasks.values()]
                tasks.clear()
            for id, outcome in (outcomes or {}).items():
                if task := tasks.pop(id, None):  # else done twice: its worker died after it
                    found.append((task, outcome and _outcome(outcome)))
            if not tasks:
                self._begun.discard(key)
                del self._running[key]
        return found

    @property
    def _topic(self) -> str:
        return f"{_OUTCOMES}-{self._run}"

    def _hear(self, event: tuple[float, Any]) -> None:
        """Take the outcomes of tasks from their worker, or nothing: that a task begins."""
        key, outcomes = event[1]
        if outcomes is None:
            self._begun.add(key)
        else:
            self._heard.put((key, outcomes))


def _outcome(message: Mapping[str, Any]) -> Outcome:
    """Return the outcome in a message."""
    files = {name: Product(**product) for name, product in message["files"].items()}
    return Outcome(**{**message, "files": files})


def _failure(future: Any, begun: bool) -> Outcome:
    """Return the outcome of a task that ended without a message.

    Dask blames the death of a worker on all tasks that were with it; one that had not begun is innocent. So is one of a
    bundle, of which it is not known: it is tried again, without others.
    """
    from distributed import KilledWorker

    error = future.exception(timeout=LOOK)
    if isinstance(error, KilledWorker):
        innocent = "its worker died before it began"
        return Outcome({}, 0.0, KILLED) if begun else Outcome({}, 0.0, innocent, refused=True)
    error = error or RuntimeError("its worker sent no outcome")
    return Outcome({}, 0.0, one_line(error), "".join(traceback.format_exception(error)))


def _work(tasks: Sequence[Task], out: str, inputs: Mapping[str, str], topic: str, expected: str) -> None:
    """Do tasks in a worker, unless the worker's software is not the `expected` one, and send their outcomes."""
    from distributed import get_worker

    worker, last = get_worker(), 0.0

    def progress(task: Task, fraction: float) -> None:
        nonlocal last
        if (now := time.monotonic()) - last >= _SECONDS_BETWEEN_SIGNS:
            worker.log_event(TOPIC, {"task": task.id, "fraction": float(fraction)})
            last = now

    patience.tell(lambda sentence: worker.log_event(TOPIC, {"sentence": sentence}))
    key, outcomes = worker.get_current_task(), dict[str, Any]()
    start = sent = time.monotonic()
    if len(tasks) == 1:
        worker.log_event(topic, (key, None))
    for task in tasks:
        if (now := time.monotonic()) - sent > SECONDS and outcomes:
            worker.log_event(topic, (key, outcomes))
            outcomes, sent = {}, now
        if now - start > MOST_SECONDS:
            outcomes[task.id] = None
            continue
        if expected and expected != _digest():
            outcome = Outcome({}, 0.0, "its worker has other software than the driver", refused=True)
        else:
            outcome = work(task, place(out), partial(progress, task), inputs, worker.state.nthreads)
        files = {name: product.model_dump() for name, product in outcome.files.items()}
        outcomes[task.id] = outcome._asdict() | {"files": files, "worker": worker.address}
    worker.log_event(topic, (key, outcomes))


_digest = cache(digest)
