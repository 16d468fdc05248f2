"""Execution: ready tasks go to dask.distributed, most urgent first, and the driver alone writes the ledger.

A receipt is on the disk before any task that needs it starts, so a run that is stopped or killed at any moment loses
only the tasks under way. A worker that dies is replaced and its task given to another (dask's retry).
The inputs of a task are compared with their receipts before it starts; damaged ones are removed and made again, and a
task that fails is tried once more if an input turns out to be damaged. Else a task that ends with an unexpected
exception is tried again twice, elsewhere if there is a choice; bad input and work that failed are not.
On this machine one task a core is handed out at a time, and while only shards are made one more: dask, which cannot
know how long a task takes, would park short ones behind a training. Shards that take a few milliseconds go several at a
time (`jobs.plan.bundles`). A task that measures time runs in
a process of its own, started by a worker while the others have nothing to do (`jobs.run.outcome`).
"""

from __future__ import annotations

import uuid
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

from rich.console import Console

from jobs.plan.bundles import Bundles
from jobs.plan.ready import Ready
from jobs.plan.task import STAGES, Stage, Task
from jobs.run.cluster import HERE, MOST_WORKERS, Scheduler, connected, dashboard_of
from jobs.run.dispatch import Dispatch
from jobs.run.inputs import Inputs
from jobs.run.ledger import Ledger
from jobs.run.outcome import Outcome
from jobs.run.progress import KERNELS, LOOK, TOPIC, Board
from jobs.run.progress_forms import ProgressForm, form_of
from jobs.run.receipt import Product, measure
from jobs.run.workers import Workers
from jobs.terminal import Terminal
from pipeline import patience
from pipeline.cores import cores
from pipeline.storage import is_local, size_of
from weaves.errors import BadInput, WorkFailed

_SECONDS_BETWEEN_LOOKS: Final = 1.0  # for workers that have come
_TRIES: Final = 3  # of a task that ends with an unexpected exception

Recorded = Callable[[Task, Mapping[str, Product]], None]
"""Function that hears of a task that is done, and of its products by file name."""


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
    recorded: Recorded = lambda task, files: None,
    settle: Callable[[], None] = lambda: None,
    console: Console | None = None,
    progress: ProgressForm = "auto",
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
        Called in this process with a task and its products by file name, after its receipt is written, or products
        are taken from another data set.
    settle : callable
        Called before a task starts that needs others, and at the end, so that `recorded` may put work off.
    console : Console, optional
        Terminal that shows progress.
    progress : str
        How it is shown.

    Raises
    ------
    BadInput
        If the number of workers or the scheduler cannot be used.
    WorkFailed
        If a needed task of another stage is not done, the workers cannot start or have other software, or the
        scheduler is lost.
    """
    if not 0 <= workers <= MOST_WORKERS:
        raise BadInput("--workers", "", workers, f"must be from 0 (one a core) to {MOST_WORKERS}")
    out = out.resolve()
    ledger = Ledger(out)
    before = _done(tasks, ledger, recorded)
    settle()
    finished = {task.id for task in before}
    todo = [task for task in tasks if task.id not in finished and task.stage in stages]
    _refuse_gaps(todo, tasks, finished)
    summary = Summary(before, [], [], [])
    if not todo:
        return summary

    board = Board(todo, form_of(progress, console or Terminal(stderr=True)))
    external = bool(scheduler.address)
    slots = min(workers or cores(), len(todo))
    with connected(scheduler, slots, board.say) as client, board:
        crew = Workers(client, external, board.say)
        crew.look(now=True)
        board.tally.workers = len(crew.accepted)
        if preparations := prepare(todo):
            _prepare(client, crew, preparations, board)
        client.subscribe_topic(TOPIC, board.hear)
        dispatch = Dispatch(client, crew, out, uuid.uuid4().hex)
        board.start(len(crew.accepted), dashboard_of(client) if external else None)
        book = _Book(Ready(todo, finished), summary, stages, board)
        inputs = Inputs(tasks, ledger)
        loop = _Loop(book, crew, dispatch, Bundles(), board, ledger, inputs, recorded, settle)
        try:
            loop.run()
        finally:
            settle()
    book.close()
    return summary


class _Book:
    """Tasks of a run that are left to do and that are done; tasks that are done once more."""

    def __init__(self, ready: Ready, summary: Summary, stages: Sequence[Stage], board: Board) -> None:
        self.ready, self.summary = ready, summary
        self._stages, self._board = stages, board
        self._failed_once: set[str] = set()
        self._lost: list[Task] = []  # damaged products of stages that do not run
        self.failed_on: dict[str, list[str]] = {}
        """Workers on which a task has failed that is tried again, by its id."""

    def once_more(self, task: Task) -> bool:
        """Note that a task has failed; return whether it is the first time."""
        first = task.id not in self._failed_once
        self._failed_once.add(task.id)
        return first

    def reopen(self, tasks: Sequence[Task]) -> None:
        """Do tasks again whose products were damaged and are removed."""
        ids = {task.id for task in tasks}
        for done in (self.summary.before, self.summary.ran):
            done[:] = [one for one in done if one.id not in ids]
        for task in tasks:
            if task.stage not in self._stages:
                self._lost.append(task)
                self.ready.lose(task)
                continue
            self.ready.reopen(task)
            self._board.say(f"{task.stage} {task.title}: damaged, made again")
            self._board.add(task)

    def try_again(self, task: Task, outcome: Outcome) -> bool:
        """Put a task back if it failed by an exception that may not occur again, or never began."""
        if not outcome.traceback and not outcome.refused:
            return False
        tried = self.failed_on.setdefault(task.id, [])
        tried.append(outcome.worker)
        if len(tried) == _TRIES:
            return False
        self.ready.again(task)
        self._board.again(task, outcome.reason)
        return True

    def close(self) -> None:
        """List what waits for tasks that failed; WorkFailed if products of a stage that does not run were damaged."""
        if self._lost:
            first = self._lost[0]
            allowed = f"run `twillight {first.stage}` first"
            raise WorkFailed(f"{first.title}: its products were damaged and are removed; {allowed}")
        self.summary.waiting.extend(self.ready.waiting)


class _Loop(NamedTuple):
    """The driver's loop: start what is ready, take what has ended."""

    book: _Book
    crew: Workers
    dispatch: Dispatch
    bundles: Bundles
    board: Board
    ledger: Ledger
    inputs: Inputs
    recorded: Recorded
    settle: Callable[[], None]

    def run(self) -> None:
        """Work until no task is left that can start."""
        while True:
            self.crew.look()
            self.board.tally.workers = len(self.crew.accepted)
            started = self._start()
            if not self.book.ready.running:
                if started:
                    continue  # damaged inputs are made first
                break  # what is left waits for tasks that failed
            ended = self.dispatch.ended(_SECONDS_BETWEEN_LOOKS)
            for task, _ in ended:
                self.book.ready.free(task)
            self._start(alone=False)  # workers have something to do while receipts are written
            for task, outcome in ended:
                if outcome is None:
                    self.book.ready.again(task)
                    continue
                outcome = _verified(task, outcome, self.ledger.out)
                if not outcome.reason:
                    self.bundles.ended(task, outcome.seconds)
                self._take(task, outcome)
            self.board.waiting_for(self.dispatch.running, workers=len(self.crew.accepted))

    def _start(self, alone: bool = True) -> list[Task]:
        """Start as many tasks as there are slots, and return them."""
        ready, failed_on, slots = self.book.ready, self.book.failed_on, self.crew.slots
        size, bundle = self.bundles.size, list[Task]()
        started = ready.take(slots, alone, size * (slots + self.crew.spare) - slots)
        for task in started:
            if found := self.inputs.damaged(task):
                self.book.reopen(found)
                ready.again(task)
                continue
            if task.needs:
                self.settle()
            self.board.begin(task)
            if size == 1 or task.id in failed_on or not self.bundles.allows(task):
                self.dispatch.start([task], self.inputs.hashes(task), failed_on.get(task.id, ()))
                continue
            bundle.append(task)
            if len(bundle) == size:
                self.dispatch.start(bundle, {})
                bundle = []
        if bundle:
            self.dispatch.start(bundle, {})
        return started

    def _take(self, task: Task, outcome: Outcome) -> None:
        """Write the receipt of a task that is done, try it again, or note why it failed."""
        book, reason = self.book, outcome.reason
        if outcome.storage_failed:
            patience.give_up()
            raise WorkFailed(reason)
        if outcome.refused:
            self.crew.recheck(outcome.worker)
        elif reason and book.once_more(task) and (found := self.inputs.damaged(task, anew=True)):
            book.reopen(found)
            book.ready.again(task)
            self.board.again(task, reason)
            return
        if book.try_again(task, outcome):
            return
        if reason:
            times = len(book.failed_on.get(task.id, ()))
            reason = f"{reason}; tried {times} times" if times > 1 else reason
            self.ledger.fail(task, reason, outcome.traceback)
            book.ready.fail(task)
            book.summary.failed.append(task)
        else:
            self.ledger.finish(task, outcome.files, outcome.seconds)
            self.inputs.made(task)
            book.ready.finish(task)
            self.recorded(task, outcome.files)
            book.summary.ran.append(task)
        self.board.end(task, reason)


