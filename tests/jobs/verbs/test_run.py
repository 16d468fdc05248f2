"""Stages in parts: their products, and what one closing command adds, are those of an undivided run, byte for byte."""

import errno
import fcntl
import random
import subprocess
import sys
from unittest.mock import Mock

import pytest

from jobs.plan.dataset import Shard
from jobs.plan.measurements.measurement import Measurement
from jobs.plan.plan import KINDS
from jobs.plan.training import Training
from jobs.run import executor, outcome
from jobs.verbs.run import Part
from tests.jobs import made_up
from tests.refusals import refusal
from weaves.errors import WorkFailed

NO_PARTS = ["0/1000", "1001/1000", "x/y", "5/0", "", "3", "1/2/3", "-1/2", "1.0/2", "01/2", " 1/2", "1/2\n", "٣/٤"]


@pytest.fixture
def recipe(tmp_path, here, monkeypatch):
    """Write a recipe whose tasks write what depends on their ids alone, in this process; return its path."""
    for kind in {Shard, Training, Measurement, *KINDS}:
        monkeypatch.setattr(kind, "run", lambda task, out, progress: made_up.make(task, out))
    monkeypatch.setattr(executor, "kernel_groups", lambda tasks: [])
    monkeypatch.setattr(outcome, "in_own_process", lambda run, out, progress: run(out, progress))
    return made_up.write_recipe(tmp_path, "tiny", "neumip", "woven")


def lasting(out):
    """Return the bytes of all files but those that hold times, and the names of all receipts."""
    files = made_up.contents(out)
    products = {path: content for path, content in files.items() if not path.startswith("ledger/")}
    return {path: content for path, content in products.items() if not path.endswith(".machine.json")}, sorted(files)


def test_parts_in_any_order_and_one_closing_command_a_stage_are_an_undivided_run(recipe, tmp_path, call):
    whole, parted = tmp_path / "whole", tmp_path / "parted"
    for stage, parts in (("generate", 3), ("train", 2), ("bench", 2)):
        assert call(stage, recipe, "--out", whole)[0] == 0
        numbers = random.Random(stage).sample(range(1, parts + 1), parts)
        for number in (*numbers, numbers[0]):
            code, said, told = call(stage, recipe, "--out", parted, "--part", f"{number}/{parts}")
            assert code == 0 and f"when all {parts} parts are done: `twillight {stage}" in said, told
        assert "nothing to do" in said
        code, said, _ = call(stage, recipe, "--out", parted)
        assert code == 0 and ("nothing to do" in said) == (stage != "bench")  # times are in no part
        found, expected = lasting(parted), lasting(whole)
        assert found[1] == expected[1] and found[0].keys() == expected[0].keys()
        timed = {path for task in made_up.plan(made_up.load_recipe(recipe)) if task.timed for path in task.products}
        assert all(content == expected[0][path] for path, content in found[0].items() if path not in timed)


def test_what_is_missing_is_shown_and_a_manifest_is_written_by_check_repair_too(recipe, tmp_path, call):
    whole, parted = tmp_path / "whole", tmp_path / "parted"
    generate = "generate", recipe, "--out", parted, "--part"
    assert call("generate", recipe, "--out", whole)[0] == 0 and call(*generate, "1/2")[0] == 0
    status = call("status", recipe, "--out", parted)[1]
    assert "generate 2 0 2" in status, status
    assert call(*generate, "2/2")[0] == 0 and not list(parted.glob("datasets/*/manifest.json"))
    code, _, told = call("train", recipe, "--out", parted, "--part", "1/2")
    assert code == 1 and "its manifest lacks shards; run `twillight generate` without --part" in told
    made_up.flip(next(parted.glob("datasets/*/*.parquet")))
    assert call("check", recipe, "--out", parted, "--repair")[0] == 1  # nothing was trained
    assert lasting(parted) == lasting(whole)


def test_a_task_of_a_part_that_fails_leaves_the_others_and_is_told(recipe, tmp_path, call, monkeypatch):
    def run(task, out, progress):
        if task.shard.split == "train":
            raise WorkFailed("no light")
        made_up.make(task, out)

    monkeypatch.setattr(Shard, "run", run)
    code, _, told = call("generate", recipe, "--out", tmp_path / "out", "--part", "1/1")
    assert code == 1 and told.splitlines()[-1].startswith("denim train rows 0–63: no light; 1 more failed; see")
    assert "generate 2 2 0" in call("status", recipe, "--out", tmp_path / "out")[1]


def test_a_part_is_refused_without_locks(recipe, tmp_path, call, monkeypatch):
    part = "generate", recipe, "--out", tmp_path / "out", "--part", "1/2"
    for name, expected in (("lockf", 1), ("flock", 2)):
        monkeypatch.setattr(fcntl, name, Mock(side_effect=OSError(errno.ENOLCK, "No locks available")))
        code, _, told = call(*part)
        assert code == expected and "No locks available" in told and "file system with locks" in told


def test_libraries_of_a_part_are_loaded_for_one_thread():
    shown = "'numpy' in sys.modules, main(), os.environ['OPENBLAS_NUM_THREADS']"  # libraries read it at their import
    code = f"import os, sys; from jobs.entry import main; print({shown})"
    command = ["env", "OPENBLAS_NUM_THREADS=2", sys.executable, "-c", code, "train", "quick", "--part=0/1"]
    assert subprocess.check_output(command, text=True) == "False 2 1\n"


def test_a_text_that_names_no_part_is_bad_input():
    for text in (*NO_PARTS, f"1/{10**9}", "9" * 5000 + "/1"):
        assert "must be a number, a slash and the number of parts" in refusal(Part.read, text), text


@pytest.mark.parametrize("stage", ["generate", "train", "bench"])
def test_each_task_that_waits_for_no_other_of_its_stage_is_in_exactly_one_part(files, stage):
    tasks = files.plan()
    whole = [task.id for task in Part(1, 1).of(tasks, stage)]
    for parts in (1, 2, 3, 7, len(whole) + 5):
        named = [Part.read(f"{number}/{parts}") for number in range(1, parts + 1)]
        shares = [[task.id for task in part.of(tasks, stage)] for part in named]
        assert sorted(id for share in shares for id in share) == sorted(whole)
        assert max(map(len, shares)) - min(map(len, shares)) <= 1
    rest = [task for task in tasks if task.stage == stage and task.id not in whole]
    own = {task.id for task in tasks if task.stage == stage}
    assert all(task.timed or own & set(task.needs) for task in rest)
    assert bool(rest) == (stage == "bench")
