"""The manifest is written now and then while shards are made, and is whole when it is read."""

import pytest

from jobs.plan.dataset import DataSet
from jobs.recipe.load import load_recipe
from jobs.run import manifest_file
from jobs.run.ledger import Ledger
from jobs.run.manifest_file import ManifestFile
from jobs.run.receipt import Product
from pipeline.shards.manifest import FILE, Manifest


@pytest.fixture
def clock(monkeypatch):
    now = [100.0]
    monkeypatch.setattr(manifest_file.time, "monotonic", lambda: now[0])
    return now


@pytest.fixture
def made(files, tmp_path, clock):
    """A manifest, and a function that notes a shard as made."""
    recipe = load_recipe(files.write())
    dataset = DataSet(recipe)
    parts, manifest = dataset.shards, ManifestFile(dataset, Ledger(tmp_path / "out"))

    def add(part):
        manifest.add(part, {part.products[0].rpartition("/")[2]: Product(sha256="ab" * 32, bytes=1)})

    return manifest, parts, add


def listed(manifest):
    return len(Manifest.load(manifest.folder).shards) if (manifest.folder / FILE).exists() else 0


def test_shards_are_listed_when_some_time_has_gone_by(made, clock):
    manifest, parts, add = made
    manifest.save()
    assert listed(manifest) == 0
    counts = []
    for part in parts[:6]:
        add(part)
        counts.append(listed(manifest))
        clock[0] += 1.0
    assert counts == [1, 1, 3, 3, 5, 5]
    manifest.save()
    assert listed(manifest) == 6


def test_an_unchanged_manifest_is_not_written(made):
    manifest, parts, add = made
    add(parts[0])
    (manifest.folder / FILE).unlink()
    manifest.save()
    assert listed(manifest) == 0
    add(parts[1])
    manifest.save()
    assert listed(manifest) == 2
