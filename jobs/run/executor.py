"""Execution: ready tasks go to dask.distributed, most urgent first, and the driver alone writes the ledger.

A receipt is on the disk before any task that needs it starts, so a run that is stopped or killed at any moment loses
only the tasks under way. A worker that dies is replaced and its task given to another (dask's retry).
The inputs of a task are compared with their receipts before it starts; damaged ones are removed and made again.
On this machine one task a core is handed out at a time: dask, which cannot know how long a task takes, would park short
ones behind a training. A task that measures time starts when nothing else runs, in a process of its own
(`jobs.run.outcome`).
"""

from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, NamedTuple

from rich.console import Console

from jobs.plan.ready import Ready
from jobs.plan.schedule import Estimate
from jobs.plan.task import STAGES, Stage, Task
from jobs.run.cluster import HERE, MOST_WORKERS, Scheduler, connected
from jobs.run.compiling import kernel_groups
from jobs.run.crew import Crew, Serial
from jobs.run.ledger import Ledger
from jobs.run.manifest_file import ManifestFile
from jobs.run.outcome import Outcome
from jobs.run.progress import Board
from jobs.run.progress_forms import ProgressForm, form_of
from jobs.run.receipt import Product
from jobs.terminal import Terminal
from pipeline import patience
from pipeline.cores import cores
from pipeline.storage import size_of
from weaves.errors import BadInput, WorkFailed

_SECONDS_BETWEEN_LOOKS: Final = 1.0  # for workers that have come
_TRIES: Final = 3  # of a task that ends with an unexpected exception; bad input and failed work are not tried again


class RunSummary(NamedTuple):
    """Tasks of a run: done before, done by it, failed, and waiting for failed ones."""

    before: list[Task]
    ran: list[Task]
    failed: list[Task]
    waiting: list[Task]


def execute(
    tasks: Sequence[Task],
    ledger: Ledger,
    *,
    stages: Sequence[Stage] = STAGES,
    scheduler: Scheduler = HERE,
    workers: int = 0,
    serial: bool = False,
    manifests: Sequence[ManifestFile] = (),
    console: Console | None = None,
    progress: ProgressForm = "auto",
) -> RunSummary:
    """Run the unfinished tasks of some stages; what they need of other stages must be done.

    Workers of a scheduler must see the ledger's folder under its name; by default a cluster on this machine of so many
    workers with one thread each, 0: one a core, ends with this process. `serial`: no cluster, and this process does one
    task after the other, beside other such processes in the same folder. Manifests list the shards that are made, or
    taken from another data set; they are whole when a task starts that needs others, and at the end. BadInput if the
    number of workers or the scheduler cannot be used; WorkFailed if a needed task of another stage is not done, the
    workers cannot start or have other software, or the scheduler is lost.
    """
    if not 0 <= workers <= MOST_WORKERS:
        raise BadInput("--workers", "", workers, f"must be from 0 (one a core) to {MOST_WORKERS}")
    estimate, summary = Estimate(), RunSummary([], [], [], [])
    for task in tasks:
        receipt = ledger.done(task)
        if not receipt and (receipt := ledger.adopt(task)):
            for manifest in manifests:
                manifest.add(task, receipt.files)  # to which it was not there a moment ago
        if receipt:
            summary.before.append(task)
            estimate.learn(task, receipt.seconds)
    for manifest in manifests:
        manifest.save()
    finished = {task.id for task in summary.before}
    todo = [task for task in tasks if task.id not in finished and task.stage in stages]
    planned = {task.id: task for task in tasks}
    _refuse_gaps(todo, planned, finished)
    if not todo:
        return summary

    board = Board(todo, estimate, form_of(progress, console or Terminal(stderr=True)))
    count = min(workers or cores(), len(todo))
    cluster: AbstractContextManager[Any] = nullcontext() if serial else connected(scheduler, count, board.say)
    with cluster as client, board:
        crew: Crew | Serial
        crew = Serial(ledger, board.hear) if serial else Crew(client, bool(scheduler.address), board.hear)
        groups = kernel_groups(todo)
        board.workers = len(crew.accepted)
        crew.compile(groups, lambda done, under_way: board.compiling(done, len(groups), under_way))
        if groups:
            board.compiling(len(groups), len(groups), ())
        board.start(len(crew.accepted), crew.dashboard)
        driver = _Driver(planned, Ready(todo, finished), crew, ledger, board, stages, summary, manifests)
        try:
            driver.run()
        finally:
            driver.settle()
    driver.close()
    return summary


