"""`twillight publish`, killed at random moments: nothing or all, and in the end the bytes of an undisturbed run."""

import os
import random
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from jobs.plan.dataset import DataSet
from jobs.recipe.load import load_recipe
from tests.jobs import made_up

pytestmark = pytest.mark.faults

ROOT = Path(__file__).parents[2]
KILLS = 12


def test_a_killed_run_leaves_nothing_and_is_continued(tmp_path):
    large = {"seen": ["denim", "satin_8", "crepe", "voile"], "shard_rows": 4096, "rows": {"train": 65536}}
    recipe = made_up.write_recipe(tmp_path, "tiny", **large)
    made_up.finished(recipe, tmp_path / "out", ["generate"])
    folder = tmp_path / "out" / DataSet(load_recipe(recipe)).folder
    whole, target, staging = tmp_path / "whole", tmp_path / "target", tmp_path / ".tmp-target"
    command = [sys.executable, "-m", "jobs.cli", "publish", str(folder), "--licence", "MIT", "--to"]

    def start(to):
        environment = {**os.environ, "PYTHONPATH": str(ROOT)}
        return subprocess.Popen([*command, str(to)], env=environment, stdout=subprocess.DEVNULL)

    assert start(whole).wait() == 0
    chosen, kills, inside = random.Random(1), 0, 0
    while kills < KILLS:
        process = start(target)
        # Wait until it writes, then for a random number of files or a random time.
        files = chosen.randint(0, 16)
        while process.poll() is None and len(list(staging.rglob("*"))) < files:
            time.sleep(0.001)
        time.sleep(chosen.uniform(0, 0.1))
        process.send_signal(chosen.choice([signal.SIGKILL, signal.SIGTERM]))
        process.wait()
        if target.exists():  # it was done, or as good as done
            assert made_up.contents(target) == made_up.contents(whole)
            shutil.rmtree(target)
            continue
        kills += 1
        inside += staging.exists()
    assert inside >= KILLS // 2, "most kills were before anything was written"
    assert start(target).wait() == 0 and made_up.contents(target) == made_up.contents(whole) and not staging.exists()
