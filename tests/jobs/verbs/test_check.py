import random
import shutil
from functools import partial

import pytest

from jobs.plan.dataset import Shard
from jobs.plan.page import Page
from jobs.plan.training import Training
from jobs.run.ledger import Ledger
from pipeline.shards.manifest import Manifest
from pipeline.shards.store import read_table, write_columns
from tests.jobs import made_up
from tests.jobs.made_up import flip


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """Return a folder in which a recipe is finished, the recipe beside it."""
    folder = tmp_path_factory.mktemp("whole")
    made_up.finished(made_up.write_recipe(folder, "tiny", "woven", "neumip"), folder / "out")
    return folder


@pytest.fixture
def run(whole, tmp_path, monkeypatch, call):
    """Return a copy of that folder, and the command line on it: code and both outputs."""
    shutil.copytree(whole, tmp_path, dirs_exist_ok=True)
    monkeypatch.setattr("jobs.verbs.run.execute", made_up.execute)
    monkeypatch.setattr("jobs.verbs.run._print_methods", lambda records: None)
    run = partial(call, "check", tmp_path / "tiny.toml", "--out", tmp_path / "out")
    run.out = tmp_path / "out"
    run.tasks = made_up.plan(made_up.load_recipe(tmp_path / "tiny.toml"))
    run.of = lambda kind: next(task for task in run.tasks if isinstance(task, kind))
    return run


def same(found, expected, but=()):
    """Assert that files are the same but for the dates beside Records, and for some others."""
    assert found.keys() == expected.keys()
    changed = {path for path in found if found[path] != expected[path] and not path.endswith(".machine.json")}
    assert changed <= set(but), changed


def test_a_finished_recipe_is_sound_and_what_is_left_to_do_is_missing(run):
    code, said, told = run()
    assert code == 0 and told == "" and "4 shards with 224 rows, 2 models" in said and "are sound" in said
    shutil.rmtree(run.out)
    code, said, told = run()
    assert code == 1 and "sound" not in said
    assert len(told.splitlines()) == 5  # a sentence a stage, and what to run
    assert "nor does any product of the 4 tasks of generate" in told
    made_up.finished(run.out.parent / "tiny.toml", run.out, ["generate"])
    code, _, told = run()
    assert code == 1 and "of train" in told and "of generate" not in told
    # Stages that were never begun are not.
    code, _, _ = run("--repair")
    assert code == 1 and Ledger(run.out).state(run.of(Training)) == "missing"


def test_a_shard_that_is_gone_and_files_cut_short_are_named_and_made_again(run):
    expected, shard, training = made_up.contents(run.out), run.of(Shard), run.of(Training)
    (run.out / shard.products[0]).unlink()
    code, _, told = run()
    assert code == 1 and f"{run.out / shard.products[0]}: missing" in told and run("--repair")[0] == 0
    same(made_up.contents(run.out), expected, but=[f"ledger/{shard.id}.json"])
    for path in (shard.products[0], training.products[0]):
        (run.out / path).write_bytes(expected[path][:-1])
    code, _, told = run()
    assert code == 2 and told.count(": cut: it has") == 2 and run("--repair")[0] == 0
    same(made_up.contents(run.out), expected)


def test_a_folder_in_the_place_of_a_shard_is_replaced_and_a_foreign_file_named_and_kept(run):
    expected, shard = made_up.contents(run.out), run.of(Shard)
    place = run.out / shard.products[0]
    place.unlink()
    (place / "inside").mkdir(parents=True)
    code, _, told = run()
    assert code != 0 and str(place) in told and run("--repair")[0] == 0
    same(made_up.contents(run.out), expected, but=[f"ledger/{shard.id}.json"])
    foreign = (run.out / run.of(Shard).products[0]).with_name("part-0123456789abcdef.parquet")
    foreign.write_text("not a shard")
    (run.out / run.of(Training).folder / "notes.txt").write_text("by hand")
    (run.out / run.of(Page).folder / "results.md").write_text("by `twillight results`")
    (run.out / "crash-12345678.txt").write_text("not in a folder of the recipe")
    code, _, told = run()
    assert code == 2 and told.count(": foreign: no task of this recipe made it") == 2
    assert run("--repair")[0] == 2 and foreign.exists()


