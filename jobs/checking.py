"""Checking a data set on disk: every shard that its manifest lists is read again."""

from __future__ import annotations

from pathlib import Path

from rich.console import Console
from rich.progress import track

from jobs.dataset import folder_of, shards
from jobs.recipe import load_recipe
from pipeline.shards.check import check_shard
from pipeline.shards.manifest import Manifest


def dataset_folder(recipe_or_folder: str, out: Path) -> Path:
    """Return the folder that is meant: a data set's own, or that of a recipe in the output folder."""
    folder = Path(recipe_or_folder)
    return folder if folder.is_dir() else out / folder_of(shards(load_recipe(recipe_or_folder)))


def check_dataset(folder: Path) -> list[str]:
    """Check every shard of a data set, print what was found sound, and return the faults as sentences.

    Raises
    ------
    BadInput
        If the folder has no manifest.
    """
    manifest = Manifest.load(folder)
    console = Console(stderr=True)
    faults = []
    for entry in track(manifest.shards, "checking", console=console, disable=not console.is_terminal):
        faults += check_shard(folder, entry, manifest)
    rows = sum(entry.rows for entry in manifest.shards)
    if not faults:
        Console().print(f"{folder}: {len(manifest.shards)} shards with {rows:,} rows are sound")
    return faults
