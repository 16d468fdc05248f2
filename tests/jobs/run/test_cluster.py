"""Clusters: who may speak to the one on this machine, and schedulers that do not answer or write elsewhere."""

import io
import os
import socket
import subprocess
import sys
import threading
import time
import urllib.request
from http.server import BaseHTTPRequestHandler, HTTPServer
from itertools import product
from pathlib import Path
from types import SimpleNamespace

import psutil
import pytest
from distributed import Client, LocalCluster
from rich.console import Console

from jobs.run.cluster import HERE, Scheduler, connected, dashboard_of
from jobs.run.executor import execute
from jobs.run.ledger import Ledger
from weaves.errors import BadInput, WorkFailed

pytestmark = pytest.mark.external  # clusters of dask

TESTS = Path(__file__).parents[1]
ENVIRONMENT = os.environ | {"PYTHONPATH": os.pathsep.join([str(TESTS), str(TESTS.parents[1])])}


@pytest.fixture
def fake(monkeypatch):
    monkeypatch.syspath_prepend(TESTS)
    import fake_stages

    return fake_stages


def quiet():
    return Console(file=io.StringIO())


class Processes:
    """A scheduler and its workers, each in a process of its own."""

    def __init__(self, folder):
        self.folder, self.file = folder, folder / "scheduler.json"
        self.common = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
        dask = [sys.executable, "-m", "distributed.cli.dask_scheduler", "--port", "0", "--host", "127.0.0.1"]
        command = [*dask, "--scheduler-file", str(self.file), "--no-dashboard"]
        self.processes = [subprocess.Popen(command, env=ENVIRONMENT, **self.common)]
        deadline = time.monotonic() + 300
        while not self.file.exists():
            assert time.monotonic() < deadline
            time.sleep(0.05)
        self.given = Scheduler(str(self.file))

    def add(self, preload="", **environment):
        """Start a worker that lives in another folder; `preload` is code that it runs first."""
        elsewhere = self.folder / f"worker-{len(self.processes)}"
        elsewhere.mkdir()
        worker = [sys.executable, "-m", "distributed.cli.dask_worker", "--scheduler-file", str(self.file)]
        command = [*worker, "--nthreads", "1", "--no-dashboard", "--no-nanny"]
        if preload:
            (elsewhere / "preload.py").write_text(preload)
            command += ["--preload", str(elsewhere / "preload.py")]
        self.processes.append(subprocess.Popen(command, cwd=elsewhere, env=ENVIRONMENT | environment, **self.common))

    def wait_for(self, count):
        """Wait until so many workers are there."""
        with Client(scheduler_file=str(self.file)) as client:
            client.wait_for_workers(count, timeout=300)

    def close(self):
        for process in self.processes:
            process.kill()
            process.wait()


@pytest.fixture
def processes(tmp_path):
    found = Processes(tmp_path)
    yield found
    found.close()


@pytest.fixture
def scheduler(processes):
    """A scheduler with one worker, which may see other files."""
    processes.add(ELSEWHERE="1")
    return processes.given, processes.processes[0]


def test_a_scheduler_that_dies_ends_the_run_with_a_sentence_and_no_traceback(tmp_path, fake, scheduler, capfd):
    address, process = scheduler
    tasks = [fake.task("first"), *(fake.task(f"long {index}", seconds=30) for index in range(2))]

    def kill(task, files):
        process.kill()

    with pytest.raises(WorkFailed, match="the dask scheduler is gone"):
        execute(tasks, Ledger(tmp_path), scheduler=address, console=quiet(), recorded=kill)
    assert Ledger(tmp_path).state(tasks[0]) == "done"
    assert capfd.readouterr().err == ""


def test_a_product_that_was_written_elsewhere_is_no_product(tmp_path, fake, scheduler):
    task = fake.task("hidden", hides=True)
    (tmp_path / "out").mkdir()
    summary = execute([task], Ledger(tmp_path / "out"), scheduler=scheduler[0], console=quiet())
    assert summary.failed == [task]
    assert "every worker must see --out" in Ledger(tmp_path / "out").reason(task)


OTHER_NUMBA = """
import jobs.run.software as module
found = module.software() | {"numba": "0.1"}
module.software = lambda: found
"""

NO_PACKAGE = """
import sys
sys.modules["jobs"] = None
"""


@pytest.mark.parametrize(
    ("preload", "difference"),
    [(OTHER_NUMBA, r"it has numba 0\.1 \(here \d+\.\d+\.\d+\)"), (NO_PACKAGE, r"it has no twillight of this version")],
)
def test_a_run_without_a_worker_of_this_version_ends_with_a_sentence(tmp_path, fake, processes, preload, difference):
    processes.add(preload)
    with pytest.raises(
        WorkFailed, match=rf"^every worker is refused; worker tcp://127\.0\.0\.1:\d+ gets no task: {difference}"
    ):
        execute([fake.task("one")], Ledger(tmp_path), scheduler=processes.given, console=quiet())
    assert not (tmp_path / "log.jsonl").exists()


@pytest.mark.slow
def test_a_worker_of_another_version_that_joins_later_gets_no_task(tmp_path, fake, processes):
    processes.add()
    tasks = [fake.task(f"shard {index}", seconds=0.3) for index in range(8)]
    before = []

    def join(task, files):
        if not before:
            processes.add(OTHER_NUMBA)
            processes.wait_for(2)
        before.append(task)

    console = quiet()
    summary = execute(tasks, Ledger(tmp_path), scheduler=processes.given, console=console, recorded=join)
    assert len(summary.ran) == 8
    assert len({event["pid"] for event in fake.events(tmp_path)}) == 1
    told = console.file.getvalue()
    assert told.count("gets no task: it has numba 0.1") == 1


