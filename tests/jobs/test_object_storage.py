"""Products in object storage: a real S3 server, failures of it, and the bytes of a run in a folder."""

import hashlib
import re
import threading
import time
from collections import Counter
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from jobs.cli import main
from jobs.plan.plan import plan
from jobs.recipe.load import load_recipe
from jobs.run.ledger import Ledger
from jobs.run.receipt import Product
from pipeline import patience
from pipeline.storage import place
from tests.jobs import fake_stages
from tests.jobs.s3_server import serving
from tests.jobs.small_recipes import write_smallest

pytestmark = pytest.mark.external  # an S3 server


@pytest.fixture(scope="module")
def server():
    with serving() as found:
        yield found


@pytest.fixture
def switch(server, monkeypatch, tmp_path):
    import fsspec
    import s3fs

    address, switch = server
    monkeypatch.setenv("AWS_ENDPOINT_URL", address)
    monkeypatch.setenv("AWS_ACCESS_KEY_ID", "key-of-the-tests")
    monkeypatch.setenv("AWS_SECRET_ACCESS_KEY", "secret-of-the-tests")
    monkeypatch.setenv("AWS_DEFAULT_REGION", "us-east-1")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setattr(patience, "_state", patience._State())
    place("s3://products/x")  # which tells fsspec its class
    fsspec.get_filesystem_class("s3").clear_instance_cache()
    switch.set("")
    s3fs.S3FileSystem().makedirs("products", exist_ok=True)
    yield switch
    switch.set("")


@pytest.fixture
def recipe(tmp_path):
    return small(tmp_path, "stored")


def small(folder, name, seed=0):
    """Write a recipe of four shards; return its path."""
    dataset = {"seed": seed, "shard_rows": 64, "rows": {"train": 128, "test": 64}, "truth": {"relative_error": 0.5}}
    return write_smallest(folder, name, dataset, {"hidden": 8, "training": {"batch": 32}})


def hashes(out):
    files = [path for path in out.rglob("*") if path.is_file()]
    kept = [path for path in files if path.parent.name != "ledger"]  # receipts have times
    return {str(path.relative_to(out)): hashlib.sha256(path.read_bytes()).hexdigest() for path in kept}


def test_a_storage_that_fails_for_a_while_has_the_shards_of_a_folder(switch, tmp_path, capsys, recipe):
    address = "s3://products/some/prefix"
    switch.set("fail", count=2)
    assert main(["generate", str(recipe), "--out", address, "--workers", "1"]) == 0, capsys.readouterr().err
    tasks = [task for task in plan(load_recipe(recipe)) if task.stage == "generate"]
    for task in tasks:
        task.run(tmp_path, lambda share: None)
        assert [(place(address) / path).read_bytes() for path in task.products] == [
            (tmp_path / path).read_bytes() for path in task.products
        ]
    assert not Path("s3:").exists()
    assert main(["generate", str(recipe), "--out", address]) == 0
    said = capsys.readouterr()
    assert f"nothing to do: {len(tasks)} tasks done" in said.out and "secret-of-the-tests" not in said.out + said.err
    assert not any(b"secret-of-the-tests" in path.read_bytes() for path in place(address).rglob("*") if path.is_file())


@pytest.mark.slow
def test_generate_train_check_and_repair_leave_the_bytes_of_a_folder(switch, tmp_path, capsys, monkeypatch, recipe):
    here, address = tmp_path / "out", "s3://products/whole"
    for verb in ("generate", "train"):
        for out in (str(here), address):
            assert main([verb, str(recipe), "--out", out, "--workers", "1"]) == 0, capsys.readouterr().err
    there = place(address)
    assert hashes(there) == hashes(here)
    # Nothing is done twice, also from a machine that has none of it.
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "other"))
    assert main(["train", str(recipe), "--out", address]) == 0
    assert "nothing to do" in capsys.readouterr().out
    # A flipped byte is found and made again.
    shard = min(there.glob("datasets/*/*.parquet"), key=str)
    whole = shard.read_bytes()
    shard.write_bytes(whole[:200] + bytes([whole[200] ^ 1]) + whole[201:])
    assert main(["check", str(recipe), "--out", address]) == 2
    assert f"{shard}: damaged" in capsys.readouterr().err
    assert main(["check", str(recipe), "--repair", "--out", address, "--workers", "1"]) == 1  # nothing was measured
    assert shard.read_bytes() == whole
    assert hashes(there) == hashes(here)


def test_a_query_file_and_its_answers_may_be_there(switch, tmp_path, capsys):
    up = [0.0, 0.0, 1.0]
    columns = {f"{name}_{axis}": [up[k]] * 3 for name in ("wi", "wo") for k, axis in enumerate("xyz")}
    pq.write_table(
        pa.table({"u": [0.1, 0.2, 0.3], "v": [0.5] * 3, "sigma": [1.0] * 3} | columns), tmp_path / "q.parquet"
    )
    place("s3://products/q.parquet").write_bytes((tmp_path / "q.parquet").read_bytes())
    for folder in (str(tmp_path), "s3://products"):
        found = main(
            ["evaluate", "denim", f"{folder}/q.parquet", "--out", f"{folder}/a.parquet", "--estimator", "owen"]
        )
        assert found == 0, capsys.readouterr().err
    assert place("s3://products/a.parquet").read_bytes() == (tmp_path / "a.parquet").read_bytes()


