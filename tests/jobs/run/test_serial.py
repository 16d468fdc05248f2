"""Processes that share a folder and do one task after the other; tests/jobs/verbs/test_run.py has parts of a recipe."""

import subprocess
import sys
from pathlib import Path

import pytest

from jobs.run.ledger import Ledger
from jobs.run.serial import Serial
from tests.jobs import fake_stages as fake
from tests.jobs.dask_processes import ENVIRONMENT

OTHER = """
import sys
from pathlib import Path
from jobs.run.store import Store
from tests.jobs import fake_stages as fake

out = Path(sys.argv[1])
task = fake.task("x")
with Store.of(out).claimed(task.id):
    print("claimed", flush=True)
    if sys.stdin.readline() == "done":
        fake.done(out, task)
"""


@pytest.mark.parametrize("end", ["done", "given up"])
def test_a_task_that_another_process_is_at_is_waited_for_and_done_once(tmp_path, end):
    task, ledger = fake.task("x"), Ledger(tmp_path)
    crew = Serial(ledger, lambda message: None)
    command = [sys.executable, "-c", OTHER, str(tmp_path)]
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True, "env": ENVIRONMENT}
    with subprocess.Popen(command, **pipes) as other:
        assert other.stdout.readline() == "claimed\n"
        with ledger.store.claimed(fake.task("y").id):  # of another task: at once
            pass
        later = subprocess.Popen(["sh", "-c", f"sleep 0.3; printf '{end}'"], stdout=other.stdin)
        other.stdin.close()
        crew.start(task, str(tmp_path), {})
        ((ended, outcome),) = crew.ended(0.0)
        later.wait()
    pids = [event["pid"] for event in fake.events(tmp_path) if event["event"] == "start"]
    assert ended == task and not outcome.reason and (pids == [other.pid]) == (end == "done") and len(pids) == 1
    assert outcome.files.keys() == {Path(task.products[0]).name}
