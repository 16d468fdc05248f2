"""Files of an output folder, by paths relative to it: in a folder of this machine, or in object storage.

Each question to object storage is a request over the network. So its files are listed when they are first needed, 1000
a request, and the receipts fetched, many at the same time, into a folder of this machine and user; later only those
whose version has changed. That folder is also where tasks run (`jobs.run.outcome`).
"""

from __future__ import annotations

import fcntl
import glob
import shutil
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import ExitStack, contextmanager
from fnmatch import fnmatchcase
from pathlib import Path
from threading import Lock
from typing import IO, Final

from jobs.plan.dataset import DATASETS
from pipeline import storage
from pipeline.atomic import atomic_write, link
from weaves.errors import BadInput, WorkFailed

LEDGER: Final = "ledger"  # folder of the receipts, relative to the output folder

LOCKS: Final = frozenset({f"{LEDGER}/lock", f"{LEDGER}/tasks.lock"})
"""Empty files by which processes keep out of each other's way; no task makes them."""

FOLDERS: Final = (LEDGER, DATASETS, "models", "records", "entries", "report")
"""Folders of the receipts, and of the products of each stage."""


class Store:
    """The files of an output folder of this machine; only one process at a time writes through it."""

    is_local = True

    def __init__(self, out: Path) -> None:
        self.out = out

    @staticmethod
    def of(out: Path) -> Store:
        """Return the files of an output folder, also of one in object storage."""
        return Store(out) if storage.is_local(out) else _RemoteStore(out)

    def size(self, path: str) -> int | None:
        """Return the size of a file in bytes; None if there is none."""
        try:
            return (self.out / path).stat().st_size
        except OSError:
            return None

    def is_file(self, path: str) -> bool:
        """Return whether there is such a file."""
        return (self.out / path).is_file()

    def named(self, folder: str, name: str) -> list[str]:
        """Return the sorted paths of all files of a name in the folders of a pattern."""
        return sorted(str(path.relative_to(self.out)) for path in self.out.glob(f"{folder}/{glob.escape(name)}"))

    def below(self, folders: Iterable[str]) -> Iterator[str]:
        """Yield the paths of all files in or below some folders."""
        for folder in folders:
            yield from (str(path.relative_to(self.out)) for path in (self.out / folder).rglob("*") if path.is_file())

    def copy(self, path: str) -> Path:
        """Return a file of this machine with the content of a file of the ledger; it exists if the file does."""
        return self.out / path

    def write(self, path: str, content: bytes, *, durable: bool = True) -> None:
        """Write a file of the ledger, whole or not at all; `durable` as for `pipeline.atomic.atomic_path`."""
        atomic_write(self.out / path, content, durable=durable)

    def wrote(self, path: str, size: int) -> None:
        """Note that another process has written a file; a folder of this machine is looked at each time."""

    def remove(self, path: str) -> None:
        """Remove a file if it is there, and a folder in its place."""
        try:
            (self.out / path).unlink(missing_ok=True)
        except IsADirectoryError:
            shutil.rmtree(self.out / path)

    def link(self, source: str, target: str, size: int) -> None:
        """Let a second path name the bytes of a file, of this size."""
        link(self.out / source, self.out / target)
        self.wrote(target, size)

    @contextmanager
    def held(self, shared: bool = False) -> Iterator[None]:
        """Keep other runs out for as long as this process lives: in object storage, those of this machine and user.

        `shared`: others that hold the folder shared may be at work in it too, and none that holds it for itself.
        BadInput if the folder cannot be created or written; WorkFailed if another run is at work there.
        """
        with ExitStack() as stack:
            try:
                file = stack.enter_context(self._lock_file("lock"))
                fcntl.flock(file, (fcntl.LOCK_SH if shared else fcntl.LOCK_EX) | fcntl.LOCK_NB)
            except BlockingIOError as error:
                allowed = "another run is at work in this folder; wait for it, or choose another --out"
                raise WorkFailed(f"{self.out}: {allowed}") from error
            except OSError as error:
                allowed = "--out must name a folder that can be written, on a file system with locks (flock)"
                raise BadInput(str(self.out), "", error.strerror or error, allowed) from error
            yield

    @contextmanager
    def claimed(self, task: str) -> Iterator[None]:
        """Wait until no other process claims a task, given by its id, and claim it; in object storage as for `held`.

        Each task is one byte of a file, most of them beyond its end. WorkFailed if the file system has no locks.
        """
        with self._lock_file("tasks.lock") as file:
            try:
                fcntl.lockf(file, fcntl.LOCK_EX, 1, int(task[:15], 16))
            except OSError as error:
                raise WorkFailed(f"{self.out}: {error.strerror}; parts need a file system with locks") from error
            yield

    def _lock_file(self, name: str) -> IO[bytes]:
        folder = self.out / LEDGER if self.is_local else storage.workspace(self.out)
        folder.mkdir(parents=True, exist_ok=True)
        return (folder / name).open("a+b")


