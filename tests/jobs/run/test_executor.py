"""What the driver decides, with each task done in this process; then runs on processes of this machine."""

import io
import os
from concurrent.futures import ThreadPoolExecutor

import dask.config
import pytest
from rich.console import Console

from jobs.run import executor
from jobs.run.ledger import Ledger
from jobs.run.outcome import work
from tests.jobs import fake_stages as fake
from tests.jobs.made_up import flip
from weaves.errors import WorkFailed


@pytest.fixture
def plan():
    shards = [fake.task(f"shard {index}") for index in range(3)]
    net = fake.task("net", fake.FakeTraining, needs=shards)
    return [*shards, net, fake.task("error", fake.FakeBench, needs=[net])]


def titles(tasks):
    return [task.title for task in tasks]


def test_manifests_hear_of_each_task_and_are_whole_before_a_task_that_needs_others(tmp_path, here, plan):
    heard = fake.Heard()
    assert titles(fake.run(plan[:4], tmp_path, manifests=[heard]).ran) == ["shard 0", "shard 1", "shard 2", "net"]
    assert heard == ["saved", *titles(plan[:3]), "saved", "net", "saved"]
    again = fake.run(plan, tmp_path)
    assert titles(again.before) == titles(plan[:4]) and titles(again.ran) == ["error"]


def test_kernels_are_compiled_before_the_tasks_that_are_not_done(tmp_path, here, monkeypatch, plan):
    asked = []

    def groups(tasks):
        asked.extend(titles(tasks))
        return [fake.Group("bad", tmp_path, fails=True), fake.Group("good", tmp_path)]

    fake.done(tmp_path, plan[0])
    monkeypatch.setattr(executor, "kernel_groups", groups)
    summary = fake.run(plan[:3], tmp_path)
    assert asked == titles(summary.ran) == ["shard 1", "shard 2"]
    events = [(event["event"], event["name"]) for event in fake.events(tmp_path)][2:]
    assert events[:2] == [("compiled", "good"), ("start", "shard 1")]


def test_damaged_products_are_made_again_and_nothing_else(tmp_path, here, plan):
    fake.done(tmp_path, *plan[:3])
    shard = tmp_path / plan[1].products[0]
    whole = shard.read_bytes()
    flip(shard)
    assert Ledger(tmp_path).state(plan[1]) == "done"  # its size is right
    console = Console(file=io.StringIO(), width=200)
    summary = fake.run(plan[:4], tmp_path, console)
    assert titles(summary.ran) == ["shard 1", "net"] and titles(summary.before) == ["shard 0", "shard 2"]
    assert shard.read_bytes() == whole and "generate shard 1: damaged, made again" in console.file.getvalue()
    flip(shard)
    assert titles(fake.run(plan, tmp_path).ran) == ["error"]  # no task reads the shard
    (tmp_path / "ledger" / f"{plan[4].id}.json").unlink()
    flip(tmp_path / plan[3].products[0])
    assert titles(fake.run(plan, tmp_path).ran) == ["shard 1", "net", "error"]


def test_damaged_needs_of_a_stage_that_does_not_run_are_named_and_each_is_read_once(tmp_path, here, plan):
    fake.done(tmp_path, *plan[:3])
    flip(tmp_path / plan[1].products[0])
    for reason in (
        "shard 1: its products were damaged and are removed; run `twillight generate`",
        "train: 1 tasks that it needs are not done; run `twillight generate` with this recipe first",
    ):
        with pytest.raises(WorkFailed, match=reason):
            fake.run(plan, tmp_path, stages=["train"])
    fake.done(tmp_path, *plan[:3])
    ledger = Ledger(tmp_path)
    assert ledger.damaged(plan[:3]) == []
    flip(tmp_path / plan[1].products[0])
    assert ledger.damaged(plan[:3]) == [] and ledger.damaged(plan[:3], anew=True) == [plan[1]]
    assert not (tmp_path / plan[1].products[0]).exists() and Ledger(tmp_path).state(plan[1]) == "missing"


@pytest.mark.parametrize("always", [False, True])
def test_a_task_that_fails_on_an_input_damaged_meanwhile_is_tried_once_more(tmp_path, here, always):
    shards = [fake.task(f"shard {index}") for index in range(2)]
    victim = str(tmp_path / shards[0].products[0])
    net = fake.task("net", fake.FakeTraining, needs=shards, damages=victim, always=always)
    summary = fake.run([*shards, net], tmp_path)
    if always:
        assert titles(summary.failed) == ["net"]
        return
    assert titles(summary.ran) == ["shard 1", "shard 0", "net"]
    names = [event["name"] for event in fake.events(tmp_path) if event["event"] == "start"]
    assert names.count("shard 0") == names.count("net") == 2 and names.count("shard 1") == 1


