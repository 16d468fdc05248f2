"""A dask scheduler and its workers, each in a process of its own, as users start them."""

import os
import subprocess
import sys
import time
from pathlib import Path

import psutil
from distributed import Client

from jobs.run.cluster import Scheduler

ENVIRONMENT = os.environ | {"PYTHONPATH": str(Path(__file__).parents[2])}


class DaskProcesses:
    """A scheduler with a file in a folder, and the workers that are added; a context manager that ends them all."""

    def __init__(self, folder):
        self.folder, self.file = folder, folder / "scheduler.json"
        self.processes = []
        self._start("dask_scheduler", "--port", "0", "--host", "127.0.0.1")
        deadline = time.monotonic() + 300
        while not self.file.exists():
            assert time.monotonic() < deadline
            time.sleep(0.05)
        self.given = Scheduler(str(self.file))

    def __enter__(self):
        return self

    def __exit__(self, *error):
        for process in reversed(self.processes):
            for child in family(process):
                child.kill()
            process.kill()
            process.wait()

    def add(self, *options, preload="", **environment):
        """Start a worker that lives in another folder; `preload` is code that it runs first."""
        elsewhere = self.folder / f"worker-{len(self.processes)}"
        elsewhere.mkdir()
        if preload:
            (elsewhere / "preload.py").write_text(preload)
            options = (*options, "--preload", str(elsewhere / "preload.py"))
        self._start("dask_worker", "--nthreads", "1", "--no-nanny", *options, cwd=elsewhere, **environment)

    def wait_for(self, count):
        with Client(scheduler_file=str(self.file)) as client:
            client.wait_for_workers(count, timeout=300)

    def _start(self, program, *options, cwd=None, **environment):
        command = [sys.executable, "-m", f"distributed.cli.{program}", *options, "--no-dashboard"]
        quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "start_new_session": True}
        command += ["--scheduler-file", str(self.file)]
        self.processes.append(subprocess.Popen(command, cwd=cwd, env=ENVIRONMENT | environment, **quiet))


def family(process):
    try:
        return psutil.Process(process.pid).children(recursive=True)
    except psutil.NoSuchProcess:
        return []
