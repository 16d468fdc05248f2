"""A small recipe of every stage, run by the command line as a user runs it, and the bytes that it leaves."""

import hashlib
import os
import signal
import subprocess
import sys
import tempfile
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import NamedTuple

import psutil

from jobs.plan.plan import plan
from jobs.recipe.load import load_recipe
from tests.jobs.dask_processes import DaskProcesses, family
from tests.jobs.small_recipes import write_smallest

ROOT = Path(__file__).parents[2]
START = "import sys; from jobs.entry import main; sys.exit(main())"
TIMEOUT = 900.0  # the first run compiles


class End(NamedTuple):
    code: int
    stderr: str

    @property
    def sentence(self):
        """The sentence of at most 300 letters that ends stderr, in which no traceback is."""
        assert "Traceback" not in self.stderr, self.stderr
        last = self.stderr.strip().splitlines()[-1]
        assert 0 < len(last) <= 300, last
        return last


def write_recipe(folder):
    dataset = {"seed": 5, "rows": {"train": 2048}, "truth": {"max_count": 512}}
    training = {"steps": 60, "checkpoint_every": 10}
    return write_smallest(folder, "faults", dataset, {"texels_per_yarn": 4, "training": training})


def start(recipe, out, *arguments, verb="run", before=(), env=None):
    """Start the command line in a session of its own; Ctrl-C reaches it although pytest may ignore it."""
    command = [*before, sys.executable, "-c", START, verb, str(recipe), "--out", str(out), *arguments]
    options = {"cwd": ROOT, "env": os.environ | {"COLUMNS": "400", "OMP_NUM_THREADS": "1"} | (env or {})}
    options |= {"stdout": subprocess.DEVNULL, "stderr": subprocess.PIPE, "text": True, "start_new_session": True}
    interrupted = partial(signal.signal, signal.SIGINT, signal.default_int_handler)
    return subprocess.Popen(command, preexec_fn=interrupted, **options)


def end(process, timeout=TIMEOUT):
    """Wait for the end of a run; one that takes longer is killed with all that it has started, and fails its test."""
    try:
        _, stderr = process.communicate(timeout=timeout)
    except subprocess.TimeoutExpired:
        for one in (*family(process), process):
            one.kill()
        process.communicate()
        raise
    return End(process.returncode, stderr)


def run(recipe, out, *arguments, code=0, **others):
    """Run the command line to its end; fail if its exit code is another."""
    ended = end(start(recipe, out, *arguments, **others))
    assert ended.code == code, ended.stderr
    return ended


def finish(recipe, out, undisturbed, *arguments):
    """Run the recipe to its end: it has the bytes of an undisturbed run, and nothing half-written is left."""
    run(recipe, out, *arguments)
    assert hashes(recipe, out) == undisturbed[1] and not leftovers(out)


def hashes(recipe, out):
    """Return the hash of every product without times or a machine in it, and of the manifest."""
    tasks = [task for task in plan(load_recipe(recipe)) if task.slots == "one" and task.stage != "report"]
    products = [out / path for task in tasks for path in task.products if not path.endswith(".machine.json")]
    files = products + sorted(out.glob("datasets/*/manifest.json"))
    return {str(path.relative_to(out)): hashlib.sha256(path.read_bytes()).hexdigest() for path in files}


def leftovers(out):
    """Return what a run has left half-written: nothing, if it has ended well."""
    return list(out.rglob(".tmp-*"))


def gone(processes, seconds=20.0):
    """Wait until processes have ended; return those that have not."""
    return psutil.wait_procs(processes, timeout=seconds)[1]


@contextmanager
def cluster(folder, number):
    """A scheduler and two workers of their own, in a new folder; yields the scheduler's process and its file."""
    own = Path(tempfile.mkdtemp(prefix=f"scheduler-{number}-", dir=folder))
    with DaskProcesses(own) as dask:
        for _ in range(2):
            dask.add("--nanny")
        yield dask.processes[0], dask.file
