import hashlib
import io
import os
import signal
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import dask.config
import psutil
import pytest
from rich.console import Console

from jobs.run.cluster import Scheduler
from jobs.run.executor import Preparation, execute
from jobs.run.ledger import Ledger
from jobs.run.outcome import work
from jobs.run.receipt import measure
from weaves.errors import BadInput, WorkFailed

pytestmark = pytest.mark.external  # clusters of dask

HERE = Path(__file__).parents[1]


@pytest.fixture
def fake(monkeypatch):
    monkeypatch.syspath_prepend(HERE)
    import fake_stages

    return fake_stages


def quiet():
    return Console(file=io.StringIO())


def hashes(out):
    files = sorted(path for folder in ("generate", "train") for path in (out / folder).glob("*"))
    return {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in files}


def test_a_failing_task_stops_only_what_needs_it(tmp_path, fake):
    good, timed = fake.task("good"), fake.task("timed", fake.FakeTiming, seconds=0.3)
    bad = fake.task("bad", fails="ZeroDivisionError('by zero')")
    forgetful = fake.task("forgetful", forgets=True)
    fine, stuck = fake.task("fine", fake.FakeTraining, needs=[good]), fake.task("stuck", fake.FakeTraining, needs=[bad])
    slow = [fake.task(f"slow {index}", seconds=0.5) for index in range(2)]
    tasks = [good, bad, forgetful, *slow, timed, fine, stuck]
    recorded = []
    summary = execute(
        tasks, Ledger(tmp_path), workers=2, recorded=lambda task, files: recorded.append(task.title), console=quiet()
    )

    assert {task.title for task in summary.ran} == {"good", "fine", "timed", "slow 0", "slow 1"} == set(recorded)
    assert {task.title for task in summary.failed} == {"bad", "forgetful"}
    assert [task.title for task in summary.waiting] == ["stuck"]
    ledger = Ledger(tmp_path)
    assert ledger.reason(bad) == "ZeroDivisionError: by zero; tried 3 times"
    assert "forgetful.txt" in ledger.reason(forgetful)
    assert ledger.state(stuck) == "missing"

    # What measures time ran after all else, alone, in a process that had done nothing before.
    events = fake.events(tmp_path)
    assert events[-1]["name"] == events[-2]["name"] == "timed"
    assert events[-1]["pid"] not in {event["pid"] for event in events[:-2]}
    assert {event["threads"] for event in events} == {"1"}

    # A second run does the failed ones again and nothing else.
    again = execute(tasks, Ledger(tmp_path), workers=1, console=quiet())
    assert {task.title for task in again.ran + again.failed} == {"bad", "forgetful"}
    assert len(again.before) == 5


def test_kernels_are_compiled_before_the_tasks_that_are_not_done(tmp_path, fake):
    done, bad = fake.task("done"), fake.task("bad", fails="ValueError('no kernel')")
    execute([done], Ledger(tmp_path), workers=1, console=quiet())
    tasks = [done, bad, *(fake.task(f"new {index}") for index in range(3))]

    def prepare(todo):
        return [Preparation(task.title, fake.prepare, (tmp_path, task)) for task in todo]

    summary = execute(tasks, Ledger(tmp_path), workers=2, prepare=prepare, console=quiet())
    events = [(event["event"], event["name"]) for event in fake.events(tmp_path)][2:]
    assert {name for event, name in events[:3] if event == "prepared"} == {"new 0", "new 1", "new 2"}
    # What cannot be compiled is told by the task that needs it.
    assert [task.title for task in summary.failed] == ["bad"]


def test_a_killed_worker_costs_one_retry(tmp_path, fake):
    tasks = [fake.task("victim", dies=True, seconds=0.2), fake.task("other", seconds=0.4)]
    summary = execute(tasks, Ledger(tmp_path), workers=2, console=quiet())
    assert {task.title for task in summary.ran} == {"victim", "other"}
    starts = [event["name"] for event in fake.events(tmp_path) if event["event"] == "start"]
    assert starts.count("victim") == 2


@pytest.mark.slow
def test_a_task_that_kills_every_worker_fails_alone(tmp_path, fake):
    """The shards that wait at its worker die with it each time, and are done nevertheless."""
    killer = fake.task("killer", dies=True, always=True)
    tasks = [killer, *(fake.task(f"shard {index}") for index in range(2))]
    summary = execute(tasks, Ledger(tmp_path), workers=1, console=quiet())
    assert summary.failed == [killer] and len(summary.ran) == 2
    assert "is there enough memory" in Ledger(tmp_path).reason(killer)


@pytest.mark.slow
def test_a_worker_that_is_replaced_slowly_is_not_given_up(tmp_path, fake):
    """By default dask never replaces a worker that is not back when its time is over, and the run stands still."""
    with dask.config.set({"distributed.deploy.lost-worker-timeout": "50ms"}):
        tasks = [fake.task(f"victim {index}", dies=True) for index in range(2)]
        summary = execute(tasks, Ledger(tmp_path), workers=1, console=quiet())
    assert len(summary.ran) == 2


