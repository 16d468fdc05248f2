"""Keep the manifest of a data set in step with the ledger: at once when a task reads it, else every few seconds."""

import time
from collections.abc import Mapping
from pathlib import Path
from typing import Final

from jobs.plan.dataset import DataSet, Shard
from jobs.plan.task import Task
from jobs.run.ledger import Ledger
from jobs.run.receipt import Product
from pipeline.shards.manifest import FILE, Manifest, ShardEntry

_SECONDS_BETWEEN: Final = 2.0  # two times that it is written, at least
_SHARE: Final = 0.02  # of the driver's time that goes into writing it, at most


class ManifestFile:
    """The manifest of a data set: its content by plan and ledger, and the file."""

    def __init__(self, dataset: DataSet, ledger: Ledger) -> None:
        self._name, recipe = dataset.folder, dataset.recipe
        self.folder = ledger.out / dataset.folder
        self._heading = Manifest(
            name=recipe.name,
            fingerprint=dataset.fingerprint,
            roles={role: [fabric.name for fabric in fabrics] for role, fabrics in recipe.by_role.items()},
            fabrics={fabric.name: fabric for fabric in recipe.fabrics},
            about=recipe.dataset.model_dump(mode="json"),
            shards=[],
        )
        done = ((part, ledger.done(part)) for part in dataset.shards)
        self._entries = {part.id: _entry(part, receipt.files) for part, receipt in done if receipt}
        self._changed = bool(self._entries)
        self._next = 0.0  # when it may be written again

    def add(self, task: Task, files: Mapping[str, Product]) -> None:
        """List a shard that was just finished; other tasks, and shards of other folders, do not matter to it.

        The file grows with the data set, so it is not written for each shard: see `save`.
        """
        if isinstance(task, Shard) and self._name in task.folders:
            self._entries[task.id] = _entry(task, files)
            self._changed = True
            if time.monotonic() >= self._next:
                self.save()

    def save(self) -> None:
        """Write the file if any shard was listed since it was written."""
        if self._changed:
            start = time.monotonic()
            self.content().save(self.folder)
            self._changed = False
            self._next = time.monotonic() + max(_SECONDS_BETWEEN, (time.monotonic() - start) / _SHARE)

    def is_written(self) -> bool:
        """Return whether the file lists exactly the shards that are done."""
        try:
            return (self.folder / FILE).read_bytes() == self.content().encoded()
        except FileNotFoundError:
            return False

    def content(self) -> Manifest:
        """Return the manifest of the shards that are done."""
        return self._heading.model_copy(update={"shards": list(self._entries.values())})


def _entry(part: Shard, files: Mapping[str, Product]) -> ShardEntry:
    return part.entry(files[Path(part.products[0]).name].sha256)
