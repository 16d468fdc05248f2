"""Workspace of a task: the folder in which it runs.

If the products are in a folder, it is that one. If they are in object storage, it is a folder of this machine and user:
the products that the task needs are fetched into it and compared with their receipts, and those that it makes are
stored. Nothing in it is needed again: it may be removed at any time, and saves time as long as it is there.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from filelock import FileLock

from jobs.plan.dataset import DATASETS
from jobs.plan.task import Task
from pipeline import patience, storage
from pipeline.fingerprint import file_sha256, fingerprint
from weaves.errors import BadInput, WorkFailed


@contextmanager
def workspace(task: Task, out: Path, inputs: Mapping[str, str]) -> Iterator[Path]:
    """Yield the folder in which a task runs; afterwards its products are where they belong.

    Parameters
    ----------
    task : Task
        The task.
    out : Path
        Place of all products.
    inputs : mapping
        Hashes of the products that it needs, by path; empty if the hash is not known. Read only for object storage.

    Raises
    ------
    WorkFailed
        If an input does not have its hash.
    """
    if storage.is_local(out):
        yield out
        return
    from pipeline.shards.manifest import FILE

    patience.expect()  # the driver was answered
    folder = workspace_of(out)
    for path, sha256 in inputs.items():
        _fetch(out, folder, path, sha256)
    for parent in sorted({str(Path(path).parent) for path in inputs if path.startswith(f"{DATASETS}/")}):
        _fetch(out, folder, f"{parent}/{FILE}", "")  # it grows
    yield folder
    for path in task.written(folder):
        storage.store(folder / path, out / path)


def workspace_of(out: Path) -> Path:
    """Return the folder of this machine and user for an address, made if it is missing; BadInput if it cannot be."""
    cache = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    folder = cache / "twillight" / fingerprint(str(out))
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    except OSError as error:  # no folder of all users instead: a stranger may have put files there
        allowed = "XDG_CACHE_HOME must name a folder that can be written"
        raise BadInput(str(cache), "", error.strerror or error, allowed) from error
    return folder


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
