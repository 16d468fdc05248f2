"""Products in object storage, seen from this machine: the workspace of a task, and a snapshot of all files.

A workspace is the folder in which a task runs. If the products are in a folder, it is that one. If they are in object
storage, it is a folder of this machine and user: the products that the task needs are fetched into it and compared with
their receipts, and those that it makes are stored. Nothing in it is needed again: it may be removed while no run uses
it, and saves time as long as it is there.

Each question to a storage is a request over the network. A snapshot lists 1000 files at a time, and fetches many
receipts at the same time into the workspace, and again only when their version changes.
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from fnmatch import fnmatchcase
from pathlib import Path
from threading import Lock
from typing import Final

from filelock import FileLock

from jobs.plan.dataset import DATASETS
from jobs.plan.task import Task
from pipeline import patience, storage
from pipeline.atomic import atomic_write
from pipeline.fingerprint import file_sha256, fingerprint
from weaves.errors import BadInput, WorkFailed

LEDGER: Final = "ledger"
"""Folder of the receipts, relative to the output folder."""

_FOLDERS: Final = (LEDGER, DATASETS, "models", "records", "report")


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


class Snapshot:
    """The files of an output folder when they were first needed, and what this process has written since.

    Parameters
    ----------
    out : Path
        The output folder, in object storage.
    """

    def __init__(self, out: Path) -> None:
        self._out = out
        self._lock = Lock()
        self._sizes: dict[str, int] = {}
        self._copies: dict[str, Path] = {}  # of the files of the ledger
        self._places: dict[str, list[str]] = {}  # paths by file name
        self._is_read = False

    def size(self, path: str) -> int | None:
        """Return the size of a file in bytes; None if there is none."""
        self._read()
        return self._sizes.get(path)

    def copy(self, path: str) -> Path:
        """Return the local copy of a file of the ledger, which exists if the file does."""
        self._read()
        return self._copies.get(path, self._folder / "none")

    def named(self, folder: str, name: str) -> list[str]:
        """Return the paths of all files of a name in the folders of a pattern."""
        self._read()
        return sorted(path for path in self._places.get(name, ()) if fnmatchcase(str(Path(path).parent), folder))

    def below(self, folders: Iterable[str]) -> Iterator[str]:
        """Yield the paths of all files in or below some folders."""
        self._read()
        wanted = set(folders)
        yield from (path for path in self._sizes if any(str(parent) in wanted for parent in Path(path).parents))

    def ids(self) -> Iterator[str]:
        """Yield the names of all receipts and notes of failures, without their ending."""
        self._read()
        yield from (Path(path).stem for path in list(self._copies))

    def wrote(self, path: str, size: int) -> None:
        """Note that a file was written."""
        self._read()
        if path not in self._sizes:
            self._places.setdefault(Path(path).name, []).append(path)
        self._sizes[path] = size

    def wrote_copy(self, path: str, content: bytes) -> None:
        """Note that a file of the ledger was written, with its content."""
        self.wrote(path, len(content))
        copy = self._folder / "new" / Path(path).name  # its version is not known
        atomic_write(copy, content, durable=False)
        self._copies[path] = copy

    def removed(self, path: str) -> None:
        """Note that a file was removed."""
        self._read()
        self._copies.pop(path, None)
        if self._sizes.pop(path, None) is not None:
            self._places[Path(path).name].remove(path)

    @property
    def _folder(self) -> Path:
        """Folder of the copies."""
        return workspace_of(self._out) / "receipts"

    def _read(self) -> None:
        """List the files and fetch new receipts, once."""
        with self._lock:
            if self._is_read:
                return
            for folder in _FOLDERS:
                for name, stored in storage.listing(self._out / folder).items():
                    path = f"{folder}/{name}"
                    self._sizes[path] = stored.bytes
                    self._places.setdefault(Path(path).name, []).append(path)
                    if folder == LEDGER and path.endswith(".json"):
                        self._copies[path] = self._folder / f"{Path(name).stem}.{stored.version}.json"
            self._fetch()
            self._is_read = True

    def _fetch(self) -> None:
        """Fetch the receipts that are new, and remove copies that are out of date."""
        self._folder.mkdir(parents=True, exist_ok=True)
        kept = {path.name for path in self._folder.iterdir()}
        wanted = {path: copy for path, copy in self._copies.items() if copy.name not in kept}
        with tempfile.TemporaryDirectory(prefix=".tmp-", dir=self._folder) as name:
            targets = {path: Path(name) / copy.name for path, copy in wanted.items()}
            storage.fetch_all(self._out, targets)
            for path, target in targets.items():
                target.replace(wanted[path])
        current = {copy.name for copy in self._copies.values()}
        for name in kept - current:
            if name.endswith(".json"):
                (self._folder / name).unlink(missing_ok=True)
