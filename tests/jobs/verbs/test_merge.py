import shutil
from functools import partial

import pytest

from jobs.plan.dataset import DataSet
from jobs.recipe.load import load_recipe
from jobs.run.ledger import Ledger
from jobs.run.manifest_file import ManifestFile
from pipeline.shards.manifest import Manifest
from tests.jobs import made_up


@pytest.fixture
def parts(tmp_path, call, refused):
    """Return the command line on two folders, each with every other shard of a data set."""
    rows = {"train": 512, "validation": 32, "test": 64}
    recipe = load_recipe(made_up.write_recipe(tmp_path, "wide", "woven", rows=rows))
    tasks = made_up.plan(recipe)
    for first, name in enumerate("ab"):
        out = tmp_path / name
        made_up.execute(tasks[first:10:2], Ledger(out))
        ManifestFile(DataSet(recipe), Ledger(out)).save()
    merge = partial(call, "merge")
    merge.tasks, merge.folder, merge.refused = tasks, DataSet(recipe).folder, partial(refused, "merge")
    return merge


def test_parts_of_a_data_set_become_the_whole(parts, tmp_path):
    made_up.finished("wide.toml", tmp_path / "whole", ["generate"])
    code, said, told = parts("a", "b", "--out", "c")
    assert code == 0 and told == "" and "10 finished tasks, 5 from a, 5 from b" in said
    found = made_up.contents(tmp_path / "c")
    assert found == made_up.contents(tmp_path / "whole")
    assert len(Manifest.load(tmp_path / "c" / parts.folder).shards) == 10
    assert made_up.execute(parts.tasks, Ledger(tmp_path / "c"), stages=["generate"]).ran == []
    # A folder may also be joined to another, and twice.
    for _ in range(2):
        assert "10 finished tasks" in parts("a", "b", "--out", "a")[1] and made_up.contents(tmp_path / "a") == found


def test_a_damaged_product_is_left_out_unless_the_other_folder_has_it(parts, tmp_path):
    first, second = parts.tasks[0], parts.tasks[1]
    for task, name in ((first, "a"), (second, "b")):
        made_up.flip(tmp_path / name / task.products[0])
    made_up.execute([second], Ledger(tmp_path / "a"))
    code, said, told = parts("a", "b", "--out", "c")
    assert code == 2 and "9 finished tasks" in said
    assert told == f"a: generate {first.title}: a product is missing or damaged; it is left out\n"
    assert Ledger(tmp_path / "c").state(first) == "missing"
    assert len(Manifest.load(tmp_path / "c" / parts.folder).shards) == 9
    assert made_up.execute(parts.tasks, Ledger(tmp_path / "c"), stages=["generate"]).ran == [first]


def test_models_and_records_come_along_and_pages_do_not(parts, tmp_path):
    made_up.finished("wide.toml", tmp_path / "whole")
    assert parts("a", "whole", "--out", "c")[0] == 0
    found, expected = made_up.contents(tmp_path / "c"), made_up.contents(tmp_path / "whole")
    page = parts.tasks[-1]
    left = {path for path in expected if path.startswith("report/")} | {f"ledger/{page.id}.json"}
    assert found == {path: content for path, content in expected.items() if path not in left}
    assert made_up.execute(parts.tasks, Ledger(tmp_path / "c")).ran == [page]


def test_other_bytes_of_one_task_and_manifests_of_unlike_data_sets_are_refused(parts, tmp_path):
    task = parts.tasks[0]
    shutil.copytree(tmp_path / "a", tmp_path / "other")
    path = tmp_path / "other" / task.products[0]
    path.write_bytes(b"made with another version that was not told apart")
    made_up.finish(task, Ledger(tmp_path / "other"))
    assert f"{path.name} of generate {task.title} has other bytes in each" in parts.refused("a", "other", "--out", "c")
    assert not list((tmp_path / "c").glob("datasets/*/*"))
    for name in ("one", "two"):
        made_up.finished("wide.toml", tmp_path / name)
    assert "has other bytes in each: delete ledger/" in parts.refused("one", "two", "--out", "c")
    manifest = Manifest.load(tmp_path / "b" / parts.folder)
    manifest.model_copy(update={"fingerprint": "0" * 16}).save(tmp_path / "b" / parts.folder)
    assert "is of another data set" in parts.refused("a", "b", "--out", "c")
