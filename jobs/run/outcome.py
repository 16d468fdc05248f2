"""Do one task and measure its products. A failure becomes a reason, never an exception, so it can cross processes."""

from __future__ import annotations

import time
import traceback
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple

from filelock import FileLock

from jobs.plan.dataset import DATASETS
from jobs.plan.task import Progress, Task
from jobs.run.receipt import Product
from pipeline import patience, storage
from pipeline.fingerprint import file_sha256, fingerprint
from pipeline.own_process import ProcessEnded, in_own_process
from weaves.errors import BadInput, WorkFailed


class Outcome(NamedTuple):
    """Result of a task: its products, or the reason of its failure."""

    files: Mapping[str, Product] = MappingProxyType({})
    seconds: float = 0.0
    reason: str = ""  # one line; empty if the task is done
    traceback: str = ""
    """That of an unexpected exception, which may not occur elsewhere; empty for bad input and for work that failed."""
    worker: str = ""  # address of the worker; empty if it is not known
    refused: bool = False
    """True if nothing was computed: the worker's software is not the driver's, or the worker died before."""
    storage_failed: bool = False
    """True if the storage failed for longer than it is waited for, or refused: no other task can be done either."""

    @classmethod
    def failed(cls, error: BaseException) -> Outcome:
        """Return the outcome of a task that an exception has ended."""
        trace = "".join(traceback.format_exception(error))
        if isinstance(error, BadInput | WorkFailed):
            kept = trace if isinstance(error, ProcessEnded) else ""
            return cls(reason=str(error), traceback=kept, storage_failed=isinstance(error, patience.StorageFailed))
        message = str(error).strip().partition("\n")[0]
        return cls(reason=": ".join(filter(None, (type(error).__name__, message))), traceback=trace)


def work(
    task: Task, out: Path, progress: Progress, inputs: Mapping[str, str] = MappingProxyType({}), threads: int = 1
) -> Outcome:
    """Do a task, in a process of its own if it measures time, or must not share one with other tasks.

    `inputs` are the hashes of the products that it needs, by path, as far as they are known; they are read only for
    object storage. This process may do as many tasks at the same time as it has `threads`.
    """
    own = task.slots == "all" or (threads > 1 and not task.shares_process)
    start = time.perf_counter()
    try:
        with _workspace(task, out, inputs) as folder:
            in_own_process(task.run, folder, progress=progress) if own else task.run(folder, progress)
            outcome = Outcome({Path(path).name: Product.of(folder / path) for path in task.products})
    except Exception as error:
        known = storage.is_local(out) or isinstance(error, BadInput | WorkFailed)
        explained = None if known else storage.explained(error)
        outcome = Outcome(reason=str(explained), storage_failed=True) if explained else Outcome.failed(error)
    return outcome._replace(seconds=time.perf_counter() - start)


@contextmanager
def _workspace(task: Task, out: Path, inputs: Mapping[str, str]) -> Iterator[Path]:
    """Yield the folder in which a task runs; afterwards its products are where they belong.

    For object storage it is a folder of this machine and user, into which what the task needs is fetched.
    """
    if storage.is_local(out):
        yield out
        return
    from pipeline.shards.manifest import FILE

    patience.expect()  # the driver was answered
    folder = storage.workspace(out)
    for path, sha256 in inputs.items():
        _fetch(out, folder, path, sha256)
    for parent in sorted({str(Path(path).parent) for path in inputs if path.startswith(f"{DATASETS}/")}):
        _fetch(out, folder, f"{parent}/{FILE}", "")  # it grows
    yield folder
    for path in task.written(folder):
        storage.store(folder / path, out / path)


def _fetch(out: Path, folder: Path, path: str, sha256: str) -> None:
    """Fetch a file unless it is there; two processes of a machine fetch it once."""
    target = folder / path
    target.parent.mkdir(parents=True, exist_ok=True)
    with FileLock(folder / f".lock-{fingerprint(path)}"):
        if sha256 and target.is_file() and file_sha256(target) == sha256:
            return
        temporary = target.with_name(f".tmp-{target.name}")
        try:
            storage.fetch(out / path, temporary)
        except FileNotFoundError as error:
            raise WorkFailed(f"{out / path}: it is not there any more") from error
        if sha256 and file_sha256(temporary) != sha256:
            raise WorkFailed(f"{out / path}: its bytes are not those that were written (SHA-256 differs)")
        temporary.replace(target)
