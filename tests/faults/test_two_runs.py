"""Two runs at the same time, on one folder and on one scheduler."""

import time

import pytest

from tests.faults.runs import assert_no_leftovers, cluster, end, hashes, run, start

pytestmark = pytest.mark.faults


def test_a_second_run_on_one_folder_is_refused_and_disturbs_nothing(recipe, undisturbed, tmp_path):
    out = tmp_path / "out"
    first = start(recipe, out)
    while not (out / "ledger" / "lock").exists():
        time.sleep(0.01)
    second = run(recipe, out)
    assert second.code == 1
    second.assert_sentence()
    assert "another run is at work in this folder" in second.stderr
    found = end(first)
    assert found.code == 0, found.stderr
    assert hashes(recipe, out) == undisturbed[1]
    assert_no_leftovers(out)


def test_two_runs_on_one_scheduler_each_fill_their_folder(recipe, undisturbed, tmp_path):
    with cluster(tmp_path, 0) as (_, file):
        started = [start(recipe, tmp_path / name, "--scheduler", str(file)) for name in ("a", "b")]
        ends = [end(process) for process in started]
    for name, found in zip(("a", "b"), ends, strict=True):
        assert found.code == 0, found.stderr
        assert hashes(recipe, tmp_path / name) == undisturbed[1]
