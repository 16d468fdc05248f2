import json
from typing import ClassVar

import pytest

from jobs.plan.task import Place, Task
from jobs.run.ledger import Ledger, measure
from weaves.errors import BadInput, WorkFailed


class Shard(Task):
    stage: ClassVar = "generate"
    folder: Place

    @property
    def title(self):
        return "a shard"

    @property
    def products(self):
        return (f"{self.folder}/part-x.parquet",)

    def versions(self):
        return {}


TASK = Shard(folder="datasets/a-1")


@pytest.fixture
def done(tmp_path):
    """A ledger in which TASK is done."""
    product = tmp_path / TASK.products[0]
    product.parent.mkdir(parents=True)
    product.write_bytes(b"twelve bytes")
    ledger = Ledger(tmp_path)
    ledger.finish(TASK, {product.name: measure(product)}, 1.5)
    return ledger


def test_nothing_written_is_missing(tmp_path):
    assert Ledger(tmp_path).state(TASK) == "missing"
    assert Ledger(tmp_path).reason(TASK) == ""


def test_receipt_and_product_are_done(done):
    assert done.state(TASK) == "done"
    assert done.seconds(TASK) == 1.5
    receipt = json.loads((done.folder / f"{TASK.id}.json").read_text())
    assert receipt["title"] == "a shard"
    assert receipt["files"]["part-x.parquet"]["bytes"] == 12


@pytest.mark.parametrize("damage", ["gone", "cut", "receipt cut", "receipt empty"])
def test_a_damaged_product_or_receipt_is_missing(done, damage):
    product, receipt = done.out / TASK.products[0], done.folder / f"{TASK.id}.json"
    match damage:
        case "gone":
            product.unlink()
        case "cut":
            product.write_bytes(b"twelve")
        case "receipt cut":
            receipt.write_bytes(receipt.read_bytes()[:40])
        case "receipt empty":
            receipt.write_bytes(b"")
    assert done.state(TASK) == "missing"


def test_a_failure_keeps_its_reason_until_success(tmp_path, done):
    (tmp_path / TASK.products[0]).unlink()
    done.fail(TASK, "the disk was full", "Traceback …")
    assert (done.state(TASK), done.reason(TASK)) == ("failed", "the disk was full")
    product = tmp_path / TASK.products[0]
    product.write_bytes(b"whole")
    done.finish(TASK, {product.name: measure(product)}, 1.0)
    assert (done.state(TASK), done.reason(TASK)) == ("done", "")


def test_another_data_set_adopts_a_shard_it_shares(done):
    twin = Shard(folder="datasets/b-2")
    assert twin.id == TASK.id
    assert done.state(twin) == "missing"
    assert done.adopt(twin)
    assert (done.out / twin.products[0]).read_bytes() == b"twelve bytes"
    assert done.state(TASK) == done.state(twin) == "done"


def test_a_changed_shard_is_not_adopted(done):
    (done.out / TASK.products[0]).write_bytes(b"other  bytes")  # as long as the right ones
    twin = Shard(folder="datasets/b-2")
    assert not done.adopt(twin)
    assert not (done.out / twin.products[0]).exists()


def test_one_run_at_a_time(tmp_path):
    with Ledger(tmp_path).held(), pytest.raises(WorkFailed, match="another run is at work"), Ledger(tmp_path).held():
        pass
    with Ledger(tmp_path).held():
        pass


def test_a_folder_that_cannot_be_written_is_bad_input(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(BadInput, match="--out must name a folder"), Ledger(tmp_path / "file" / "out").held():
        pass