def test_a_task_that_fails_on_one_worker_is_tried_on_another(tmp_path, fake, processes):
    """Also when the broken worker is there first and takes everything."""
    processes.add(ELSEWHERE="1")
    tasks = [fake.task(f"shard {index}", breaks=True) for index in range(3)]

    def prepare(todo):
        processes.add()
        processes.wait_for(2)
        return ()

    summary = execute(tasks, Ledger(tmp_path), scheduler=processes.given, console=quiet(), prepare=prepare)
    assert len(summary.ran) == 3 and not summary.failed


@pytest.mark.slow
def test_a_cluster_that_grows_and_shrinks_loses_no_task(tmp_path, fake, monkeypatch):
    monkeypatch.setenv("PYTHONPATH", ENVIRONMENT["PYTHONPATH"])
    shards = [fake.task(f"shard {index}", seconds=0.3) for index in range(18)]
    tasks = [*shards, fake.task("net", fake.FakeTraining, needs=shards)]
    seen = []
    with LocalCluster(
        n_workers=0, threads_per_worker=1, host="127.0.0.1", dashboard_address=":0", silence_logs=50
    ) as cluster:
        adaptive = cluster.adapt(minimum=0, maximum=3, interval="100ms", wait_count=2, target_duration="300ms")

        def count():
            return len(cluster.scheduler_info["workers"])

        def wait_for(condition):
            limit = time.monotonic() + 300.0
            while not condition() and time.monotonic() < limit:
                time.sleep(0.05)

        def change(task, files):
            if len(seen) == 2:
                wait_for(lambda: count() > 1)
            if len(seen) == 10:
                adaptive.maximum = 1
                wait_for(lambda: count() == 1)
            seen.append(count())

        given = Scheduler(cluster.scheduler_address)
        summary = execute(tasks, Ledger(tmp_path), scheduler=given, console=quiet(), recorded=change)
    assert len(summary.ran) == len(tasks) and not summary.failed and not summary.waiting
    assert all((tmp_path / task.products[0]).read_text() == f"{task.title}\n" * 100 for task in tasks)
    assert seen[2] > 1 and seen[10] == 1


def test_a_port_that_listens_and_never_answers_is_bad_input(fake, tmp_path):
    with socket.create_server(("127.0.0.1", 0)) as server:
        address = f"tcp://127.0.0.1:{server.getsockname()[1]}"
        with pytest.raises(BadInput, match="no dask scheduler answers"):
            execute(fake.chain(), Ledger(tmp_path), scheduler=Scheduler(address), console=quiet())


def test_files_of_certificates_must_be_there(fake, tmp_path):
    given = Scheduler("tls://127.0.0.1:1", key="nowhere.pem")
    with pytest.raises(BadInput, match=r"--tls-key: nowhere\.pem: is no file"):
        execute(fake.chain(), Ledger(tmp_path), scheduler=given, console=quiet())


@pytest.mark.parametrize("workers", [-3, 1025, 10**6])
def test_an_impossible_number_of_workers_is_bad_input(fake, tmp_path, workers):
    with pytest.raises(BadInput, match="--workers"):
        execute(fake.chain(), Ledger(tmp_path), workers=workers, console=quiet())


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


def test_a_cluster_that_does_not_end_in_time_is_killed(monkeypatch):
    """As on a busy machine, where a worker compiles while it is to end."""
    from distributed import LocalCluster

    left = []

    def close(cluster, timeout=None):
        left.append(cluster)
        raise TimeoutError

    with monkeypatch.context() as patched, connected(HERE, 1, str) as client:
        worker = psutil.Process(client.submit(os.getpid).result())
        patched.setattr(LocalCluster, "close", close)
    psutil.wait_procs([worker], timeout=300)
    assert not worker.is_running()
    left[0].close()


def listening():
    """Return the ports at which this process and those it started wait for others."""
    driver = psutil.Process()
    connections = [one for process in (driver, *driver.children(True)) for one in process.net_connections()]
    return {one.laddr.port for one in connections if one.status == "LISTEN"}


def test_the_ports_of_the_cluster_on_this_machine_have_no_web_pages():
    before = listening()
    with connected(HERE, 1, str):
        ports = listening() - before
        assert len(ports) >= 4
        for port, page in product(ports, ("", "health", "info/main/workers.html", "json/counts.json", "metrics")):
            with pytest.raises(OSError):  # HTTPError is one
                urllib.request.urlopen(f"http://127.0.0.1:{port}/{page}", timeout=60)


@pytest.mark.parametrize(("found", "expected"), [(200, True), (404, False)])
def test_a_dashboard_is_an_address_with_a_page(found, expected):
    """A scheduler without one names its address too."""

    class Page(BaseHTTPRequestHandler):
        def do_GET(self):
            self.send_response(found)
            self.end_headers()

        def log_message(self, *parts):
            pass

    with HTTPServer(("127.0.0.1", 0), Page) as server:
        threading.Thread(target=server.handle_request, daemon=True).start()
        client = SimpleNamespace(dashboard_link=f"http://127.0.0.1:{server.server_port}/status")
        assert dashboard_of(client) == (client.dashboard_link if expected else None)
    assert dashboard_of(client) is None  # nobody answers


def test_workers_that_cannot_start_are_no_bug(monkeypatch, fake, tmp_path):
    import distributed

    def broken(**options):
        raise RuntimeError("Nanny failed to start.\nmore")

    monkeypatch.setattr(distributed, "LocalCluster", broken)
    with pytest.raises(WorkFailed, match=r"could not start: Nanny failed to start\.$"):
        execute(fake.chain(), Ledger(tmp_path), console=quiet())
