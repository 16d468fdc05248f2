"""Ledger: which tasks are done, failed or missing, and why they would run, from the files alone.

A receipt ``ledger/<task id>.json`` lists a task's products with their sizes and hashes; it is written after them,
whole or not at all. A task is done exactly when its receipt and every product, of the listed size, are there. No other
state is kept, so nothing has to be repaired after a kill.
"""

import glob
import json
import math
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Final, Literal

from jobs.plan.dataset import DATASETS
from jobs.plan.task import Task
from jobs.run.receipt import Product, Receipt
from jobs.run.store import LEDGER, Store
from pipeline.fingerprint import file_sha256
from weaves.errors import BadInput
from weaves.reading import MIB, read_json

State = Literal["done", "failed", "missing"]

NEVER_MADE: Final = "never made"  # reason of a task that has no predecessor

ELSEWHERE: Final = "taken from another data set"
"""Reason of a task that need not run: its products are in another data set, and a run links them."""

CHANGED: Final = "changed: "  # beginning of the reason of a task that was made before with another identity
_MOST_KEYS: Final = 3  # that a reason names
_SECONDS_BETWEEN_SYNCS: Final = 1.0


class Ledger:
    """The receipts and failure notes of one output folder."""

    def __init__(self, out: Path) -> None:
        self.out = out
        self.store = Store.of(out)
        self._synced = -math.inf
        self._sound: set[str] = set()  # tasks whose products were read, or made, by this process

    def exists(self) -> bool:
        """Return whether any run has worked in the folder."""
        return any(True for _ in self.store.below([LEDGER]))

    def receipts(self, tasks: Iterable[str]) -> Iterator[Receipt]:
        """Yield every valid receipt of the folder but those of some tasks, given by their ids."""
        names = {Path(path).stem for path in self.store.below([LEDGER]) if path.endswith(".json")}
        for name in sorted(name for name in names - set(tasks) if "." not in name):
            if receipt := Receipt.read(self.store.copy(f"{LEDGER}/{name}.json"), name):
                yield receipt

    def state(self, task: Task) -> State:
        """Return the state of a task, from its files."""
        if self.done(task):
            return "done"
        return "failed" if self.store.size(_note(task)) is not None else "missing"

    def done(self, task: Task, verify: bool = False) -> Receipt | None:
        """Return the receipt of a task if it is done: its products have the listed size, and hash if `verify`."""
        receipt = self.receipt(task)
        return receipt if receipt and all(self._is_whole(path, receipt, verify) for path in task.products) else None

    def receipt(self, task: Task) -> Receipt | None:
        """Return a task's receipt; None if there is none, or no valid one."""
        return Receipt.read(self.store.copy(self.receipt_path(task)), task.id)

    def places(self, receipt: Receipt) -> Iterator[str]:
        """Yield the paths of the existing files that a receipt is about, relative to the output folder."""
        folders = {
            "generate": (f"{DATASETS}/*",),
            "train": (f"models/*-{receipt.task[:8]}",),
            "bench": ("records", f"entries/*-{receipt.task[:8]}"),
            "report": (f"report/{glob.escape(receipt.title.removeprefix('page of '))}",),
        }
        for name in receipt.files:
            for folder in folders.get(receipt.stage, ()):
                yield from self.store.named(folder, name)

    def receipt_path(self, task: Task) -> str:
        """Return the path of a task's receipt, relative to the output folder."""
        return f"{LEDGER}/{task.id}.json"

    def seconds(self, task: Task) -> float:
        """Return how long a done task took; 0 when it is not done."""
        receipt = self.receipt(task)
        return receipt.seconds if receipt else 0.0

    def reason(self, task: Task) -> str:
        """Return why a task failed; empty when it did not."""
        try:
            content = read_json(self.store.copy(_note(task)), MIB, "a note of a failure")
        except (OSError, BadInput):
            return ""
        return str(content.get("reason", "")) if isinstance(content, dict) else ""

    def finish(self, task: Task, files: Mapping[str, Product], seconds: float) -> None:
        """Write a task's receipt and forget that it ever failed.

        It waits for the disk once a second at most. After a loss of power some of the last receipts may be missing;
        their tasks run again.
        """
        durable = (now := time.monotonic()) - self._synced >= _SECONDS_BETWEEN_SYNCS
        self._synced = now if durable else self._synced
        self.store.write(self.receipt_path(task), Receipt.of(task, files, seconds).sealed(), durable=durable)
        for path in task.products:
            self.store.wrote(path, files[Path(path).name].bytes)
        self.store.remove(_note(task))
        self._sound.add(task.id)

    def fail(self, task: Task, reason: str, traceback: str = "") -> None:
        """Note why a task failed."""
        note = {"task": task.id, "stage": task.stage, "title": task.title, "reason": reason, "traceback": traceback}
        self.store.write(_note(task), json.dumps(note, indent=1).encode() + b"\n")

    def adopt(self, task: Task) -> Receipt | None:
        """Take a task's products from another data set; return the receipt of the task if it is then done.

        Data sets share shards (the same id is the same bytes), yet each folder is whole, so that it can be copied
        away; a hard link costs no space.
        """
        receipt = self.receipt(task)
        if receipt is None:
            return None
        for path in task.products:
            if self._is_whole(path, receipt):
                continue
            source = next((file for file in self._copies(path) if self._is_whole(file, receipt, verify=True)), None)
            if source is None:
                return None
            self.store.link(source, path, receipt.files[Path(path).name].bytes)
        return self.done(task)

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
        if (receipt := self.receipt(task)) is None:
            return []
        files = {file for path in task.products for file in (path, *self._copies(path))}
        there = [file for file in sorted(files) if self.store.size(file) is not None]
        removed = [file for file in there if not self._is_whole(file, receipt, verify=True)]
        for file in removed:
            self.store.remove(file)
        return removed

    def damaged(self, tasks: Sequence[Task], *, anew: bool = False) -> list[Task]:
        """Return those done tasks whose products are damaged, and remove these products.

        With `anew` products are read too that this process has read or made before. In object storage only then: who
        fetches a file compares it.
        """
        unread = [task for task in tasks if anew or (self.store.is_local and task.id not in self._sound)]
        with ThreadPoolExecutor() as pool:
            removed = list(pool.map(self.discard, unread))
        pairs = zip(unread, removed, strict=True)
        damaged = [task for task, paths in pairs if not set(paths).isdisjoint(task.products)]
        self._sound.update(task.id for task in unread)
        self._sound.difference_update(task.id for task in damaged)
        return damaged

    def _copies(self, path: str) -> list[str]:
        """Return the files of a shard's name in all data sets; none for the products of other tasks."""
        return self.store.named(f"{DATASETS}/*", Path(path).name) if path.startswith(f"{DATASETS}/") else []

    def _is_whole(self, path: str, receipt: Receipt, verify: bool = False) -> bool:
        expected = receipt.files.get(Path(path).name)
        if expected is None or self.store.size(path) != expected.bytes:
            return False
        try:
            return not verify or file_sha256(self.out / path) == expected.sha256
        except FileNotFoundError:
            return False
        except OSError:
            if self.store.is_local:
                return False
            raise  # a storage that fails has not lost the file


