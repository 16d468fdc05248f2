"""Products in object storage: a real S3 server, failures of it, and the bytes of a run in a folder."""

import hashlib
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from jobs.cli import main
from jobs.plan.plan import plan
from jobs.recipe.load import load_recipe
from pipeline.storage import place
from tests.jobs.s3_server import serving

RECIPE = """
name = "stored"
[dataset]
seen = ["polyester_lining"]
shard_rows = 64
[dataset.rows]
train = 128
validation = 64
test = 64
[dataset.truth]
estimator = "owen"
relative_error = 0.5
min_count = 64
max_count = 64
[[models]]
model = "neumip"
texels_per_yarn = 2
hidden = 8
[models.training]
steps = 4
batch = 32
checkpoint_every = 2
device = "cpu"
"""


@pytest.fixture(scope="module")
def server():
    with serving() as found:
        yield found


@pytest.fixture
def switch(server, monkeypatch, tmp_path):
    import s3fs

    address, switch = server
    monkeypatch.setenv("AWS_ENDPOINT_URL", address)
    monkeypatch.setenv("AWS_ACCESS_KEY_ID", "key-of-the-tests")
    monkeypatch.setenv("AWS_SECRET_ACCESS_KEY", "secret-of-the-tests")
    monkeypatch.setenv("AWS_DEFAULT_REGION", "us-east-1")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    s3fs.S3FileSystem.clear_instance_cache()
    switch.set("")
    s3fs.S3FileSystem().makedirs("products", exist_ok=True)
    yield switch
    switch.set("")


def hashes(out):
    files = [path for path in out.rglob("*") if path.is_file()]
    kept = [path for path in files if path.parent.name != "ledger"]  # receipts have times
    return {str(path.relative_to(out)): hashlib.sha256(path.read_bytes()).hexdigest() for path in kept}


def test_a_storage_that_fails_for_a_while_has_the_shards_of_a_folder(switch, tmp_path, capsys):
    recipe, address = tmp_path / "stored.toml", "s3://products/some/prefix"
    recipe.write_text(RECIPE)
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
def test_generate_train_check_and_repair_leave_the_bytes_of_a_folder(switch, tmp_path, capsys, monkeypatch):
    recipe, address = tmp_path / "stored.toml", "s3://products/whole"
    recipe.write_text(RECIPE)
    here = tmp_path / "out"
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


@pytest.mark.parametrize(
    ("address", "sentence"),
    [
        ("s3://", "names at least a bucket"),
        ("nothing://b/x", "an address of fsspec is needed"),
        ("s3://key:hidden@b/x", "credentials belong in the environment"),
        ("sftp://user:hidden@host/x", "credentials belong in the environment"),
        ("s3://there-is-none/x", "bucket"),
    ],
)
def test_addresses_that_cannot_be_used(switch, tmp_path, capsys, address, sentence):
    (tmp_path / "stored.toml").write_text(RECIPE)
    assert main(["generate", str(tmp_path / "stored.toml"), "--out", address]) == 2
    said = capsys.readouterr().err
    assert sentence in said and "hidden" not in said


def test_refusals_are_bad_input_and_show_no_secret(switch, tmp_path, capsys):
    (tmp_path / "stored.toml").write_text(RECIPE)
    switch.set("refuse")
    assert main(["generate", str(tmp_path / "stored.toml"), "--out", "s3://products/refused"]) == 2
    said = capsys.readouterr().err
    assert "credentials of the environment" in said
    assert "secret-of-the-tests" not in said and "key-of-the-tests" not in said


def test_an_upload_that_is_cut_is_tried_again_or_leaves_nothing(switch, tmp_path):
    from pipeline.storage import store

    source = tmp_path / "file"
    source.write_bytes(b"x" * 100_000)
    target = place("s3://products/cut/file")
    switch.set("cut", count=2)
    store(source, target)
    assert target.read_bytes() == source.read_bytes()
