"""Execution: ready tasks go to dask.distributed, most urgent first, and the driver alone writes the ledger.

A receipt is on the disk before any task that needs it starts, so a run that is stopped or killed at any moment loses
only the tasks under way. A worker that dies is replaced and its task given to another (dask's retry). At most one task
a core is handed out at a time: dask, which cannot know how long a task takes, would park short ones behind a training.
The inputs of a task are compared with their receipts before it starts; damaged ones are removed and made again, and a
task that fails is tried once more if an input turns out to be damaged.
A task that measures time runs in a process of its own (`jobs.run.alone`) while the workers have nothing to do; with
`--scheduler` it runs in a worker, because the driver's machine may not be the one to measure.
"""

from __future__ import annotations

import math
import os
import time
import uuid
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from rich.console import Console

from jobs.plan.task import STAGES, Stage, Task, urgencies
from jobs.run.alone import run_alone
from jobs.run.cluster import HERE, MOST_WORKERS, Scheduler, connected
from jobs.run.inputs import Inputs
from jobs.run.ledger import Ledger
from jobs.run.outcome import KILLED, Outcome, one_line, work
from jobs.run.progress import KERNELS, LOOK, TOPIC, Board, Compiling
from jobs.run.receipt import measure
from jobs.terminal import Terminal
from weaves.errors import BadInput, WorkFailed

_SECONDS_BETWEEN_SIGNS = 0.2


class Preparation(NamedTuple):
    """Preparation of a worker: compile a group of kernels.

    Attributes
    ----------
    name : str
        Name that progress shows.
    function : callable
        ``function(argument, ready)``; it calls ``ready`` with the name of each kernel.
    argument : object
        Its first argument.
    """

    name: str
    function: Callable[[Any, Callable[[str], None]], None]
    argument: Any


class Summary(NamedTuple):
    """Tasks of a run: done before, done by it, failed, and waiting for failed ones."""

    before: list[Task]
    ran: list[Task]
    failed: list[Task]
    waiting: list[Task]


def execute(
    tasks: Sequence[Task],
    out: Path,
    *,
    stages: Sequence[Stage] = STAGES,
    scheduler: Scheduler = HERE,
    workers: int = 0,
    prepare: Callable[[Sequence[Task]], Sequence[Preparation]] = lambda todo: (),
    recorded: Callable[[Task], None] = lambda task: None,
    console: Console | None = None,
) -> Summary:
    """Run the unfinished tasks of some stages.

    Parameters
    ----------
    tasks : sequence of Task
        The whole plan.
    out : Path
        Output folder; every worker must see it under this name.
    stages : sequence of str
        Stages to work on; what they need of others must be done.
    scheduler : Scheduler
        A running dask scheduler; by default a cluster on this machine, which ends with this process.
    workers : int
        Worker processes of the local cluster, one thread each; 0: one a core.
    prepare : callable
        Work of workers before the first task.
    recorded : callable
        Called in this process after a receipt is written, or products are taken from another data set.
    console : Console, optional
        Terminal that shows progress.

    Raises
    ------
    BadInput
        If the number of workers or the scheduler cannot be used.
    WorkFailed
        If a needed task of another stage is not done, the workers cannot start, or the scheduler is lost.
    """
    if not 0 <= workers <= MOST_WORKERS:
        raise BadInput("--workers", "", workers, f"must be from 0 (one a core) to {MOST_WORKERS}")
    out = out.resolve()
    ledger = Ledger(out)
    before = _done(tasks, ledger, recorded)
    finished = {task.id for task in before}
    todo = {task.id: task for task in tasks if task.id not in finished and task.stage in stages}
    _refuse_gaps(list(todo.values()), tasks, finished)
    summary = Summary(before, [], [], [])
    if not todo:
        return summary

    console = console or Terminal(stderr=True)
    inputs = Inputs(tasks, ledger)
    with connected(scheduler, min(workers or os.cpu_count() or 1, len(todo)), console) as client:
        if preparations := prepare(list(todo.values())):
            _prepare(client, preparations, console)
        with Board(list(todo.values()), console) as board:
            client.subscribe_topic(TOPIC, board.hear)
            book = _Book(todo, finished, summary, stages, board, console)
            running: dict[Any, Task] = {}
            while todo or running:
                ended: list[tuple[Task, Outcome]] = []
                damaged: list[Task] = []
                for task in _admitted(book.ready(), list(running.values()), slots=sum(client.nthreads().values())):
                    if found := inputs.damaged(task):
                        book.again(found)
                        damaged += found
                        continue
                    board.begin(todo.pop(task.id))
                    if task.alone and not scheduler.address:
                        ended.append((task, run_alone(task, out, board)))
                    else:
                        running[client.submit(_work, task, str(out), key=f"{task.stage}-{task.id}-{book.run}")] = task
                if not ended and damaged:
                    continue
                if not running and not ended:
                    break  # what is left waits for tasks that failed
                if not ended:
                    while not (futures := _ended(running)):
                        board.waiting_for(running.values(), workers=len(client.nthreads()))
                    ended = [(running.pop(future), _outcome(future)) for future in futures]
                for task, outcome in ended:
                    outcome = _verified(task, outcome, out)
                    if outcome.reason and book.once_more(task) and (found := inputs.damaged(task, anew=True)):
                        book.again([*found, task])
                        continue
                    if outcome.reason:
                        ledger.fail(task, outcome.reason, outcome.traceback)
                        summary.failed.append(task)
                    else:
                        ledger.finish(task, outcome.files, outcome.seconds)
                        finished.add(task.id)
                        inputs.made(task)
                        recorded(task)
                        summary.ran.append(task)
                    board.end(task)
    book.refuse_lost()
    summary.waiting.extend(todo.values())
    return summary


