"""Keep the manifest of a data set in step with the ledger."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jobs.plan.dataset import Shard, fingerprint_of, folder_of
from jobs.plan.task import Task
from jobs.recipe.recipe import Recipe
from jobs.run.ledger import Ledger

if TYPE_CHECKING:
    from pipeline.shards.manifest import Manifest, ShardEntry


class ManifestFile:
    """The manifest of a data set: its content by plan and ledger, and the file, which is kept in step."""

    def __init__(self, recipe: Recipe, parts: Sequence[Shard], ledger: Ledger) -> None:
        self._recipe, self._ledger = recipe, ledger
        self.folder = ledger.out / folder_of(parts)
        """Folder of the data set."""
        self._parts = {part.id: part for part in parts}
        self._entries: dict[str, Any] = {}
        for part in parts:
            self._enter(part)

    def add(self, task: Task) -> None:
        """List a shard that was just finished; other tasks do not matter to it."""
        if task.id in self._parts:
            self._enter(self._parts[task.id])
            self.save()

    def save(self) -> None:
        """Write the file if any shard is done."""
        if self._entries:
            self.content().save(self.folder)

    def _enter(self, part: Shard) -> None:
        if self._ledger.state(part) == "done":
            name = Path(part.products[0]).name
            self._entries[part.id] = entry_of(part, self._ledger.products(part)[name].sha256)

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
