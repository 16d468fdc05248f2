"""Flipped bytes: every damaged file is named, and a repair makes it again with the bytes of an undisturbed run."""

import random
import shutil

import pytest

from jobs.plan.plan import plan
from jobs.recipe.load import load_recipe
from tests.faults.runs import hashes, leftovers, run
from tests.jobs.made_up import flip

pytestmark = pytest.mark.faults

KINDS = (
    *("datasets/*/*.parquet", "datasets/*/manifest.json", "ledger/*.json", "models/*/model.safetensors"),
    *("models/*/card.json", "records/*.exr", "records/*[!e].json", "records/*.machine.json"),
    *("report/*/index.html", "report/*/files.json", "report/*/figures/*.png", "report/*/tables/*.csv"),
)
ROUNDS, FLIPS = 13, 16


@pytest.mark.parametrize("seed", range(ROUNDS))
def test_flips_in_all_kinds_of_files_are_repaired(recipe, undisturbed, tmp_path, seed):
    """One file of each kind and four others have a flipped byte.

    Products of a task whose receipt is damaged, the manifest with their hash, and files of a page whose list is damaged
    need not be named: nothing says what they should be, and all of them are made again.
    """
    out, seeded = tmp_path / "out", random.Random(seed)
    shutil.copytree(undisturbed[0], out)
    kinds = [sorted(path for path in out.glob(kind) if path.stat().st_size) for kind in KINDS]
    assert all(kinds)
    chosen = {seeded.choice(files) for files in kinds}
    others = sorted({path for files in kinds for path in files} - chosen)
    chosen |= set(seeded.sample(others, FLIPS - len(chosen)))
    before = {path: path.read_bytes() for path in chosen}
    for path in sorted(chosen):
        flip(path, seeded)
    told = run(recipe, out, verb="check", code=2).stderr
    tasks = plan(load_recipe(recipe))
    unlisted = {path for task in tasks if out / f"ledger/{task.id}.json" in chosen for path in task.products}
    if any(path.startswith("datasets/") for path in unlisted):  # the flip may be in the hash of this shard
        unlisted |= {str(path.relative_to(out)) for path in out.glob("datasets/*/manifest.json")}
    page = next(task for task in tasks if task.stage == "report")
    if not chosen.isdisjoint({out / page.products[1], out / f"ledger/{page.id}.json"}):
        unlisted |= {str(path.relative_to(out)) for path in (out / page.folder).rglob("*.*")} - set(page.products)
    named = {str(path.relative_to(out)) for path in chosen} - unlisted
    unnamed = [path for path in named if path not in told]
    assert not unnamed, told
    run(recipe, out, "--repair", verb="check")
    assert hashes(recipe, out) == undisturbed[1]
    timed = {out / path for task in tasks if task.slots == "all" for path in task.products}
    # What has a time, a date or a process in it is made again with others.
    again = {path for path in chosen if path not in timed and path.suffix in {".parquet", ".safetensors", ".exr"}}
    assert all(path.read_bytes() == before[path] for path in again)
    run(recipe, out, verb="check")
    assert not leftovers(out)
