"""Kills at random moments: the same command continues, and the bytes are those of a run that nothing disturbs."""

import random
import time
from contextlib import nullcontext

import psutil
import pytest

from tests.faults.runs import assert_no_leftovers, cluster, end, family, gone, hashes, run, start

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


def finish(recipe, out, undisturbed, *arguments):
    found = run(recipe, out, *arguments)
    assert found.code == 0, found.stderr
    assert hashes(recipe, out) == undisturbed[1]
    assert_no_leftovers(out)


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
            found = end(process)
            assert not gone(children)
            if not alive:
                assert found.code == 0, found.stderr
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
            workers = [one for one in family(process) if not children_of(one) and works(one)]
            if workers:
                seeded.choice(workers).kill()
                kills += 1
        found = end(process)
        if found.code != 0:  # a task may have lost its worker too often: the same command continues
            found.assert_sentence()
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
            found = end(process)
        if alive and found.code != 0:
            found.assert_sentence()
        elif not alive:
            assert found.code == 0, found.stderr
            assert hashes(recipe, out) == undisturbed[1]
            out = tmp_path / str(kills)
    finish(recipe, out, undisturbed)


def works(process):
    try:
        command = " ".join(process.cmdline())
    except psutil.NoSuchProcess:
        return False
    return "spawn_main" in command or "own_process" in command


def children_of(process):
    try:
        return process.children()
    except psutil.NoSuchProcess:
        return []
