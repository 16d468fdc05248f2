"""Snapshot of an output folder in object storage: the sizes of its files, and copies of its receipts.

Each question to a storage is a request over the network. One listing answers for 1000 files. Receipts are fetched many
at the same time into the workspace of the address, and again only when their version changes.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterable, Iterator
from fnmatch import fnmatchcase
from pathlib import Path
from threading import Lock
from typing import Final

from jobs.plan.dataset import DATASETS
from jobs.run.workspace import workspace_of
from pipeline import storage
from pipeline.atomic import atomic_write

LEDGER: Final = "ledger"
"""Folder of the receipts, relative to the output folder."""

_FOLDERS: Final = (LEDGER, DATASETS, "models", "records", "report")


class Snapshot:
    """The files of an output folder when they were first asked for, and what this process has written since.

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
