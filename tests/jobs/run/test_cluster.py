"""Clusters: who may speak to the one on this machine, and schedulers that do not answer or write elsewhere."""

import io
import os
import re
import socket
import subprocess
import sys
import threading
import urllib.request
from http.server import HTTPServer, SimpleHTTPRequestHandler
from itertools import product
from types import SimpleNamespace
from unittest.mock import Mock

import distributed
import psutil
import pytest
from distributed import LocalCluster
from rich.console import Console

from jobs.run import executor
from jobs.run.cluster import HERE, Scheduler, connected
from jobs.run.crew import Crew
from jobs.run.ledger import Ledger
from tests.jobs import fake_stages as fake
from tests.jobs.dask_processes import ENVIRONMENT, DaskProcesses
from tests.refusals import refusal
from weaves.errors import WorkFailed

pytestmark = pytest.mark.external  # clusters of dask

SHARDS = [fake.task(f"shard {index}", breaks=True) for index in range(3)]


@pytest.fixture
def processes(tmp_path):
    with DaskProcesses(tmp_path) as started:
        yield started


@pytest.fixture
def shown():
    return Console(file=io.StringIO(), width=400)


def test_workers_of_somebody_elses_scheduler(tmp_path, processes, capfd):
    """What one wrote elsewhere is no product; the scheduler's end is told."""
    processes.add(ELSEWHERE="1")
    out, hidden = tmp_path / "out", fake.task("hidden", hides=True)
    out.mkdir()
    assert fake.run([hidden], out, scheduler=processes.given).failed == [hidden]
    assert "every worker must see --out" in Ledger(out).reason(hidden)
    tasks = [fake.task("first"), *(fake.task(f"long {index}", seconds=30) for index in range(2))]
    kill = fake.Heard(lambda task: processes.processes[0].kill())
    capfd.readouterr()
    with pytest.raises(WorkFailed, match="the dask scheduler is gone"):
        fake.run(tasks, out, scheduler=processes.given, manifests=[kill])
    assert Ledger(out).state(tasks[0]) == "done" and capfd.readouterr().err == ""


def test_a_task_that_fails_on_one_worker_is_tried_on_another(tmp_path, processes, monkeypatch):
    """Also when the broken worker is there first and takes everything."""
    processes.add(ELSEWHERE="1")

    def join(todo):
        processes.add()
        processes.wait_for(2)
        return ()

    monkeypatch.setattr(executor, "kernel_groups", join)
    summary = fake.run(SHARDS, tmp_path, scheduler=processes.given)
    assert len(summary.ran) == 3 and not summary.failed


OTHER_NUMBA = """
import jobs.run.crew as module
found = module.software() | {"numba": "0.1"}
module.software = lambda: found
"""
NO_PACKAGE = 'import sys; sys.modules["jobs"] = None'


def test_a_run_without_a_worker_of_this_version_ends_with_a_sentence(tmp_path, processes, shown):
    for preload in (OTHER_NUMBA, NO_PACKAGE):
        processes.add(preload=preload)
    processes.wait_for(2)
    refusal = r"worker tcp://127\.0\.0\.1:\d+ gets no task: it has "
    with pytest.raises(WorkFailed, match=rf"^every worker is refused; {refusal}"):
        fake.run(SHARDS, tmp_path, shown, scheduler=processes.given)
    for difference in (r"numba 0\.1 \(here \d+\.\d+\.\d+\)", "no twillight of this version"):
        assert len(re.findall(refusal + difference, shown.file.getvalue())) == 1
    assert not (tmp_path / "log.jsonl").exists()


@pytest.mark.slow
def test_a_worker_of_another_version_that_joins_later_gets_no_task(tmp_path, processes, shown):
    processes.add()
    tasks = [fake.task(f"shard {index}", seconds=0.3) for index in range(8)]

    def join(task):
        if len(before) == 2:  # the manifests were saved, and one task is done
            processes.add(preload=OTHER_NUMBA)
            processes.wait_for(2)

    before = fake.Heard(join)
    summary = fake.run(tasks, tmp_path, shown, scheduler=processes.given, manifests=[before])
    assert len(summary.ran) == 8 and len({event["pid"] for event in fake.events(tmp_path)}) == 1
    assert shown.file.getvalue().count("gets no task: it has numba 0.1") == 1


def test_a_port_that_listens_and_never_answers_is_bad_input(tmp_path):
    with socket.create_server(("127.0.0.1", 0)) as server:
        address = f"tcp://127.0.0.1:{server.getsockname()[1]}"
        assert "no dask scheduler answers" in refusal(fake.run, SHARDS, tmp_path, scheduler=Scheduler(address))


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


def listening():
    """Return the ports at which this process and those it started wait for others."""
    driver = psutil.Process()
    connections = [one for process in (driver, *driver.children(True)) for one in process.net_connections()]
    return {one.laddr.port for one in connections if one.status == "LISTEN"}


def test_the_cluster_on_this_machine_answers_no_stranger_and_ends(monkeypatch):
    """Neither without a certificate nor with one of its own, over TLS or not; no web page; no worker is left.

    A worker that compiles on a busy machine may not end in time.
    """
    before, left = listening(), []

    def close(cluster, timeout=None):
        left.append(cluster)
        raise TimeoutError

    with monkeypatch.context() as patched, connected(HERE, 1, str) as client:
        addresses = [client.scheduler.address, *client.scheduler_info()["workers"]]
        addresses += [worker["nanny"] for worker in client.scheduler_info()["workers"].values()]
        assert len(addresses) == 3 and all(address.startswith("tls://127.0.0.1:") for address in addresses)
        command = [sys.executable, "-c", STRANGER, *addresses]
        done = subprocess.run(command, capture_output=True, text=True, env=ENVIRONMENT, check=False)
        assert done.stdout.split() == ["refused"] * 12, done.stderr
        ports = listening() - before
        assert len(ports) >= 4
        for port, page in product(ports, ("", "health", "info/main/workers.html", "json/counts.json", "metrics")):
            with pytest.raises(OSError):  # HTTPError is one
                urllib.request.urlopen(f"http://127.0.0.1:{port}/{page}", timeout=60)
        # And the run's own client still works.
        worker = psutil.Process(client.submit(os.getpid).result())
        patched.setattr(LocalCluster, "close", close)
    assert worker.pid != os.getpid()
    psutil.wait_procs([worker], timeout=300)
    assert not worker.is_running()
    left[0].close()


@pytest.mark.parametrize(("path", "there"), [("", True), ("status", False)])
def test_a_dashboard_is_an_address_with_a_page(path, there):
    """A scheduler without one names its address too."""
    with HTTPServer(("127.0.0.1", 0), SimpleHTTPRequestHandler) as server:
        threading.Thread(target=server.handle_request, daemon=True).start()
        address = f"http://127.0.0.1:{server.server_port}/{path}"
        client = SimpleNamespace(dashboard_link=address, subscribe_topic=lambda *given: None, nthreads=dict)
        crew = Crew(client, True, print)
        assert crew.dashboard == (address if there else None)
    assert crew.dashboard is None  # nobody answers


def test_workers_that_cannot_start_are_no_bug(monkeypatch, tmp_path):
    monkeypatch.setattr(distributed, "LocalCluster", Mock(side_effect=RuntimeError("Nanny failed to start.\nmore")))
    with pytest.raises(WorkFailed, match=r"could not start: Nanny failed to start\.$"):
        fake.run(SHARDS, tmp_path)
