"""Kills at random moments: the same command continues, and the bytes are those of a run that nothing disturbs."""

import io
import random
import time
from contextlib import nullcontext, suppress

import dask.config
import psutil
import pytest
from rich.console import Console

from tests.faults.runs import cluster, end, family, finish, gone, hashes, run, start
from tests.jobs import fake_stages as fake

pytestmark = pytest.mark.faults

KILLS = 20
LONGEST = 12.0  # seconds until a kill


def wait_for_a_moment(process, out, random):
    """Wait for a random time, or until a random number of new files has appeared; True if the run still lives."""
    limit = time.monotonic() + LONGEST
    if random.random() < 0.5:
        limit = time.monotonic() + random.uniform(0.2, LONGEST)
        files = float("inf")
    else:
        files = sum(1 for _ in out.rglob("*")) + random.randint(1, 12)
    while time.monotonic() < limit and process.poll() is None and sum(1 for _ in out.rglob("*")) < files:
        time.sleep(0.002)
    return process.poll() is None


@pytest.mark.parametrize("theirs", [False, True], ids=["own cluster", "scheduler"])
def test_killed_drivers(recipe, undisturbed, tmp_path, theirs):
    """A killed driver leaves no process; workers of a scheduler may still be at its tasks when the next one starts."""
    seeded, kills, out = random.Random(1 + 3 * theirs), 0, tmp_path / "0"
    with cluster(tmp_path, 0) if theirs else nullcontext((None, None)) as (_, file):
        flags = ["--scheduler", str(file)] if theirs else []
        while kills < KILLS:
            out.mkdir(exist_ok=True)
            process = start(recipe, out, *flags)
            alive = wait_for_a_moment(process, out, seeded)
            children = family(process)
            if alive:
                process.kill()
                kills += 1
            ended = end(process)
            assert not gone(children)
            if not alive:
                assert ended.code == 0, ended.stderr
                assert hashes(recipe, out) == undisturbed[1]
                out = tmp_path / str(kills)
        finish(recipe, out, undisturbed, *flags)


def test_killed_workers(recipe, undisturbed, tmp_path):
    """A run survives the loss of its workers, three of them in a row at most."""
    seeded, kills, runs = random.Random(2), 0, 0
    while kills < KILLS:
        out = tmp_path / str(runs)
        out.mkdir()
        runs += 1
        process = start(recipe, out)
        for _ in range(3):
            if not wait_for_a_moment(process, out, seeded):
                break
            workers = list(filter(works, family(process)))
            if workers:
                seeded.choice(workers).kill()
                kills += 1
        ended = end(process)
        # A task may have lost its worker too often: the same command continues.
        assert ended.code == 0 or ended.sentence
        finish(recipe, out, undisturbed)


def test_killed_schedulers(recipe, undisturbed, tmp_path):
    seeded, out, kills = random.Random(3), tmp_path / "0", 0
    while kills < KILLS:
        out.mkdir(exist_ok=True)
        with cluster(tmp_path, kills) as (scheduler, file):
            process = start(recipe, out, "--scheduler", str(file))
            alive = wait_for_a_moment(process, out, seeded)
            if alive:
                scheduler.kill()
                kills += 1
            ended = end(process)
        assert ended.code == 0 or (alive and ended.sentence), ended.stderr
        if not alive:
            assert hashes(recipe, out) == undisturbed[1]
            out = tmp_path / str(kills)
    finish(recipe, out, undisturbed)


def test_killed_parts(recipe, undisturbed, tmp_path):
    """Parts at the same time, one of them twice; one is killed, and all are started again."""
    seeded, out = random.Random(4), tmp_path / "out"
    out.mkdir()
    for stage, kills in (("generate", 6), ("train", 2)):
        ends = []
        while kills or not ends or any(ended.code for ended in ends):
            processes = [start(recipe, out, "--part", part, verb=stage) for part in ("1/2", "2/2", "2/2")]
            victim = seeded.choice(processes)
            if kills and wait_for_a_moment(victim, out, seeded):
                victim.kill()
            kills = max(0, kills - 1)
            ends = [end(process) for process in processes]
            assert all(ended.code in (0, -9) for ended in ends), ends
        run(recipe, out, verb=stage)
    finish(recipe, out, undisturbed)


DIES_ONCE = """
import os, pathlib, signal
flag = pathlib.Path("FLAG")
if not flag.exists():
    flag.touch()
    os.kill(os.getpid(), signal.SIGKILL)
"""


def test_a_worker_killed_while_the_cluster_starts(tmp_path):
    (tmp_path / "dies.py").write_text(DIES_ONCE.replace("FLAG", str(tmp_path / "died")))  # dask runs a copy
    console = Console(file=io.StringIO(), width=400)
    with dask.config.set({"distributed.worker.preload": [str(tmp_path / "dies.py")]}):
        summary = fake.run([fake.task("one"), fake.task("other")], tmp_path, console, workers=2)
    assert len(summary.ran) == 2 and (tmp_path / "died").exists()
    assert "2 worker processes could not start" in console.file.getvalue()


def works(process):
    with suppress(psutil.NoSuchProcess):
        command = " ".join(process.cmdline())
        return not process.children() and ("spawn_main" in command or "own_process" in command)
    return False
