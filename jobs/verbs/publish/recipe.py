"""The generating recipe of a published data set, which reads the fabrics beside it."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import tomli_w

from jobs.plan.dataset import DataSet
from jobs.recipe.load import load_recipe
from jobs.verbs.publish.contents import POPULATIONS, own_shards
from pipeline.atomic import atomic_write
from pipeline.shards.generate import ShardTask
from pipeline.shards.manifest import Manifest
from weaves.errors import BadInput, brief

_FILE: Final = "recipe.toml"

_MODELS: Final = ((), ("neumip",), ("curved",), ("point_sampled",))
"""Models whose presence decides which splits a recipe has: those of one material need rows of unseen fabrics."""


def recipe_files(manifest: Manifest, folder: Path) -> dict[str, str]:
    """Return the recipe that generates a data set and the files of its fabrics, by their paths.

    `folder` is that of the data set, for messages. BadInput if no recipe of this version has its rows.
    """
    fabrics = _fabric_files(manifest)
    present = {(shard.fabric, shard.split, shard.start, shard.rows) for shard in own_shards(manifest)}
    with tempfile.TemporaryDirectory(prefix="twillight-") as name:
        for path, text in fabrics.items():
            atomic_write(Path(name) / path, text.encode(), durable=False)
        for models in _MODELS:
            text = _recipe(manifest, models)
            atomic_write(Path(name) / _FILE, text.encode(), durable=False)
            try:
                planned = DataSet(load_recipe(Path(name) / _FILE)).shards
            except BadInput as error:
                if models:  # which do not know these queries
                    continue
                key = f"{error.key} = {brief(error.value)}" if error.key else "its fabrics"
                raise BadInput(str(folder), "", f"is of another version ({key})", "generate it again") from error
            parts = [part.shard for part in planned if isinstance(part.shard, ShardTask)]
            if {(part.fabric.name, part.split, part.start, part.rows) for part in parts} == present:
                return {**fabrics, _FILE: text}
    raise BadInput(str(folder), "", "its rows are not those of a recipe of this version", "generate it again")


def _fabric_files(manifest: Manifest) -> dict[str, str]:
    """Return a file for each named fabric, and one for each population."""
    files = {f"fabrics/{name}.toml": manifest.fabrics[name].to_toml() for name in manifest.names("seen", "unseen")}
    for role in POPULATIONS:
        if population := manifest.names(role):
            tables = {name: manifest.fabrics[name].model_dump(mode="json", exclude_none=True) for name in population}
            files[f"{role}.toml"] = tomli_w.dumps(tables)
    return files


def _recipe(manifest: Manifest, models: Sequence[str]) -> str:
    """Return a recipe for the data set, with models that decide which splits it has."""
    named = {role: [f"fabrics/{name}.toml" for name in manifest.names(role)] for role in ("seen", "unseen")}
    recipe = {
        "name": manifest.name,
        "about": "Generates the rows of this data set.",
        "dataset": _without_none(manifest.about) | named,
        "models": [{"model": model} for model in models],
    }
    return tomli_w.dumps(recipe)


def _without_none(value: Any) -> Any:
    """Return tables without the keys that have no value: TOML has none."""
    if isinstance(value, dict):
        return {key: _without_none(item) for key, item in value.items() if item is not None}
    return [_without_none(item) for item in value] if isinstance(value, list) else value
