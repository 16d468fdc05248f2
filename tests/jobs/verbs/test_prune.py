import shutil
from functools import partial

import pytest

from jobs.recipe.load import load_recipe
from tests.jobs import made_up

FOREIGN = ("crash-0.txt", "recipes/require-x.toml", "records/by-hand.json", "datasets/wide/notes.txt", "models/a/x.bin")


@pytest.fixture
def two(tmp_path, call):
    """Return the command line on a folder with two finished recipes that share shards, and with foreign files."""
    for name, train, model in (("narrow", 128, "woven"), ("wide", 256, "neumip")):
        rows = {"train": train, "validation": 32, "test": 64}
        made_up.finished(made_up.write_recipe(tmp_path, name, model, rows=rows), tmp_path / "out")
    for path in FOREIGN:
        (tmp_path / "out" / path).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / "out" / path).write_text("x")
    return partial(call, "prune")


def test_a_list_removes_nothing_and_counts_no_bytes_that_another_data_set_keeps(two, tmp_path):
    before = made_up.contents(tmp_path / "out")
    code, said, _ = two("narrow.toml", "wide.toml", "--delete")
    assert code == 0 and "nothing to remove" in said
    code, said, _ = two("wide.toml")
    assert code == 0 and "--delete removes them" in said and all(path in said for path in FOREIGN)
    assert made_up.contents(tmp_path / "out") == before
    # The shards that both share are hard links: removing one of two names frees nothing.
    shards = next(iter((tmp_path / "out" / "datasets").glob("narrow-*")))
    shared = [path for path in shards.glob("*.parquet") if path.stat().st_nlink == 2]
    assert len(shared) == 4
    _, said, _ = two("wide.toml")
    freed = said.split(f"{shards.relative_to(tmp_path / 'out')} 5 ")[1].split()
    manifest = (shards / "manifest.json").stat().st_size
    assert freed[1] == "kB" and float(freed[0]) == pytest.approx(manifest / 1000, rel=0.01)


@pytest.mark.parametrize("kept", ["narrow", "wide"])
def test_the_other_recipe_goes_with_receipts_and_folders(two, tmp_path, kept):
    out, alone = tmp_path / "out", tmp_path / "alone"
    made_up.finished(f"{kept}.toml", alone)
    code, said, _ = two(f"{kept}.toml", "--delete")
    assert code == 0 and "files removed" in said
    assert made_up.contents(out).keys() == made_up.contents(alone).keys() | set(FOREIGN)
    assert not [path for path in out.rglob("*") if path.is_dir() and not any(path.iterdir())]


def test_what_a_stopped_training_goes_on_from_is_kept(two, tmp_path):
    out = tmp_path / "out"
    for recipe in ("narrow", "wide"):
        training = next(task for task in made_up.plan(load_recipe(f"{recipe}.toml")) if task.stage == "train")
        for name in ("checkpoint.safetensors", ".tmp-card.json"):
            (out / training.folder / name).write_text("x")
    two("narrow.toml", "--delete")
    assert len(list(out.glob("models/*/checkpoint.safetensors"))) == 1 and not list(out.glob("models/*/.tmp-*"))


def test_a_copied_data_set_keeps_its_manifest(two, tmp_path):
    datasets = tmp_path / "out" / "datasets"
    copied = shutil.copytree(next(datasets.glob("narrow-*")), datasets / "copied")
    for index, shard in enumerate(copied.glob("*.parquet")):  # of another folder of products
        shard.rename(copied / f"part-{index:016x}.parquet")
    before = made_up.contents(copied)
    assert two("wide.toml", "--delete")[0] == 0
    assert made_up.contents(copied) == before and not list(datasets.glob("narrow-*"))
