import pytest

from jobs.plan.dataset import Shard
from jobs.plan.page import Page
from jobs.plan.plan import plan
from jobs.recipe.load import load_recipe
from jobs.run.faults import faults, is_leftover, own_files, task_faults
from jobs.run.ledger import Ledger
from pipeline import versions
from pipeline.shards.manifest import Manifest
from pipeline.training.checkpoint import CHECKPOINT
from reports.page.files import read_files
from tests.jobs import made_up


@pytest.fixture
def trade(tmp_path):
    """Return a finished recipe one of whose models another recipe trains, on a data set that shares shards."""
    made_up.write_recipe(tmp_path, "other", "neumip")
    models, rows = [{"model": "neumip", "recipe": "other.toml"}, "woven"], {"train": 256, "validation": 32, "test": 64}
    trade = made_up.write_recipe(tmp_path, "trade", *models, rows=rows)
    return load_recipe(trade), made_up.finished(trade, tmp_path / "out"), Ledger(tmp_path / "out")


def kinds(found):
    return sorted((fault.kind, fault.path) for fault in found)


def test_two_data_sets_of_one_recipe_are_sound_and_each_copy_of_a_shared_shard_is_read(trade):
    recipe, tasks, ledger = trade
    shares = []
    assert faults(*trade, shares.append) == [] and shares == sorted(shares) and shares[-1] == 1.0
    left = {path for path in made_up.contents(ledger.out) if not path.startswith("ledger/")}
    assert left <= set(own_files(recipe, tasks, ledger.out))
    shared = next(task for task in tasks if isinstance(task, Shard) and len(task.products) == 2)
    second = ledger.out / shared.products[1]
    content = second.read_bytes()
    second.unlink()  # no longer a link to the same bytes
    second.write_bytes(content[:-1] + b"x")
    assert kinds(faults(recipe, tasks, ledger)) == [("damaged", shared.products[1])]
    assert ledger.discard(shared) == [shared.products[1]]
    # The sound copy gives the bytes again.
    assert ledger.adopt(shared) and second.read_bytes() == content and faults(recipe, tasks, ledger) == []


def test_a_manifest_of_either_data_set_is_compared_and_a_larger_file_is_damaged(trade):
    """One that a killed run left behind its receipts is outdated."""
    recipe, tasks, ledger = trade
    first, second = sorted(ledger.out.glob("datasets/*/manifest.json"))
    manifest = Manifest.load(second.parent)
    manifest.without({shard.file for shard in manifest.shards[:2]}).save(second.parent)
    (fault,) = faults(recipe, tasks, ledger)
    assert fault.kind == "outdated" and f"of {len(manifest.shards)} finished shards" in fault.why
    # A shard whose receipt is gone is a fault of its own, not one of the manifest that lists it.
    manifest.save(second.parent)
    receipt = ledger.out / ledger.receipt_path(tasks[0])
    receipt.rename(ledger.out / "kept")
    assert kinds(faults(recipe, tasks, ledger)) == [("missing", ledger.receipt_path(tasks[0]))]
    (ledger.out / "kept").rename(receipt)
    first.write_text(first.read_text().replace('"start": 64', '"start": 65'))
    second.unlink()
    places = [str(path.relative_to(ledger.out)) for path in (first, second)]
    assert kinds(faults(recipe, tasks, ledger)) == [("damaged", places[0]), ("missing", places[1])]
    training = next(task for task in tasks if task.stage == "train")
    with (ledger.out / training.products[0]).open("ab") as file:
        file.write(b"x")
    assert kinds(task_faults(training, ledger)) == [("damaged", training.products[0])]
    assert ledger.discard(training) == [training.products[0]]
    # So is a file of a page that cannot be read.
    page = next(task for task in tasks if isinstance(task, Page))
    path = ledger.out / page.folder / next(iter(read_files(ledger.out / page.folder)))
    path.unlink()
    path.symlink_to("/proc/self/mem")
    (fault,) = task_faults(page, ledger)
    assert (fault.kind, fault.why) == ("damaged", "it cannot be read (Input/output error)")


def test_products_of_an_earlier_version_are_outdated_and_what_a_stopped_task_leaves_is_known(tmp_path, monkeypatch):
    path = made_up.write_recipe(tmp_path, "other", "neumip")
    with monkeypatch.context() as patch:
        patch.setattr(versions, "TRAINING", versions.TRAINING - 1)
        made_up.finished(path, tmp_path / "out")
    recipe = load_recipe(path)
    tasks, ledger = plan(recipe), Ledger(tmp_path / "out")
    found = {(fault.task.stage, fault.task.title): fault for fault in faults(recipe, tasks, ledger) if fault.task}
    training = found["train", "neumip on denim"]
    assert training.kind == "outdated" and training.why.startswith("it was made before; changed: versions.training")
    assert found["report", "page of other"].kind == "outdated"
    # What no network is part of is not touched by it.
    assert {stage for stage, _ in found} == {"train", "bench", "report"}
    assert len(found) < sum(task.stage != "generate" for task in tasks)
    assert all(map(is_leftover, (CHECKPOINT, ".tmp-card.json")))
    assert not any(map(is_leftover, ("model.safetensors", "part-0.parquet", "notes.txt")))