class _RemoteStore(Store):
    """Files in object storage as they were when they were first needed, and what this process has written since."""

    is_local = False

    def __init__(self, out: Path) -> None:
        super().__init__(out)
        self._lock = Lock()
        self._known: dict[str, int] = {}  # sizes
        self._copies: dict[str, Path] = {}  # of the files of the ledger
        self._places: dict[str, list[str]] = {}  # paths by file name
        self._is_read = False

    def size(self, path: str) -> int | None:
        return self._sizes.get(path)

    def is_file(self, path: str) -> bool:
        return path in self._sizes

    def named(self, folder: str, name: str) -> list[str]:
        self._read()
        return sorted(path for path in self._places.get(name, ()) if fnmatchcase(str(Path(path).parent), folder))

    def below(self, folders: Iterable[str]) -> Iterator[str]:
        wanted = set(folders)
        yield from [path for path in self._sizes if not wanted.isdisjoint(map(str, Path(path).parents))]

    def copy(self, path: str) -> Path:
        self._read()
        return self._copies.get(path, self._folder / "none")

    def write(self, path: str, content: bytes, *, durable: bool = True) -> None:
        super().write(path, content)
        self.wrote(path, len(content))
        copy = self._folder / "new" / Path(path).name  # its version is not known
        atomic_write(copy, content, durable=False)
        self._copies[path] = copy

    def wrote(self, path: str, size: int) -> None:
        if path not in self._sizes:
            self._places.setdefault(Path(path).name, []).append(path)
        self._known[path] = size

    def remove(self, path: str) -> None:
        if self._sizes.pop(path, None) is not None:
            super().remove(path)
            self._copies.pop(path, None)
            self._places[Path(path).name].remove(path)

    @contextmanager
    def held(self, shared: bool = False) -> Iterator[None]:
        with super().held(shared):
            # A lock here would outlive a killed run. A bucket that refuses the file is reported before work begins.
            (self.out / LEDGER / "lock").write_bytes(b"")
            yield

    @property
    def _folder(self) -> Path:
        """Folder of the copies."""
        return storage.workspace(self.out) / "receipts"

    @property
    def _sizes(self) -> dict[str, int]:
        self._read()
        return self._known

    def _read(self) -> None:
        """List the files and fetch new receipts, once."""
        with self._lock:
            if self._is_read:
                return
            for folder in FOLDERS:
                for name, stored in storage.listing(self.out / folder).items():
                    path = f"{folder}/{name}"
                    self._known[path] = stored.bytes
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
            storage.fetch_all(self.out, targets)
            for path, target in targets.items():
                target.replace(wanted[path])
        current = {copy.name for copy in self._copies.values()}
        for name in kept - current:
            if name.endswith(".json"):
                (self._folder / name).unlink(missing_ok=True)