def _done(tasks: Sequence[Task], ledger: Ledger, recorded: Recorded) -> list[Task]:
    """Return the tasks that are done, some by the products of another data set."""
    before = []
    for task in tasks:
        done = ledger.done(task) is not None
        if not done and ledger.adopt(task):
            recorded(task, ledger.products(task))  # to whom it was not there a moment ago
            done = True
        if done:
            before.append(task)
    return before


def _prepare(client: Any, crew: Workers, preparations: Sequence[Preparation], board: Board) -> None:
    """Compile kernels in all workers at once and show how far it is.

    A failure here occurs again in the task that needs the kernel, and is reported there.
    """
    shown = board.compiling(len(preparations))
    client.subscribe_topic(KERNELS, shown.hear)
    waiting, running = list(preparations), dict[Any, str]()
    while waiting or running:
        crew.look()
        while waiting and len(running) < crew.threads:
            one = waiting.pop(0)
            running[client.submit(_prepare_one, one, pure=False, **crew.restriction(()))] = one.name
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


def _verified(task: Task, outcome: Outcome, out: Path) -> Outcome:
    """Return the outcome, a failure if this process does not find the products that the worker measured."""
    if outcome.reason:
        return outcome
    for path in task.products:
        expected = outcome.files[Path(path).name]
        try:
            # In object storage its size is enough: whoever fetches a file compares its hash.
            as_written = measure(out / path) == expected if is_local(out) else size_of(out / path) == expected.bytes
        except OSError as error:
            if not is_local(out) and not isinstance(error, FileNotFoundError):
                raise  # it is the storage that fails
            reason = f"{path} was written where this process does not see it: every worker must see --out, {out}"
            return outcome._replace(reason=reason)
        if not as_written:
            return outcome._replace(reason=f"{path} is not the file that its worker wrote: every worker must see {out}")
    return outcome


def _ended(running: Iterable[Any]) -> list[Any]:
    """Wait a while until at least one of these futures has ended, and return those that have."""
    from distributed import wait

    try:
        return list(wait(list(running), timeout=LOOK, return_when="FIRST_COMPLETED").done)  # type: ignore[no-untyped-call]
    except TimeoutError:
        return []
