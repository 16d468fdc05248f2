"""Clusters: who may speak to the one on this machine, and schedulers that do not answer or write elsewhere."""

import io
import os
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest
from rich.console import Console

from jobs.run.cluster import HERE, Scheduler, connected
from jobs.run.executor import execute
from jobs.run.ledger import Ledger
from weaves.errors import BadInput, WorkFailed

TESTS = Path(__file__).parents[1]
ENVIRONMENT = os.environ | {"PYTHONPATH": os.pathsep.join([str(TESTS), str(TESTS.parents[1])])}


@pytest.fixture
def fake(monkeypatch):
    monkeypatch.syspath_prepend(TESTS)
    import fake_stages

    return fake_stages


def quiet():
    return Console(file=io.StringIO())


@pytest.fixture
def scheduler(tmp_path):
    """A scheduler in a process of its own with one worker, which lives in another folder."""
    file, elsewhere = tmp_path / "scheduler.json", tmp_path / "elsewhere"
    elsewhere.mkdir()
    common = {"env": ENVIRONMENT, "stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    dask = [sys.executable, "-m", "distributed.cli.dask_scheduler", "--port", "0", "--host", "127.0.0.1"]
    processes = [subprocess.Popen([*dask, "--scheduler-file", str(file), "--no-dashboard"], **common)]
    deadline = time.monotonic() + 60
    while not file.exists():
        assert time.monotonic() < deadline
        time.sleep(0.05)
    worker = [sys.executable, "-m", "distributed.cli.dask_worker", "--scheduler-file", str(file), "--nthreads", "1"]
    common["env"] = ENVIRONMENT | {"ELSEWHERE": "1"}
    processes.append(subprocess.Popen([*worker, "--no-dashboard", "--no-nanny"], cwd=elsewhere, **common))
    yield Scheduler(str(file)), processes[0]
    for process in processes:
        process.kill()
        process.wait()


def test_a_scheduler_that_dies_ends_the_run_with_a_sentence_and_no_traceback(tmp_path, fake, scheduler, capfd):
    address, process = scheduler
    tasks = [fake.task("first"), *(fake.task(f"long {index}", seconds=30) for index in range(2))]

    def kill(task, files):
        process.kill()

    with pytest.raises(WorkFailed, match="the dask scheduler is gone"):
        execute(tasks, tmp_path, scheduler=address, console=quiet(), recorded=kill)
    assert Ledger(tmp_path).state(tasks[0]) == "done"
    assert capfd.readouterr().err == ""


def test_two_runs_with_two_folders_on_one_scheduler_both_get_their_files(tmp_path, fake, scheduler):
    tasks = [fake.task(f"shard {index}", seconds=0.1) for index in range(4)]
    outs = [tmp_path / name for name in "ab"]
    summaries = {}

    def run(out):
        summaries[out] = execute(tasks, out, scheduler=scheduler[0], console=quiet())

    for out in outs:
        (out / "ledger").mkdir(parents=True)
    threads = [threading.Thread(target=run, args=(out,)) for out in outs]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    for out in outs:
        assert len(summaries[out].ran) == 4
        assert all((out / task.products[0]).exists() and Ledger(out).state(task) == "done" for task in tasks)


def test_a_product_that_was_written_elsewhere_is_no_product(tmp_path, fake, scheduler):
    task = fake.task("hidden", hides=True)
    (tmp_path / "out").mkdir()
    summary = execute([task], tmp_path / "out", scheduler=scheduler[0], console=quiet())
    assert summary.failed == [task]
    assert "every worker must see --out" in Ledger(tmp_path / "out").reason(task)


def test_a_port_that_listens_and_never_answers_is_bad_input(fake, tmp_path):
    with socket.create_server(("127.0.0.1", 0)) as server:
        address = f"tcp://127.0.0.1:{server.getsockname()[1]}"
        with pytest.raises(BadInput, match="no dask scheduler answers"):
            execute(fake.chain(), tmp_path, scheduler=Scheduler(address), console=quiet())


def test_files_of_certificates_must_be_there(fake, tmp_path):
    with pytest.raises(BadInput, match=r"--tls-key: nowhere\.pem: is no file"):
        execute(fake.chain(), tmp_path, scheduler=Scheduler("tls://127.0.0.1:1", key="nowhere.pem"), console=quiet())


@pytest.mark.parametrize("workers", [-3, 1025, 10**6])
def test_an_impossible_number_of_workers_is_bad_input(fake, tmp_path, workers):
    with pytest.raises(BadInput, match="--workers"):
        execute(fake.chain(), tmp_path, workers=workers, console=quiet())


STRANGER = """
import asyncio, sys
from distributed import Client, Security
from distributed.comm.core import connect

async def speak(address, security):
    arguments = security.get_connection_args("client") if security else {}
    comm = await asyncio.wait_for(connect(address, timeout=3, **arguments), 3)
    await comm.write({"op": "identity", "reply": True})
    return await asyncio.wait_for(comm.read(), 3)

for address in sys.argv[1:]:
    for security in (None, Security.temporary()):
        for given in (address, address.replace("tls", "tcp")):
            try:
                print("answered", asyncio.run(speak(given, security)))
            except Exception as error:
                print("refused")
"""


def test_a_stranger_gets_no_answer_from_the_cluster_on_this_machine():
    """Neither without a certificate nor with one of its own, over TLS or not."""
    with connected(HERE, 1, str) as client:
        addresses = [client.scheduler.address, *client.scheduler_info()["workers"]]
        addresses += [worker["nanny"] for worker in client.scheduler_info()["workers"].values()]
        assert len(addresses) == 3 and all(address.startswith("tls://127.0.0.1:") for address in addresses)
        command = [sys.executable, "-c", STRANGER, *addresses]
        done = subprocess.run(command, capture_output=True, text=True, env=ENVIRONMENT, check=False)
        assert done.stdout.split() == ["refused"] * 12, done.stderr
        # And the run's own client still works.
        assert client.submit(os.getpid).result() != os.getpid()


def test_workers_that_cannot_start_are_no_bug(monkeypatch, fake, tmp_path):
    import distributed

    def broken(**options):
        raise RuntimeError("Nanny failed to start.\nmore")

    monkeypatch.setattr(distributed, "LocalCluster", broken)
    with pytest.raises(WorkFailed, match=r"could not start: Nanny failed to start\.$"):
        execute(fake.chain(), tmp_path, console=quiet())