def _note(task: Task) -> str:
    return f"{LEDGER}/{task.id}.failed.json"


def reasons(tasks: Sequence[Task], ledger: Ledger) -> dict[str, str]:
    """Return why each task that is not done would run, by its id.

    The predecessor of a task is the finished task of the same stage and title whose identity is most like its own.
    """
    states = {task.id: ledger.state(task) for task in tasks}
    left = [task for task in tasks if states[task.id] != "done"]
    before: dict[tuple[str, str], list[Receipt]] = {(task.stage, task.title): [] for task in left}
    for receipt in ledger.receipts(states) if left else ():
        if (receipt.stage, receipt.title) in before:
            before[receipt.stage, receipt.title].append(receipt)
    why = {}
    for task in left:
        if states[task.id] == "failed":
            why[task.id] = f"failed: {ledger.reason(task)}"
        elif ledger.is_elsewhere(task):
            why[task.id] = ELSEWHERE
        elif ledger.receipt(task):
            why[task.id] = "a product is missing or damaged"
        else:
            why[task.id] = _changed(task, before[task.stage, task.title])
    return why


def _changed(task: Task, before: Sequence[Receipt]) -> str:
    """Return which keys are not those of the most similar predecessor."""
    if not before:
        return NEVER_MADE
    now = Receipt.of(task, {}, 0.0)
    lists = [receipt.changes(now) for receipt in before if receipt.identity]
    if not lists:
        return "made before; its receipt does not say from what"
    changes = min(lists, key=len)
    more = f" and {len(changes) - _MOST_KEYS} more" if len(changes) > _MOST_KEYS else ""
    return f"{CHANGED}{', '.join(changes[:_MOST_KEYS])}{more}"
