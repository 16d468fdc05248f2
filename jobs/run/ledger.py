"""Ledger: which tasks are done, failed or missing, from the files alone.

A receipt ``ledger/<task id>.json`` lists a task's products with their sizes and hashes; it is written after them,
whole or not at all. A task is done exactly when its receipt and every product, of the listed size, are there. No other
state is kept, so nothing has to be repaired after a kill. In object storage the files are looked up in a snapshot
(`jobs.run.workspace`).
"""

from __future__ import annotations

import glob
import json
import math
import time
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final, Literal

from filelock import FileLock, Timeout

from jobs.plan.dataset import DATASETS
from jobs.plan.task import Task
from jobs.run.receipt import Product, Receipt, leaves, read_receipt
from jobs.run.workspace import LEDGER, Snapshot, workspace_of
from pipeline.atomic import atomic_write, link
from pipeline.fingerprint import file_sha256
from pipeline.storage import is_local
from weaves.errors import BadInput, WorkFailed
from weaves.reading import MIB, read_json

State = Literal["done", "failed", "missing"]

_SECONDS_BETWEEN_SYNCS: Final = 1.0


class Ledger:
    """The receipts and failure notes of one output folder."""

    def __init__(self, out: Path) -> None:
        self.out = out
        self.folder = out / LEDGER
        self._snapshot = None if is_local(out) else Snapshot(out)
        self._synced = -math.inf

    def exists(self) -> bool:
        """Return whether any run has worked in the folder."""
        return self.folder.is_dir() if self._snapshot is None else self._snapshot.size(f"{LEDGER}/lock") is not None

    def receipts(self, tasks: Iterable[str]) -> Iterator[Receipt]:
        """Yield every valid receipt of the folder but those of some tasks, given by their ids."""
        if self._snapshot is None:
            found = [path.stem for path in self.folder.glob("[!.]*.json")]
        else:
            found = list(self._snapshot.ids())
        others = set(found) - set(tasks)
        for name in sorted(name for name in others if "." not in name):
            if receipt := read_receipt(self._copy(f"{LEDGER}/{name}.json"), name):
                yield receipt

    def state(self, task: Task) -> State:
        """Return the state of a task, from its files."""
        if self.done(task):
            return "done"
        return "failed" if self.size(self._note(task)) is not None else "missing"

    def size(self, path: str) -> int | None:
        """Return the size of a file in bytes, given by its path relative to the output folder; None if not there."""
        if self._snapshot is not None:
            return self._snapshot.size(path)
        try:
            return (self.out / path).stat().st_size
        except OSError:
            return None

    def is_file(self, path: str) -> bool:
        """Return whether there is such a file, given by its path relative to the output folder."""
        return (self.out / path).is_file() if self._snapshot is None else self._snapshot.size(path) is not None

    def done(self, task: Task) -> Receipt | None:
        """Return the receipt of a task if it is done: every product is there and has the listed size."""
        receipt = self.receipt(task)
        return receipt if receipt and all(self._is_whole(path, receipt) for path in task.products) else None

    def is_sound(self, task: Task) -> bool:
        """Return whether a task is done and its products have the bytes that are on its receipt; they are read."""
        receipt = self.receipt(task)
        return receipt is not None and all(self._is_whole(path, receipt, True) for path in task.products)

    def receipt(self, task: Task) -> Receipt | None:
        """Return a task's receipt; None if there is none, or no valid one."""
        return read_receipt(self._copy(self.receipt_path(task)), task.id)

    def places(self, receipt: Receipt) -> Iterator[str]:
        """Yield the paths of the existing files that a receipt is about, relative to the output folder."""
        folders = {
            "generate": f"{DATASETS}/*",
            "train": f"models/*-{receipt.task[:8]}",
            "bench": "records",
            "report": f"report/{glob.escape(receipt.title.removeprefix('page of '))}",
        }
        for name in receipt.files:
            yield from self._named(folders.get(receipt.stage, "none"), name)

    def paths(self, folders: Iterable[str]) -> Iterator[str]:
        """Yield the paths of all files in or below some folders."""
        if self._snapshot is not None:
            yield from self._snapshot.below(folders)
            return
        for folder in folders:
            yield from (str(path.relative_to(self.out)) for path in (self.out / folder).rglob("*") if path.is_file())

    def take(self, receipt: Receipt) -> None:
        """Write a receipt of another folder, after its products."""
        atomic_write(self.folder / f"{receipt.task}.json", receipt.encoded())

    def receipt_path(self, task: Task) -> str:
        """Return the path of a task's receipt, relative to the output folder."""
        return f"{LEDGER}/{task.id}.json"

    def products(self, task: Task) -> dict[str, Product]:
        """Return the products of a done task by file name, as its receipt lists them."""
        receipt = self.receipt(task)
        return receipt.files if receipt else {}

    def seconds(self, task: Task) -> float:
        """Return how long a done task took; 0 when it is not done."""
        receipt = self.receipt(task)
        return receipt.seconds if receipt else 0.0

    def reason(self, task: Task) -> str:
        """Return why a task failed; empty when it did not."""
        return str(self._read(self._copy(self._note(task))).get("reason", ""))

    def finish(self, task: Task, files: Mapping[str, Product], seconds: float) -> None:
        """Write a task's receipt and forget that it ever failed.

        It waits for the disk once a second at most. After a loss of power some of the last receipts may be missing;
        their tasks run again.
        """
        identity = leaves(task.identity())
        receipt = Receipt(**_heading(task), files=dict(files), seconds=round(seconds, 3), identity=identity)
        durable = (now := time.monotonic()) - self._synced >= _SECONDS_BETWEEN_SYNCS
        self._synced = now if durable else self._synced
        content = receipt.sealed()
        atomic_write(self.out / self.receipt_path(task), content, durable=durable)
        if self._snapshot is not None:
            self._snapshot.wrote_copy(self.receipt_path(task), content)
            for path in task.products:
                self._snapshot.wrote(path, files[Path(path).name].bytes)
        self.remove(self._note(task))

    def fail(self, task: Task, reason: str, traceback: str = "") -> None:
        """Note why a task failed."""
        note = {**_heading(task), "reason": reason, "traceback": traceback}
        content = json.dumps(note, indent=1).encode() + b"\n"
        atomic_write(self.out / self._note(task), content)
        if self._snapshot is not None:
            self._snapshot.wrote_copy(self._note(task), content)

    def remove(self, path: str) -> None:
        """Remove a file if it is there, given by its path relative to the output folder."""
        if self._snapshot is None:
            (self.out / path).unlink(missing_ok=True)
        elif self._snapshot.size(path) is not None:
            (self.out / path).unlink(missing_ok=True)
            self._snapshot.removed(path)

    def adopt(self, task: Task) -> bool:
        """Take a task's products from another data set; return whether the task is then done.

        Data sets share shards (the same id is the same bytes), yet each folder is whole, so that it can be copied
        away; a hard link costs no space.
        """
        receipt = self.receipt(task)
        if receipt is None:
            return False
        for path in task.products:
            if self._is_whole(path, receipt):
                continue
            source = next((file for file in self._copies(path) if self._is_whole(file, receipt, verify=True)), None)
            if source is None:
                return False
            link(self.out / source, self.out / path)
            if self._snapshot is not None:
                self._snapshot.wrote(path, receipt.files[Path(path).name].bytes)
        return self.done(task) is not None

    def is_elsewhere(self, task: Task) -> bool:
        """Return whether a task that is not done here has products of the right size in other data sets."""
        receipt = self.receipt(task)
        return receipt is not None and all(
            any(self._is_whole(file, receipt) for file in (path, *self._copies(path))) for path in task.products
        )

    def discard(self, task: Task) -> list[str]:
        """Remove the products of a done task that are not those of its receipt; return their paths.

        The task then counts as missing. Damaged copies in other data sets go too: they may be links to the same bytes.
        """
        receipt, removed = self.receipt(task), []
        for path in task.products if receipt else ():
            for file in {path, *self._copies(path)}:
                if self.is_file(file) and receipt and not self._is_whole(file, receipt, verify=True):
                    self.remove(file)
                    removed.append(file)
        return sorted(removed)

    @contextmanager
    def held(self) -> Iterator[None]:
        """Keep other runs out of this folder for as long as this process lives.

        Raises
        ------
        BadInput
            If the folder cannot be created or written.
        WorkFailed
            If another run is at work there.
        """
        # A lock in object storage would outlive a killed run: there, only runs of this machine and user are kept out.
        folder = self.folder if is_local(self.out) else workspace_of(self.out)
        try:
            folder.mkdir(parents=True, exist_ok=True)
            lock = FileLock(folder / "lock", blocking=False)
            lock.acquire()
        except Timeout as error:
            allowed = "another run is at work in this folder; wait for it, or choose another --out"
            raise WorkFailed(f"{self.out}: {allowed}") from error
        except OSError as error:
            allowed = "--out must name a folder that can be written"
            raise BadInput(str(self.out), "", error.strerror or error, allowed) from error
        try:
            if not is_local(self.out):
                (self.folder / "lock").write_bytes(b"")  # a bucket that refuses it is reported before work begins
            yield
        finally:
            lock.release()

    def _copies(self, path: str) -> list[str]:
        """Return the files of a shard's name in all data sets; none for the products of other tasks."""
        return self._named(f"{DATASETS}/*", Path(path).name) if path.startswith(f"{DATASETS}/") else []

    def _named(self, folder: str, name: str) -> list[str]:
        """Return the paths of all files of a name in the folders of a pattern."""
        if self._snapshot is not None:
            return self._snapshot.named(folder, name)
        found = self.out.glob(f"{folder}/{glob.escape(name)}")
        return sorted(str(path.relative_to(self.out)) for path in found)

    def _copy(self, path: str) -> Path:
        """Return a file of this machine with the content of a file of the ledger."""
        return self.out / path if self._snapshot is None else self._snapshot.copy(path)

    def _note(self, task: Task) -> str:
        return f"{LEDGER}/{task.id}.failed.json"

    def _is_whole(self, path: str, receipt: Receipt, verify: bool = False) -> bool:
        expected = receipt.files.get(Path(path).name)
        if expected is None or self.size(path) != expected.bytes:
            return False
        try:
            return not verify or file_sha256(self.out / path) == expected.sha256
        except FileNotFoundError:
            return False
        except OSError:
            if self._snapshot is None:
                return False
            raise  # a storage that fails has not lost the file

    @staticmethod
    def _read(path: Path) -> dict[str, Any]:
        """Return the note of a failure; empty if it is missing or not readable."""
        try:
            content = read_json(path, MIB, "a note of a failure")
        except (OSError, BadInput):
            return {}
        return content if isinstance(content, dict) else {}


def _heading(task: Task) -> dict[str, str]:
    return {"task": task.id, "stage": task.stage, "title": task.title}