def test_tasks_that_run_alone_have_a_process_each(tmp_path, fake):
    tasks = [fake.task(f"timed {index}", fake.FakeTiming, dies=index == 3) for index in range(5)]
    failing = fake.task("fails", fake.FakeTiming, fails="ValueError('late')")
    summary = execute([*tasks, failing], Ledger(tmp_path), workers=2, console=quiet())
    assert {task.title for task in summary.ran} == {task.title for task in tasks}
    assert Ledger(tmp_path).reason(failing) == "ValueError: late; tried 3 times"
    starts = [event for event in fake.events(tmp_path) if event["event"] == "start"]
    assert (
        len(starts) == len({event["pid"] for event in starts}) == 9
    )  # one died and was replaced, one was tried three times
    assert {event["threads"] for event in starts} == {"1"}


def test_work_left_out_before_is_named(tmp_path, fake):
    with pytest.raises(WorkFailed, match="train: 8 tasks that it needs are not done; run `twillight generate` first"):
        execute(fake.chain(), Ledger(tmp_path), stages=["train"], console=quiet())


def test_a_scheduler_that_does_not_answer_is_bad_input(tmp_path, fake):
    with pytest.raises(BadInput, match="no dask scheduler answers"):
        execute(fake.chain(), Ledger(tmp_path), scheduler=Scheduler("nonsense://"), console=quiet())


def driver(out, plan="chain"):
    command = [sys.executable, str(HERE / "fake_stages.py"), str(out), plan]
    path = os.pathsep.join([str(HERE), str(HERE.parents[1])])
    # A background shell hands down an ignored SIGINT; the driver is to hear it as from a terminal.
    process = subprocess.Popen(
        command,
        env={**os.environ, "PYTHONPATH": path},
        start_new_session=True,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    deadline = time.monotonic() + 300
    while len(list((out / "ledger").glob("[!.]*.json"))) < 2 or (plan == "timed" and '"long"' not in log(out)):
        assert time.monotonic() < deadline and process.poll() is None
        time.sleep(0.02)
    return process, psutil.Process(process.pid).children(recursive=True)


def log(out):
    return (out / "log.jsonl").read_text()


def test_a_killed_run_goes_on_to_the_same_bytes(tmp_path, fake):
    """Kill the driver in the middle; its workers end, and the next run comes to the bytes of an undisturbed one."""
    process, workers = driver(tmp_path)
    process.kill()
    process.communicate(timeout=300)
    _, alive = psutil.wait_procs(workers, timeout=300)
    assert not alive
    tasks = fake.chain()
    done = sum(Ledger(tmp_path).state(task) == "done" for task in tasks)
    assert 2 <= done < len(tasks)
    summary = execute(tasks, Ledger(tmp_path), workers=2, console=quiet())
    assert len(summary.before) == done and len(summary.ran) == len(tasks) - done
    expected = {f"{task.title}.txt": hashlib.sha256(f"{task.title}\n".encode() * 100).hexdigest() for task in tasks}
    assert hashes(tmp_path) == expected


def test_a_task_that_runs_alone_ends_with_the_driver(tmp_path, fake):
    process, children = driver(tmp_path, "timed")
    process.kill()
    process.communicate(timeout=300)
    _, alive = psutil.wait_procs(children, timeout=300)
    assert not alive
    assert [event["event"] for event in fake.events(tmp_path) if event["name"] == "long"] == ["start"]


def test_what_is_taken_from_another_data_set_is_recorded(tmp_path, fake):
    """A second data set that shares a shard must hear of it: its manifest was written when the shard was not there."""
    (tmp_path / "datasets" / "a").mkdir(parents=True)
    (tmp_path / "datasets" / "a" / "x.txt").write_bytes(b"twelve bytes")
    first, twin = (fake.task("x", folder=f"datasets/{name}") for name in "ab")
    ledger = Ledger(tmp_path)
    ledger.finish(first, {"x.txt": measure(tmp_path / first.products[0])}, 1.0)
    recorded = []
    summary = execute([twin], Ledger(tmp_path), recorded=lambda task, files: recorded.append(task), console=quiet())
    assert recorded == [twin] == summary.before and not summary.ran
    recorded.clear()
    execute([twin], Ledger(tmp_path), recorded=lambda task, files: recorded.append(task), console=quiet())
    assert not recorded


def test_tasks_side_by_side_in_a_process_share_it_only_if_they_may(tmp_path, fake, monkeypatch):
    """A worker with several threads: two trainings in its process would draw from the same random numbers."""
    monkeypatch.setattr(fake.Fake, "shares_process", True)
    monkeypatch.setattr(fake.FakeTraining, "shares_process", False)
    tasks = [fake.task(f"{kind.stage} {index}", kind) for kind in (fake.Fake, fake.FakeTraining) for index in range(2)]
    with ThreadPoolExecutor(len(tasks)) as pool:
        outcomes = list(pool.map(lambda task: work(task, tmp_path, lambda share: None, threads=4), tasks))
    assert not any(outcome.reason for outcome in outcomes)
    pids = {event["name"]: event["pid"] for event in fake.events(tmp_path)}
    assert pids["generate 0"] == pids["generate 1"] == os.getpid()
    assert len({*pids.values()}) == 3
