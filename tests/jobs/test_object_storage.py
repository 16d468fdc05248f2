"""Products in object storage: a real S3 server, failures of it, and the bytes of a run in a folder."""

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
from tests.jobs import fake_stages, made_up
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
    secret = {"AWS_ACCESS_KEY_ID": "key-of-the-tests", "AWS_SECRET_ACCESS_KEY": "secret-of-the-tests"}
    here = {"AWS_ENDPOINT_URL": address, "AWS_DEFAULT_REGION": "us-east-1", "XDG_CACHE_HOME": str(tmp_path / "cache")}
    for name, value in (secret | here).items():
        monkeypatch.setenv(name, value)
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


@pytest.fixture
def call(recipe, capsys):
    """Run a verb on the recipe with its products at an address; return the exit code, output and complaint."""

    def call(verb, address, *more, recipe=recipe):
        capsys.readouterr()
        return main([verb, str(recipe), "--out", str(address), *more]), *capsys.readouterr()

    return call


def small(folder, name, seed=0):
    """Write a recipe of four shards; return its path."""
    dataset = {"seed": seed, "shard_rows": 64, "rows": {"train": 128, "test": 64}, "truth": {"relative_error": 0.5}}
    return write_smallest(folder, name, dataset, {"hidden": 8, "training": {"batch": 32}})


def products(out):
    """Return the bytes of all files but the receipts, which have times."""
    return {path: content for path, content in made_up.contents(out).items() if not path.startswith("ledger/")}


def test_a_storage_that_fails_for_a_while_has_the_shards_of_a_folder(switch, tmp_path, call, recipe):
    address = "s3://products/some/prefix"
    switch.set("fail", count=2)
    first = call("generate", address, "--workers", "1")
    assert first[0] == 0, first
    tasks = [task for task in plan(load_recipe(recipe)) if task.stage == "generate"]
    for task in tasks:
        task.run(tmp_path, lambda share: None)
        for path in task.products:
            assert (place(address) / path).read_bytes() == (tmp_path / path).read_bytes()
    assert not Path("s3:").exists()
    again = call("generate", address)
    assert again[0] == 0 and f"nothing to do: {len(tasks)} tasks done" in again[1]
    assert "secret-of-the-tests" not in str(first + again)
    assert not any(b"secret-of-the-tests" in path.read_bytes() for path in place(address).rglob("*") if path.is_file())


def test_parts_on_machines_that_share_the_storage_alone_have_the_bytes_of_a_folder(switch, tmp_path, monkeypatch, call):
    here, address = tmp_path / "out", "s3://products/parts"
    for machine, part in enumerate((["--part", "2/2"], ["--part", "1/2"], ["--part", "2/2"], [])):
        monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / f"machine-{machine}"))
        code, said, told = call("generate", address, *part)
        assert code == 0 and ("nothing to do" in said) == (machine > 1), told
    for part in (["--part", "1/1"], []):
        assert call("generate", here, *part)[0] == 0
    assert products(place(address)) == products(here)


def test_a_query_file_and_its_answers_may_be_there(switch, tmp_path, capsys):
    up = {f"{name}_{axis}": [float(axis == "z")] * 3 for name in ("wi", "wo") for axis in "xyz"}
    queries = pa.table({"u": [0.1, 0.2, 0.3], "v": [0.5] * 3, "sigma": [1.0] * 3} | up)
    pq.write_table(queries, tmp_path / "q.parquet")
    place("s3://products/q.parquet").write_bytes((tmp_path / "q.parquet").read_bytes())
    for folder in (str(tmp_path), "s3://products"):
        out = ["--out", f"{folder}/a.parquet", "--estimator", "owen"]
        assert main(["evaluate", "denim", f"{folder}/q.parquet", *out]) == 0, capsys.readouterr().err
    assert place("s3://products/a.parquet").read_bytes() == (tmp_path / "a.parquet").read_bytes()


