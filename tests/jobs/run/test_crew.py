import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

from jobs.run.crew import Crew, Serial, software
from jobs.run.ledger import Ledger
from tests.jobs import fake_stages as fake
from tests.jobs.dask_processes import ENVIRONMENT
from weaves.errors import WorkFailed

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


def crew(there):
    """Return the crew of a scheduler whose one worker answers a query of its software so."""
    client = SimpleNamespace(
        subscribe_topic=lambda *given: None,
        nthreads=lambda: {"tcp://a": 1},
        run=lambda function, workers, on_error: dict.fromkeys(workers, there),
    )
    return Crew(client, True, lambda message: None)


def test_a_worker_of_equal_software_is_accepted_and_each_difference_is_named_with_both_versions():
    assert crew(dict(software())).accepted == ["tcp://a"]
    assert "+" not in "".join(software().values())  # builds for other devices are one version
    missing, words = rf"(missing.*){{{len(software())}}}", r"tcp://a gets no task: it has {} 0\.1 \(here {}\); install"
    different = [(software() | {name: "0.1"}, words.format(name, version)) for name, version in software().items()]
    gone = (ModuleNotFoundError("jobs"), r"it has no twillight of this version \(ModuleNotFoundError\)")
    for there, sentence in (*different, ({}, missing), gone):
        with pytest.raises(WorkFailed, match=sentence):
            crew(there)


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