class _Book:
    """Tasks of a run that are left to do and that are done, shared with its loop; tasks that are done once more."""

    def __init__(
        self,
        todo: dict[str, Task],
        finished: set[str],
        summary: Summary,
        stages: Sequence[Stage],
        board: Board,
        console: Console,
    ) -> None:
        self._todo, self._finished, self._summary = todo, finished, summary
        self._stages, self._board, self._console = stages, board, console
        self._urgency = urgencies(list(todo.values()))
        self._failed_once: set[str] = set()
        self._lost: list[Task] = []  # damaged products of stages that do not run
        self.run = uuid.uuid4().hex
        """Part of dask's keys: a task of another run, or one that is done once more, must not get an old result."""

    def ready(self) -> list[Task]:
        """Return the tasks whose needs are done, most urgent first."""
        ready = [task for task in self._todo.values() if self._finished.issuperset(task.needs)]
        ready.sort(key=lambda task: (task.alone, -self._urgency[task.id]))
        return ready

    def once_more(self, task: Task) -> bool:
        """Note that a task has failed; return whether it is the first time."""
        first = task.id not in self._failed_once
        self._failed_once.add(task.id)
        return first

    def again(self, tasks: Sequence[Task]) -> None:
        """Do tasks again whose products were damaged, or that failed on such products."""
        self.run = uuid.uuid4().hex
        for task in tasks:
            self._finished.discard(task.id)
            self._urgency[task.id] = math.inf
            for done in (self._summary.before, self._summary.ran):
                done[:] = [one for one in done if one.id != task.id]
            if task.stage not in self._stages:
                self._lost.append(task)
                continue
            self._todo[task.id] = task
            if task.id not in self._failed_once:
                self._console.print(f"{task.stage} {task.title}: damaged, made again", style="yellow")
                self._board.add(task)

    def refuse_lost(self) -> None:
        """End the run if damaged products are of a stage that does not run."""
        if self._lost:
            first = self._lost[0]
            allowed = f"run `twillight {first.stage}` first"
            raise WorkFailed(f"{first.title}: its products were damaged and are removed; {allowed}")