WRONG = {
    "s3://": "names at least a bucket",
    "nothing://b/x": "an address of fsspec is needed",
    "s3://key:hidden@b/x": "credentials belong in the environment",
    "sftp://user:hidden@host/x": "credentials belong in the environment",
}
BUCKET = "s3://there-is-none/x"


@pytest.mark.parametrize(
    ("verb", "address", "sentence"),
    [
        *(("generate", address, sentence) for address, sentence in WRONG.items()),
        *((verb, BUCKET, "an existing bucket is needed") for verb in ("status", "plan", "check", "run")),
        ("generate", "s3://products/refused", "credentials of the environment"),
    ],
)
def test_addresses_that_cannot_be_used_are_bad_input_and_show_no_secret(
    switch, recipe, capsys, verb, address, sentence
):
    if address.endswith("refused"):
        switch.set("refuse")
    assert main([verb, str(recipe), "--out", address]) == 2
    said = capsys.readouterr().err
    assert sentence in said and not any(word in said for word in ("hidden", "-of-the-tests"))


def test_an_upload_that_is_cut_is_tried_again_or_leaves_nothing(switch, tmp_path):
    from pipeline.storage import store

    source = tmp_path / "file"
    source.write_bytes(b"x" * 100_000)
    target = place("s3://products/cut/file")
    switch.set("cut", count=2)
    store(source, target)
    assert target.read_bytes() == source.read_bytes()


def test_finished_tasks_cost_one_request_a_receipt_and_then_none(switch, tmp_path):
    import s3fs

    tasks = [fake_stages.task(f"shard {index}", folder="datasets/a") for index in range(200)]
    here = Ledger(tmp_path / "out")
    for task in tasks:
        task_file = tmp_path / "out" / task.products[0]
        task_file.parent.mkdir(parents=True, exist_ok=True)
        task_file.write_text(task.name)
        here.finish(task, {task_file.name: Product.of(task_file)}, 1.0)
    s3fs.S3FileSystem().put(f"{tmp_path / 'out'}/", "s3://products/many/", recursive=True)
    there = place("s3://products/many")
    listings = 2 + 3 * 3  # of five folders; s3fs asks twice more about each that is empty
    for expected in (len(tasks) + listings, listings):
        switch.paths.clear()
        assert Counter(map(Ledger(there).state, tasks)) == {"done": 200}
        assert len(switch.paths) <= expected
    # What has changed is seen: a receipt that is gone, one with other content, a product that is cut.
    (there / here.receipt_path(tasks[0])).unlink()
    (there / here.receipt_path(tasks[1])).write_bytes(b"{}")
    (there / tasks[2].products[0]).write_bytes(b"")
    switch.paths.clear()
    assert Counter(map(Ledger(there).state, tasks)) == {"done": 197, "missing": 3}
    assert len(switch.paths) <= 1 + listings


def test_a_ledger_sees_what_it_has_written(switch, tmp_path):
    ledger, task = Ledger(place("s3://products/own")), fake_stages.task("a", folder="datasets/a")
    assert ledger.state(task) == "missing"
    ledger.fail(task, "the disk was full")
    assert (ledger.state(task), ledger.reason(task)) == ("failed", "the disk was full")
    product = ledger.out / task.products[0]
    product.write_bytes(b"whole")
    ledger.finish(task, {product.name: Product.of(product)}, 1.0)
    for one in (ledger, Ledger(ledger.out)):
        assert (one.state(task), one.reason(task), one.seconds(task)) == ("done", "", 1.0)
    twin = fake_stages.task("a", folder="datasets/b")
    assert twin.id == task.id and ledger.adopt(twin) and ledger.state(twin) == "done"
    product.write_bytes(b"flaw!")
    assert ledger.discard(task) == [task.products[0]] and ledger.state(task) == "missing"
    assert not product.exists()


@pytest.mark.parametrize(
    "tokens",
    [
        ["merge", "s3://products/a", "b", "--out", "c"],
        ["merge", "a", "b", "--out", "s3://products/c"],
        ["compare", "s3://products/a", "b"],
        ["show", "denim", "--out", "s3://products/a"],
        ["export", "denim", "--mesh", "s3://products/a.ply"],
        ["export", "denim", "--wif", "s3://products/a.wif"],
        ["export", "denim", "--maps", "s3://products/maps"],
        ["import", "s3://products/a.wif", "--out", "a.toml"],
        ["results", "quick", "--file", "s3://products/a.md"],
    ],
)
def test_verbs_that_need_a_folder_refuse_an_address(switch, tmp_path, monkeypatch, capsys, tokens):
    monkeypatch.chdir(tmp_path)
    switch.paths.clear()
    assert main(tokens) == 2
    said = capsys.readouterr()
    assert "is an address; a path of this machine is needed here" in said.err and not said.out
    assert not switch.paths and not Path("s3:").exists()


