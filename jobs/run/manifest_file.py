"""Keep the manifest of a data set in step with the ledger: at once when a task reads it, else every few seconds."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from jobs.plan.dataset import Shard, fingerprint_of, folder_of
from jobs.plan.task import Task
from jobs.recipe.recipe import Recipe
from jobs.run.ledger import Ledger
from jobs.run.receipt import Product

_SECONDS_BETWEEN: Final = 2.0  # two times that it is written, at least
_SHARE: Final = 0.02  # of the driver's time that goes into writing it, at most

if TYPE_CHECKING:
    from pipeline.shards.manifest import Manifest, ShardEntry


class ManifestFile:
    """The manifest of a data set: its content by plan and ledger, and the file."""

    def __init__(self, recipe: Recipe, parts: Sequence[Shard], ledger: Ledger) -> None:
        self._recipe, self._ledger = recipe, ledger
        self.folder = ledger.out / folder_of(parts)
        """Folder of the data set."""
        self._parts = {part.id: part for part in parts}
        self._entries: dict[str, Any] = {}
        self._changed = False
        self._next = 0.0  # when it may be written again
        for part in parts:
            if receipt := ledger.done(part):
                self._enter(part, receipt.files)

    def add(self, task: Task, files: Mapping[str, Product]) -> None:
        """List a shard that was just finished; other tasks do not matter to it.

        The file grows with the data set, so it is not written for each shard: see `save`.
        """
        part = self._parts.get(task.id)
        # A shard may be needed in the folder of another recipe alone.
        if part is not None and set(part.products) <= set(task.products):
            self._enter(part, files)
            if time.monotonic() >= self._next:
                self.save()

    def save(self) -> None:
        """Write the file if any shard was listed since it was written."""
        if self._changed:
            start = time.monotonic()
            self.content().save(self.folder)
            self._changed = False
            self._next = time.monotonic() + max(_SECONDS_BETWEEN, (time.monotonic() - start) / _SHARE)

    def _enter(self, part: Shard, files: Mapping[str, Product]) -> None:
        self._entries[part.id] = entry_of(part, files[Path(part.products[0]).name].sha256)
        self._changed = True

    def content(self) -> Manifest:
        """Return the manifest of the shards that are done."""
        from pipeline.shards.manifest import Manifest

        recipe = self._recipe
        return Manifest(
            name=recipe.name,
            fingerprint=fingerprint_of(list(self._parts.values())),
            roles={
                "seen": [fabric.name for fabric in recipe.seen],
                "population": [fabric.name for fabric in recipe.population],
                "unseen": [fabric.name for fabric in recipe.unseen],
                "unseen_population": [fabric.name for fabric in recipe.unseen_population],
            },
            fabrics={fabric.name: fabric for fabric in recipe.fabrics},
            about=recipe.dataset.model_dump(mode="json"),
            shards=list(self._entries.values()),
        )


def entry_of(part: Shard, sha256: str) -> ShardEntry:
    """Return the entry of a shard in its manifest."""
    from pipeline.shards.manifest import ShardEntry

    shard = part.shard
    return ShardEntry(
        file=Path(part.products[0]).name,
        fabric=shard.fabric.name,
        kind=shard.kind,
        split=shard.split,
        start=shard.start,
        rows=shard.rows,
        sha256=sha256,
    )
