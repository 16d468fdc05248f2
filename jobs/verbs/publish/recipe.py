"""The generating recipe of a published data set, which reads the fabrics beside it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import tomli_w

from jobs.plan.dataset import shards
from jobs.recipe.load import load_recipe
from jobs.verbs.publish.contents import own_shards
from pipeline.atomic import atomic_write
from pipeline.shards.manifest import Manifest
from weaves.errors import BadInput

FILE: Final = "recipe.toml"

_MODELS: Final = ((), ("neumip",), ("curved",), ("point_sampled",))
"""Models whose presence decides which splits a recipe has: those of one material need rows of unseen fabrics."""


def write_fabrics(manifest: Manifest, folder: Path) -> list[str]:
    """Write the named fabrics to a file each and the population to one, and return the paths within the folder."""
    files = {f"fabrics/{name}.toml": manifest.fabrics[name].to_toml() for name in manifest.names("seen", "unseen")}
    if population := manifest.names("population"):
        tables = {name: manifest.fabrics[name].model_dump(mode="json", exclude_none=True) for name in population}
        files["population.toml"] = tomli_w.dumps(tables)
    for path, text in files.items():
        atomic_write(folder / path, text.encode())
    return list(files)


def write_recipe(manifest: Manifest, folder: Path) -> None:
    """Write the recipe that generates a data set beside its fabrics.

    Raises
    ------
    BadInput
        If no recipe has the rows of the data set, because some are missing.
    """
    present = {(shard.fabric, shard.split, shard.start, shard.rows) for shard in own_shards(manifest)}
    for text in _candidates(manifest):
        atomic_write(folder / FILE, text.encode())
        try:
            planned = shards(load_recipe(folder / FILE))
        except BadInput:  # a model that does not know these queries
            continue
        parts = [part.shard for part in planned if not part.is_extra]
        if {(part.fabric.name, part.split, part.start, part.rows) for part in parts} == present:
            return
    raise BadInput(manifest.name, "", "its rows are not those of its recipe", "generate the data set again")


def _candidates(manifest: Manifest) -> Iterator[str]:
    """Yield recipes for the data set alone, with few models."""
    named = {role: [f"fabrics/{name}.toml" for name in manifest.names(role)] for role in ("seen", "unseen")}
    for models in _MODELS:
        recipe = {
            "name": manifest.name,
            "about": "Generates the rows of this data set.",
            "dataset": _without_none(manifest.about) | named,
            "models": [{"model": model} for model in models],
        }
        yield tomli_w.dumps(recipe)


def _without_none(value: Any) -> Any:
    """Return tables without the keys that have no value: TOML has none."""
    if isinstance(value, dict):
        return {key: _without_none(item) for key, item in value.items() if item is not None}
    return [_without_none(item) for item in value] if isinstance(value, list) else value