@pytest.mark.parametrize("verb", ["status", "plan", "check", "generate"])
def test_a_storage_that_does_not_answer_ends_with_a_sentence(switch, recipe, capsys, monkeypatch, verb):
    import fsspec

    monkeypatch.setenv("AWS_ENDPOINT_URL", "http://127.0.0.1:9")
    fsspec.get_filesystem_class("s3").clear_instance_cache()
    monkeypatch.setattr(patience, "UNREACHED_SECONDS", 0.5)
    assert main([verb, str(recipe), "--out", "s3://products/x"]) == 1
    assert "the object storage cannot be reached" in capsys.readouterr().err


def test_a_storage_that_fails_for_too_long_loses_nothing(switch, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(patience, "MOST_SECONDS", 2.0)
    task = fake_stages.task("a", folder="datasets/a")
    (tmp_path / "file").write_bytes(b"whole")
    out = place("s3://products/long")
    (out / task.products[0]).write_bytes(b"whole")
    Ledger(out).finish(task, {Path(task.products[0]).name: Product.of(tmp_path / "file")}, 1.0)
    switch.set("fail")
    with pytest.raises(patience.StorageFailed, match="failed for 2 s"):
        Ledger(out).state(task)
    assert capsys.readouterr().err.count("the object storage fails") == 1
    switch.set("")
    assert Ledger(out).state(task) == "done"


def after_first_receipt(switch, action):
    """Call a function, in a thread, as soon as the first receipt is written."""
    switch.paths.clear()

    def watch():
        while not any(re.fullmatch(r"PUT .*/ledger/.*\.json", path) for path in list(switch.paths)):
            time.sleep(0.05)
        action()

    thread = threading.Thread(target=watch, daemon=True)
    thread.start()
    return thread


@pytest.mark.slow
def test_a_run_waits_for_a_storage_that_fails_for_a_minute(switch, recipe, capsys):
    def fail():
        switch.set("fail")
        time.sleep(60)
        switch.set("")

    thread = after_first_receipt(switch, fail)
    assert main(["generate", str(recipe), "--out", "s3://products/minute", "--workers", "1"]) == 0
    thread.join()
    said = capsys.readouterr().err
    assert said.count("the object storage fails") == 1, said
    assert main(["check", str(recipe), "--out", "s3://products/minute"]) == 1  # nothing was trained
    assert "generate" not in capsys.readouterr().err


@pytest.mark.slow
def test_a_run_ends_when_its_storage_fails_for_too_long_and_goes_on_later(switch, recipe, capsys, monkeypatch):
    tokens = ["--out", "s3://products/ends", "--workers", "1"]
    monkeypatch.setattr(patience, "MOST_SECONDS", 5.0)  # of the driver; workers would wait for ten minutes
    thread = after_first_receipt(switch, lambda: switch.set("fail"))
    assert main(["generate", str(recipe), *tokens]) == 1
    thread.join()
    said = capsys.readouterr().err.strip().splitlines()
    assert "the object storage" in said[-1] and "finished work is kept" in said[-1] and len(said[-1]) <= 300
    switch.set("")
    done = len(list(place("s3://products/ends/ledger").glob("*.json")))
    assert done >= 1
    assert main(["generate", str(recipe), *tokens]) == 0
    table = capsys.readouterr().out
    assert f"generate      4         {4 - done}" in table, table


@pytest.mark.slow
def test_a_whole_run_and_each_verb_after_it(switch, tmp_path, capsys, recipe):
    address = "s3://products/run"
    assert main(["run", str(recipe), "--out", address, "--workers", "1"]) == 0, capsys.readouterr().err
    assert f"the page: {address}/report/stored/index.html" in capsys.readouterr().out
    for verb in ("check", "status", "plan", "bench", "report", "results"):
        assert main([verb, str(recipe), "--out", address]) == 0, capsys.readouterr().err
    there = place(address)
    assert main(["check", f"{address}/datasets/{next(there.glob('datasets/*')).name}"]) == 0
    # What is gone is made again.
    weights = next(there.glob("models/*/model.safetensors"))
    picture = next(there.glob("report/stored/figures/*.png"))
    whole = weights.read_bytes(), picture.read_bytes()
    for path in (weights, picture):
        path.unlink()
    assert main(["check", str(recipe), "--out", address]) == 1
    assert main(["check", str(recipe), "--repair", "--out", address, "--workers", "1"]) == 0, capsys.readouterr().err
    assert weights.read_bytes() == whole[0] and picture.exists()
    # Another recipe needs none of it.
    capsys.readouterr()
    assert main(["prune", str(small(tmp_path, "other", seed=9)), "--delete", "--out", address]) == 0
    assert "files removed" in capsys.readouterr().out
    left = [str(path.relative_to(there)) for path in there.rglob("*") if path.is_file()]
    assert sorted(left) == ["ledger/lock", "report/stored/results.md"]
