"""Short shards go to a worker in bundles, and each of them ends as it would alone."""

import io

import pytest
from rich.console import Console

from jobs.plan.bundles import Bundles
from jobs.run.dispatch import Dispatch
from jobs.run.executor import execute
from jobs.run.ledger import Ledger


@pytest.fixture
def fake(monkeypatch, request):
    monkeypatch.syspath_prepend(request.path.parents[1])
    import fake_stages

    return fake_stages


@pytest.fixture
def sizes(monkeypatch):
    """The numbers of tasks that are handed over at once, in bundles of eight."""
    found, start = [], Dispatch.start

    def spied(self, tasks, *rest):
        found.append(len(tasks))
        start(self, tasks, *rest)

    monkeypatch.setattr(Dispatch, "start", spied)
    monkeypatch.setattr(Bundles, "size", 8)
    return found


def run(tasks, out):
    return execute(tasks, out, workers=1, console=Console(file=io.StringIO()))


def starts(fake, out):
    return sorted(event["name"] for event in fake.events(out) if event["event"] == "start")


def test_short_shards_go_together_and_each_has_a_receipt(tmp_path, fake, sizes):
    tasks = [fake.task(f"shard {index}") for index in range(40)]
    summary = run(tasks, tmp_path)
    assert len(summary.ran) == 40 and sizes[0] == 8
    assert starts(fake, tmp_path) == sorted(task.title for task in tasks)
    assert all(Ledger(tmp_path).done(task) for task in tasks)


def test_in_a_bundle_too_only_what_is_bad_fails(tmp_path, fake, sizes):
    good = [fake.task(f"shard {index}") for index in range(14)]
    bad, killer = fake.task("bad", fails="ValueError('bad')"), fake.task("killer", dies=True, always=True)
    summary = run([*good[:4], bad, killer, *good[4:]], tmp_path)
    assert {task.title for task in summary.ran} == {task.title for task in good}
    assert {task.title for task in summary.failed} == {"bad", "killer"} and sizes[0] == 8
    assert Ledger(tmp_path).reason(bad) == "ValueError: bad; tried 3 times"
    assert "is there enough memory" in Ledger(tmp_path).reason(killer)


def test_a_bundle_that_takes_too_long_is_given_back(tmp_path, fake, sizes):
    """A worker must not keep shards for itself that turn out to be long."""
    tasks = [fake.task(f"shard {index}", seconds=0.6) for index in range(6)]
    summary = run(tasks, tmp_path)
    assert len(summary.ran) == 6
    assert starts(fake, tmp_path) == sorted(task.title for task in tasks)
    assert sizes == [6, 5, 4, 3, 2, 1]