def _done(tasks: Sequence[Task], ledger: Ledger, recorded: Callable[[Task], None]) -> list[Task]:
    """Return the tasks that are done, some by the products of another data set."""
    before = []
    for task in tasks:
        done = ledger.state(task) == "done"
        if not done and ledger.adopt(task):
            recorded(task)  # to whom it was not there a moment ago
            done = True
        if done:
            before.append(task)
    return before


def _prepare(client: Any, preparations: Sequence[Preparation], console: Console) -> None:
    """Compile kernels in all workers at once and show how far it is.

    A failure here occurs again in the task that needs the kernel, and is reported there.
    """
    with Compiling(len(preparations), console) as shown:
        client.subscribe_topic(KERNELS, shown.hear)
        slots = sum(client.nthreads().values())
        waiting, running = list(preparations), dict[Any, str]()
        while waiting or running:
            while waiting and len(running) < max(1, slots):
                one = waiting.pop(0)
                running[client.submit(_prepare_one, one, pure=False)] = one.name
                shown.begin(one.name)
            for future in _ended(running):
                shown.end(running.pop(future))
        client.unsubscribe_topic(KERNELS)


def _prepare_one(one: Preparation) -> None:
    """Do one preparation in a worker."""
    from distributed import get_worker

    worker = get_worker()
    one.function(one.argument, lambda kernel: worker.log_event(KERNELS, kernel))


def _refuse_gaps(todo: Sequence[Task], tasks: Sequence[Task], finished: set[str]) -> None:
    """Refuse to start if a product is missing of a stage that does not run."""
    planned = {task.id: task for task in tasks}
    own = {task.id for task in todo}
    gaps = {need for task in todo for need in task.needs if need not in finished and need not in own}
    if gaps:
        stage = min((planned[need].stage for need in gaps), key=STAGES.index)
        count = sum(planned[need].stage == stage for need in gaps)
        raise WorkFailed(f"{todo[0].stage}: {count} tasks that it needs are not done; run `twillight {stage}` first")


def _admitted(ready: Sequence[Task], running: Sequence[Task], slots: int) -> list[Task]:
    """Return the tasks to hand out now: one a free slot, and a task that must be alone only when nothing runs."""
    if any(task.alone for task in running):
        return []
    admitted = [task for task in ready if not task.alone][: max(0, max(1, slots) - len(running))]
    return admitted if admitted or running else list(ready[:1])


def _work(task: Task, out: str) -> Outcome:
    """Do one task in a worker."""
    from distributed import get_worker

    worker, last = get_worker(), 0.0

    def progress(fraction: float) -> None:
        nonlocal last
        if (now := time.monotonic()) - last >= _SECONDS_BETWEEN_SIGNS:
            worker.log_event(TOPIC, {"task": task.id, "fraction": float(fraction)})
            last = now

    return work(task, Path(out), progress)


def _verified(task: Task, outcome: Outcome, out: Path) -> Outcome:
    """Return the outcome, a failure if this process does not find the products that the worker measured."""
    if outcome.reason:
        return outcome
    for path in task.products:
        try:
            found = measure(out / path)
        except OSError:
            reason = f"{path} was written where this process does not see it: every worker must see --out, {out}"
            return outcome._replace(reason=reason)
        if found != outcome.files[Path(path).name]:
            return outcome._replace(reason=f"{path} is not the file that its worker wrote: every worker must see {out}")
    return outcome


def _outcome(future: Any) -> Outcome:
    """Return the outcome of a task, also if its worker could not report it."""
    from distributed import KilledWorker

    error = future.exception()
    if error is None:
        outcome: Outcome = future.result()
        return outcome
    if isinstance(error, KilledWorker):
        return Outcome({}, 0.0, KILLED)
    return Outcome({}, 0.0, one_line(error))


def _ended(running: Iterable[Any]) -> list[Any]:
    """Wait a while until at least one of these futures has ended, and return those that have."""
    from distributed import wait

    try:
        return list(wait(list(running), timeout=LOOK, return_when="FIRST_COMPLETED").done)  # type: ignore[no-untyped-call]
    except TimeoutError:
        return []
