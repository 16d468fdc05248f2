"""Damaged inputs of right size: found before they are read, and made again, exactly they."""

import io
import sys
from pathlib import Path

import pytest
from rich.console import Console

from jobs.run.executor import execute
from jobs.run.ledger import Ledger
from jobs.run.receipt import measure
from weaves.errors import WorkFailed

pytestmark = pytest.mark.external  # clusters of dask

HERE = Path(__file__).parents[1]


@pytest.fixture
def fake(monkeypatch):
    monkeypatch.syspath_prepend(HERE)
    import fake_stages

    yield fake_stages
    sys.modules.pop("fake_stages", None)


def flip(path, place=-1):
    content = bytearray(path.read_bytes())
    content[place] ^= 1
    path.write_bytes(content)


def done(fake, out, *tasks):
    """Write the products and receipts of tasks, as a run would."""
    for task in tasks:
        task.run(out, lambda fraction: None)
        ledger = Ledger(out)
        ledger.finish(task, {Path(path).name: measure(out / path) for path in task.products}, 1.0)


def quiet():
    return Console(file=io.StringIO())


@pytest.fixture
def plan(fake):
    shards = [fake.task(f"shard {index}") for index in range(3)]
    net = fake.task("net", fake.FakeTraining, needs=shards)
    return [*shards, net, fake.task("error", fake.FakeBench, needs=[net])]


def test_each_need_is_read_once(tmp_path, fake, plan):
    done(fake, tmp_path, *plan[:3])
    ledger = Ledger(tmp_path)
    assert ledger.damaged(plan[:3]) == []
    flip(tmp_path / plan[1].products[0])
    assert ledger.damaged(plan[:3]) == []
    assert ledger.damaged(plan[:3], anew=True) == [plan[1]]
    assert not (tmp_path / plan[1].products[0]).exists()
    assert Ledger(tmp_path).state(plan[1]) == "missing"


def test_a_damaged_shard_is_made_again_and_nothing_else(tmp_path, fake, plan):
    done(fake, tmp_path, *plan[:3])
    shard = tmp_path / plan[1].products[0]
    whole = shard.read_bytes()
    flip(shard)
    assert Ledger(tmp_path).state(plan[1]) == "done"  # its size is right
    console = quiet()
    summary = execute(plan, Ledger(tmp_path), workers=1, console=console)
    assert [task.title for task in summary.ran] == ["shard 1", "net", "error"]
    assert [task.title for task in summary.before] == ["shard 0", "shard 2"]
    assert shard.read_bytes() == whole
    assert "generate shard 1: damaged, made again" in console.file.getvalue()


def test_a_chain_of_damaged_products_is_made_again(tmp_path, fake, plan):
    done(fake, tmp_path, *plan[:4])
    for task in (plan[0], plan[3]):
        flip(tmp_path / task.products[0])
    summary = execute(plan, Ledger(tmp_path), workers=1, console=quiet())
    assert [task.title for task in summary.ran] == ["shard 0", "net", "error"]


def test_what_no_task_reads_is_not_looked_at(tmp_path, fake, plan):
    done(fake, tmp_path, *plan[:4])
    flip(tmp_path / plan[0].products[0])
    assert [task.title for task in execute(plan, Ledger(tmp_path), workers=1, console=quiet()).ran] == ["error"]


def test_a_damaged_product_of_a_stage_that_does_not_run_is_named(tmp_path, fake, plan):
    done(fake, tmp_path, *plan[:3])
    flip(tmp_path / plan[1].products[0])
    with pytest.raises(
        WorkFailed, match="shard 1: its products were damaged and are removed; run `twillight generate`"
    ):
        execute(plan, Ledger(tmp_path), stages=["train"], workers=1, console=quiet())
    with pytest.raises(WorkFailed, match="1 tasks that it needs are not done; run `twillight generate` first"):
        execute(plan, Ledger(tmp_path), stages=["train"], workers=1, console=quiet())


def test_a_task_that_fails_on_an_input_damaged_meanwhile_is_tried_once_more(tmp_path, fake):
    shards = [fake.task(f"shard {index}") for index in range(2)]
    victim = str(tmp_path / shards[0].products[0])
    net = fake.task("net", fake.FakeTraining, needs=shards, damages=victim)
    summary = execute([*shards, net], Ledger(tmp_path), workers=1, console=quiet())
    assert [task.title for task in summary.ran] == ["shard 1", "shard 0", "net"]
    names = [event["name"] for event in fake.events(tmp_path) if event["event"] == "start"]
    assert names.count("shard 0") == names.count("net") == 2 and names.count("shard 1") == 1


def test_a_task_that_damages_its_inputs_each_time_fails(tmp_path, fake):
    shard = fake.task("shard")
    net = fake.task("net", fake.FakeTraining, needs=[shard], damages=str(tmp_path / shard.products[0]), always=True)
    summary = execute([shard, net], Ledger(tmp_path), workers=1, console=quiet())
    assert [task.title for task in summary.failed] == ["net"]