@pytest.mark.parametrize(
    ("address", "sentence", "verbs"),
    [
        ("s3://key:hidden@b/x", "credentials belong in the environment", ["generate"]),
        ("sftp://user:hidden@host/x", "credentials belong in the environment", ["generate"]),
        ("s3://there-is-none/x", "an existing bucket is needed", ["status", "plan", "check", "run"]),
        ("s3://products/refused", "credentials of the environment", ["generate"]),
    ],
)
def test_addresses_that_cannot_be_used_are_bad_input_and_show_no_secret(switch, call, address, sentence, verbs):
    switch.set("refuse" if "refused" in address else "")
    for verb in verbs:
        code, _, told = call(verb, address)
        assert code == 2 and sentence in told and not any(word in told for word in ("hidden", "-of-the-tests"))


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
    fake_stages.done(tmp_path, *tasks)
    s3fs.S3FileSystem().put(f"{tmp_path}/", "s3://products/many/", recursive=True)
    here, there = Ledger(tmp_path), place("s3://products/many")
    listings = 2 + 4 * 3  # of six folders; s3fs asks twice more about each that is empty
    for expected in (len(tasks) + listings, listings):
        switch.paths.clear()
        assert Counter(map(Ledger(there).state, tasks)) == {"done": 200} and len(switch.paths) <= expected
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
    assert ledger.discard(task) == [task.products[0]] and ledger.state(task) == "missing" and not product.exists()


def test_a_storage_that_does_not_answer_ends_with_a_sentence(switch, call, monkeypatch):
    import fsspec

    monkeypatch.setenv("AWS_ENDPOINT_URL", "http://127.0.0.1:9")
    fsspec.get_filesystem_class("s3").clear_instance_cache()
    monkeypatch.setattr(patience, "UNREACHED_SECONDS", 0.5)
    for verb in ("status", "plan", "check", "generate"):
        code, _, told = call(verb, "s3://products/x")
        assert code == 1 and "the object storage cannot be reached" in told


@pytest.mark.slow
def test_a_run_ends_when_its_storage_fails_for_too_long_and_goes_on_later(switch, call, monkeypatch):
    generate = "generate", "s3://products/ends", "--workers", "1"
    monkeypatch.setattr(patience, "MOST_SECONDS", 5.0)  # of the driver; workers would wait for ten minutes

    def fail_after_the_first_receipt():
        while not any(re.fullmatch(r"PUT .*/ledger/.*\.json", path) for path in list(switch.paths)):
            time.sleep(0.05)
        switch.set("fail")

    switch.paths.clear()
    thread = threading.Thread(target=fail_after_the_first_receipt, daemon=True)
    thread.start()
    code, _, told = call(*generate)
    thread.join()
    last = told.strip().splitlines()[-1]
    assert code == 1 and "the object storage" in last and "finished work is kept" in last and len(last) <= 300
    switch.set("")
    done = len(list(place("s3://products/ends/ledger").glob("*.json")))
    assert done >= 1
    code, table, _ = call(*generate)
    assert code == 0 and f"generate      4         {4 - done}" in table, table


@pytest.mark.slow
def test_a_whole_run_and_each_verb_after_it(switch, tmp_path, recipe, call):
    address = "s3://products/run"
    code, said, told = call("run", address, "--workers", "1")
    assert code == 0 and f"the page: {address}/report/stored/index.html" in said, told
    for verb in ("check", "status", "plan", "bench", "report", "results"):
        assert call(verb, address)[0] == 0
    there = place(address)
    assert main(["check", f"{address}/datasets/{next(there.glob('datasets/*')).name}"]) == 0
    for verb in ("generate", "train"):
        assert call(verb, tmp_path / "out")[0] == 0
    assert products(tmp_path / "out").items() <= products(there).items()
    # What is gone or damaged is made again.
    shard = min(there.glob("datasets/*/*.parquet"), key=str)
    made_up.flip(shard)
    code, _, told = call("check", address)
    assert code == 2 and f"{shard}: damaged" in told
    weights = next(there.glob("models/*/model.safetensors"))
    picture = next(there.glob("report/stored/figures/*.png"))
    for path in (weights, picture):
        path.unlink()
    assert call("check", address, "--repair", "--workers", "1")[0] == 0 and picture.exists()
    assert products(tmp_path / "out").items() <= products(there).items()
    # Another recipe needs none of it but what both measure without the data set.
    other = small(tmp_path, "other", seed=9)
    code, said, _ = call("prune", address, "--delete", recipe=other)
    assert code == 0 and "files removed" in said
    first, second = ({task.id: task.products for task in plan(load_recipe(path))} for path in (recipe, other))
    shared = {path for id in first.keys() & second.keys() for path in (f"ledger/{id}.json", *first[id])}
    left = {str(path.relative_to(there)) for path in there.rglob("*") if path.is_file()}
    assert left == shared | {"ledger/lock", "report/stored/results.md"}