def test_a_page_of_other_measurements_is_outdated_and_values_that_were_never_right_are_odd(run):
    page = run.of(Page)
    (run.out / "ledger" / f"{page.id}.json").unlink()
    code, _, told = run()
    assert code == 1 and f"{run.out / page.products[0]}: outdated" in told and run("--repair")[0] == 0
    # A shard whose hash is on the receipt, with a value that no truth gives.
    shard = run.of(Shard)
    path = run.out / shard.products[0]
    table = read_table(path)
    columns = {name: table.column(name).to_numpy().copy() for name in table.schema.names[1:]}
    columns["diffuse_warp"][3] = -1.0
    write_columns(path, "components", shard.shard.fabric.name, columns, {})
    made_up.finish(shard, Ledger(run.out))
    code, _, told = run()
    assert code == 2 and f"{path}: odd: column diffuse_warp spans [-1.0" in told


def test_a_folder_of_a_data_set_is_sound_cut_or_empty(run, call):
    path = run.out / run.of(Shard).products[0]
    code, said, _ = call("check", path.parent)
    assert code == 0 and "4 shards with 224 rows are sound" in said
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    code, _, told = call("check", path.parent)
    assert code == 2 and "whole" in told and all(path.name in line for line in told.splitlines())
    manifest = Manifest.load(path.parent)
    manifest.without({shard.file for shard in manifest.shards}).save(path.parent)
    code, said, told = call("check", path.parent)
    assert code == 2 and "sound" not in said and "lists no shards" in told


def test_many_faults_are_counted(run):
    struck = [path for place in ("records/*", "models/*/*", "datasets/*/*.parquet") for path in run.out.glob(place)]
    for path in struck:
        flip(path)
    code, _, told = run()
    assert code == 2 and len(told.splitlines()) == 22
    assert told.splitlines()[20] == f"and {len(struck) - 20} damaged more"


def test_a_measurement_of_time_is_taken_again_and_shown(run, twillight):
    timing, page = next(task for task in run.tasks if task.slots == "all"), run.of(Page)
    expected = made_up.contents(run.out)
    flip(run.out / timing.records)
    assert run("--repair")[0] == 0
    found = made_up.contents(run.out)
    changed = [timing.records, page.products[0], f"ledger/{timing.id}.json", f"ledger/{page.id}.json"]
    same(found, expected, but=changed)
    assert found[page.products[0]] != expected[page.products[0]]
    # A run too writes the page again if times are missing.
    (run.out / timing.records).unlink()
    assert twillight("bench", "tiny.toml")[0] == 0 and not (run.out / page.products[0]).exists()
    assert twillight("report", "tiny.toml")[0] == 0
    assert (run.out / page.products[0]).read_bytes() != found[page.products[0]] and run()[0] == 0


def test_five_flips_a_round_in_files_of_all_kinds_are_found_and_repaired(run):
    """Each file is named, and all come back; tests/faults/test_flips.py has more of them."""
    chance = random.Random(1)
    kinds = ["datasets/*/*.parquet", "datasets/*/manifest.json", "ledger/*.json", "models/*/model.safetensors"]
    kinds += ["models/*/card.json", "records/*", "report/*/index.html", "report/*/files.json", "report/*/figures/*"]
    expected = made_up.contents(run.out)
    times = {path for task in run.tasks if task.slots == "all" or isinstance(task, Page) for path in task.products}
    times |= {f"ledger/{task.id}.json" for task in run.tasks if task.stage == "bench" or isinstance(task, Page)}
    for _ in range(4):
        struck = {chance.choice(sorted(run.out.glob(kind))) for kind in chance.sample(kinds, 5)}
        for path in struck:
            flip(path, chance)
        code, _, told = run()
        assert code == 2
        receipts = {path.stem for path in struck if path.parent.name == "ledger"}
        # A product whose receipt was struck too is not named: it is made again with it.
        for path in (path for path in struck if str(path) not in told):
            tasks = [task for task in run.tasks if str(path.relative_to(run.out)) in task.products]
            assert any(task.id in receipts for task in tasks) or "report" in str(path), (path, told)
        assert run("--repair")[0] == run()[0] == 0
        same(made_up.contents(run.out), expected, but=times)
        assert not receipts & {task.id for task in run.tasks if Ledger(run.out).receipt(task) is None}