@dataclass
class _Driver:
    """The loop of a run: start what is ready, take what has ended."""

    tasks: Mapping[str, Task]
    ready: Ready
    crew: Crew | Serial
    ledger: Ledger
    board: Board
    stages: Sequence[Stage]
    summary: RunSummary
    manifests: Sequence[ManifestFile]
    lost: list[Task] = field(default_factory=list)  # damaged products of stages that do not run
    failed_on: dict[str, list[str]] = field(default_factory=dict)  # workers, by the id of a task that is tried again
    failed_once: set[str] = field(default_factory=set)

    def run(self) -> None:
        while True:
            self.crew.look()
            self.board.workers = len(self.crew.accepted)
            started = self._start()
            if not self.ready.running:
                if started:
                    continue  # damaged inputs are made first
                return  # what is left waits for tasks that failed
            ended = self.crew.ended(_SECONDS_BETWEEN_LOOKS)
            for task, _ in ended:
                self.ready.free(task)
            self._start(alone=False)  # workers have something to do while receipts are written
            for task, outcome in ended:
                self._take(task, _verified(task, outcome, self.ledger))
            self.board.waiting_for(self.ready.running)

    def settle(self) -> None:
        for manifest in self.manifests:
            manifest.save()

    def close(self) -> None:
        """List what waits for tasks that failed; WorkFailed if products of a stage that does not run were damaged."""
        if self.lost:
            damage = f"{self.lost[0].title}: its products were damaged and are removed"
            raise WorkFailed(f"{damage}; run `twillight {self.lost[0].stage}` first")
        self.summary.waiting.extend(self.ready.waiting)

    def _start(self, alone: bool = True) -> list[Task]:
        started = self.ready.take(self.crew.slots, alone)
        for task in started:
            if damaged := self.ledger.damaged(self._needs(task)):
                self._reopen(damaged)
                self.ready.again(task)
                continue
            if task.needs:
                self.settle()
            self.board.begin(task)
            self.crew.start(task, str(self.ledger.out.resolve()), self._hashes(task), self.failed_on.get(task.id, ()))
        return started

    def _needs(self, task: Task) -> list[Task]:
        return [self.tasks[need] for need in task.needs if need in self.tasks]

    def _hashes(self, task: Task) -> dict[str, str]:
        """Return the hashes of the products that a task needs, by path, for workers that fetch them."""
        if self.ledger.store.is_local:
            return {}
        hashes = dict[str, str]()
        for need in self._needs(task):
            files = receipt.files if (receipt := self.ledger.receipt(need)) else {}
            hashes |= {path: files[Path(path).name].sha256 for path in need.products if Path(path).name in files}
        return hashes

    def _take(self, task: Task, outcome: Outcome) -> None:
        """Write the receipt of a task that is done, try it again, or note why it failed."""
        if outcome.storage_failed:
            patience.give_up()
            raise WorkFailed(outcome.reason)
        if outcome.refused:
            self.crew.recheck(outcome.worker)
        if not outcome.reason:
            self.ledger.finish(task, outcome.files, outcome.seconds)
            self.ready.finish(task)
            for manifest in self.manifests:
                manifest.add(task, outcome.files)
            self.summary.ran.append(task)
            self.board.end(task, seconds=outcome.seconds)
        elif self._again(task, outcome):
            self.ready.again(task)
            self.board.end(task, outcome.reason, again=True)
        else:
            times = len(self.failed_on.get(task.id, ()))
            reason = f"{outcome.reason}; tried {times} times" if times > 1 else outcome.reason
            self.ledger.fail(task, reason, outcome.traceback)
            self.summary.failed.append(task)
            self.board.end(task, reason)

    def _again(self, task: Task, outcome: Outcome) -> bool:
        """Return whether to try a failed task again: it may have read damaged inputs, or not fail elsewhere."""
        first = task.id not in self.failed_once
        if not outcome.refused:
            self.failed_once.add(task.id)
            if first and (damaged := self.ledger.damaged(self._needs(task), anew=True)):
                self._reopen(damaged)
                return True
        if not outcome.traceback and not outcome.refused:
            return False
        self.failed_on.setdefault(task.id, []).append(outcome.worker)
        return len(self.failed_on[task.id]) < _TRIES

    def _reopen(self, tasks: Sequence[Task]) -> None:
        """Do tasks again whose products were damaged and are removed."""
        ids = {task.id for task in tasks}
        for done in (self.summary.before, self.summary.ran):
            done[:] = [task for task in done if task.id not in ids]
        for task in tasks:
            if task.stage in self.stages:
                self.ready.reopen(task)
                self.board.say(f"{task.stage} {task.title}: damaged, made again")
                self.board.add(task)
            else:
                self.lost.append(task)
                self.ready.lose(task)


def _refuse_gaps(todo: Sequence[Task], planned: Mapping[str, Task], finished: set[str]) -> None:
    """Refuse to start if a product is missing of a stage that does not run."""
    if gaps := {need for task in todo for need in task.needs} - finished - {task.id for task in todo}:
        stage = min((planned[need].stage for need in gaps), key=STAGES.index)
        count = sum(planned[need].stage == stage for need in gaps)
        way = f"run `twillight {stage}` with this recipe first"
        raise WorkFailed(f"{todo[0].stage}: {count} tasks that it needs are not done; {way}")


def _verified(task: Task, outcome: Outcome, ledger: Ledger) -> Outcome:
    """Return the outcome, a failure if this process does not find the products that the worker measured."""
    if outcome.reason:
        return outcome
    out, local = ledger.out, ledger.store.is_local
    for path in task.products:
        expected = outcome.files[Path(path).name]
        try:
            # In object storage its size is enough: whoever fetches a file compares its hash.
            if Product.of(out / path) == expected if local else size_of(out / path) == expected.bytes:
                continue
            reason = f"{path} is not the file that its worker wrote: every worker must see {out}"
        except OSError as error:
            if not local and not isinstance(error, FileNotFoundError):
                raise  # it is the storage that fails
            reason = f"{path} was written where this process does not see it: every worker must see --out, {out}"
        return outcome._replace(reason=reason)
    return outcome