def test_what_is_taken_from_another_data_set_is_heard_of_once(tmp_path):
    """A second data set that shares a shard: its manifest was written when the shard was not there."""
    first, twin = (fake.task("x", folder=f"datasets/{name}") for name in "ab")
    fake.done(tmp_path, first)
    for expected in (["x", "saved"], ["saved"]):
        heard = fake.Heard()
        summary = fake.run([twin], tmp_path, manifests=[heard])
        assert heard == expected and summary.before == [twin] and not summary.ran


def test_tasks_side_by_side_in_a_process_share_it_only_if_they_may(tmp_path, monkeypatch):
    """A worker with several threads: two trainings in its process would draw from the same random numbers."""
    monkeypatch.setattr(fake.Fake, "shares_process", True)
    monkeypatch.setattr(fake.FakeTraining, "shares_process", False)
    tasks = [fake.task(f"{kind.stage} {index}", kind) for kind in (fake.Fake, fake.FakeTraining) for index in range(2)]
    with ThreadPoolExecutor(len(tasks)) as pool:
        outcomes = list(pool.map(lambda task: work(task, tmp_path, lambda share: None, threads=4), tasks))
    assert not any(outcome.reason for outcome in outcomes)
    pids = {event["name"]: event["pid"] for event in fake.events(tmp_path)}
    assert pids["generate 0"] == pids["generate 1"] == os.getpid() and len({*pids.values()}) == 3


@pytest.mark.external
def test_a_run_on_processes_of_this_machine(tmp_path, monkeypatch):
    """Kernels first; a worker that dies, tasks that fail alone, and at the end tasks with a process each."""
    good, victim = fake.task("good", seconds=0.4), fake.task("victim", dies=True, seconds=0.2)
    bad, forgetful = fake.task("bad", fails="ZeroDivisionError('by zero')"), fake.task("forgetful", forgets=True)
    fine, stuck = fake.task("fine", fake.FakeTraining, needs=[good]), fake.task("stuck", fake.FakeTraining, needs=[bad])
    timed = [fake.task(f"timed {index}", fake.FakeTiming, dies=index == 1) for index in range(3)]
    late = fake.task("late", fake.FakeTiming, fails="ValueError('late')")
    tasks = [good, bad, forgetful, victim, *timed, late, fine, stuck]
    groups = [fake.Group("whole", tmp_path), fake.Group("broken", tmp_path, fails=True)]
    monkeypatch.setattr(executor, "kernel_groups", lambda todo: groups)
    heard = fake.Heard()
    summary = fake.run(tasks, tmp_path, workers=2, manifests=[heard])
    assert set(titles(summary.ran)) == {"good", "victim", "fine", *titles(timed)} == {*heard} - {"saved"}
    assert set(titles(summary.failed)) == {"bad", "forgetful", "late"} and titles(summary.waiting) == ["stuck"]
    ledger = Ledger(tmp_path)
    assert ledger.reason(bad) == "ZeroDivisionError: by zero; tried 3 times"
    assert ledger.reason(late) == "ValueError: late; tried 3 times"
    assert "forgetful.txt" in ledger.reason(forgetful) and ledger.state(stuck) == "missing"
    events = fake.events(tmp_path)
    assert (events[0]["event"], events[0]["name"]) == ("compiled", "whole")
    starts = [event for event in events if event["event"] == "start"]
    assert [event["name"] for event in starts].count("victim") == 2
    # What measures time runs after all else, alone, in a new process: one died and was replaced, one was tried thrice.
    alone = [event for event in starts if event["name"].startswith(("timed", "late"))]
    assert starts[-len(alone) :] == alone and len(alone) == 7
    assert len({event["pid"] for event in alone} - {event["pid"] for event in starts[: -len(alone)]}) == 7
    assert {event["threads"] for event in events} == {"1"}


@pytest.mark.external
@pytest.mark.slow
def test_a_task_that_kills_every_worker_fails_alone(tmp_path):
    """The shards that wait at its worker die with it each time, and are done nevertheless."""
    killer = fake.task("killer", dies=True, always=True)
    tasks = [killer, *(fake.task(f"shard {index}") for index in range(2))]
    summary = fake.run(tasks, tmp_path, workers=1)
    assert summary.failed == [killer] and len(summary.ran) == 2
    assert "is there enough memory" in Ledger(tmp_path).reason(killer)


@pytest.mark.external
@pytest.mark.slow
def test_a_worker_that_is_replaced_slowly_is_not_given_up(tmp_path):
    """By default dask never replaces a worker that is not back when its time is over, and the run stands still."""
    with dask.config.set({"distributed.deploy.lost-worker-timeout": "50ms"}):
        tasks = [fake.task(f"victim {index}", dies=True) for index in range(2)]
        summary = fake.run(tasks, tmp_path, workers=1)
    assert len(summary.ran) == 2
