"""Keep the manifest of a data set in step with the ledger."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from jobs.plan.dataset import Shard, fingerprint_of, folder_of
from jobs.plan.task import Task
from jobs.recipe.recipe import Recipe
from jobs.run.ledger import Ledger


class ManifestFile:
    """The manifest on disk, kept in step with the ledger; it is not rewritten without a change."""

    def __init__(self, recipe: Recipe, parts: Sequence[Shard], ledger: Ledger) -> None:
        self._recipe, self._ledger = recipe, ledger
        self._folder = ledger.out / folder_of(parts)
        self._parts = {part.id: part for part in parts}
        self._entries: dict[str, Any] = {}
        for part in parts:
            self._enter(part)
        if self._entries:
            self._save()

    def add(self, task: Task) -> None:
        """List a shard that was just finished; other tasks do not matter to it."""
        if task.id in self._parts:
            self._enter(self._parts[task.id])
            self._save()

    def _enter(self, part: Shard) -> None:
        from pipeline.shards.manifest import ShardEntry

        name, shard = Path(part.products[0]).name, part.shard
        if self._ledger.state(part) == "done":
            self._entries[part.id] = ShardEntry(
                file=name,
                fabric=shard.fabric.name,
                kind=shard.kind,
                split=shard.split,
                start=shard.start,
                rows=shard.rows,
                sha256=self._ledger.products(part)[name].sha256,
            )

    def _save(self) -> None:
        from pipeline.shards.manifest import Manifest

        recipe = self._recipe
        Manifest(
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
        ).save(self._folder)
