"""The snippets of jobs/CLUSTER.md, with a local cluster or local processes in place of each service."""

import json
import os
import re
import stat
import subprocess
import sys
import types
from pathlib import Path

import pytest
import yaml
from distributed import LocalCluster
from rich.console import Console

from jobs.cli import app
from jobs.run.cluster import Scheduler
from tests.jobs import fake_stages as fake
from tests.jobs.dask_processes import ENVIRONMENT

TEXT = (Path(__file__).parents[2] / "jobs" / "CLUSTER.md").read_text(encoding="utf-8")


def run(command, out):
    """Check a command line, and run six tasks on its scheduler."""
    assert Path(command[0]).name == "twillight"
    app.parse_args(command[1:], exit_on_error=False, print_error=False)
    tasks = [fake.task(f"shard {index}", seconds=0.1) for index in range(6)]
    given = Scheduler(command[command.index("--scheduler") + 1])
    return fake.run(tasks, out, Console(stderr=True), scheduler=given)


class Service:
    """A local cluster with the arguments and methods that the snippets use."""

    def __init__(self, **options):
        self.options = options
        count = options.get("n_workers", 0)
        quiet = {"dashboard_address": ":0", "silence_logs": 50}
        self._cluster = LocalCluster(n_workers=min(count, 2), threads_per_worker=1, host="127.0.0.1", **quiet)
        self.scheduler_address = self._cluster.scheduler_address
        self.close = self._cluster.close

    def adapt(self, minimum, maximum):
        self._cluster.adapt(minimum=minimum, maximum=min(maximum, 2), interval="100ms")


def cluster_spec(name, image, env, worker_command):
    """Return the parts of `dask_kubernetes.operator.make_cluster_spec` that the snippet changes."""
    return {"spec": {"worker": {"spec": {"containers": [{"image": image, "env": env, "args": worker_command}]}}}}


SERVICES = {
    "dask_jobqueue": {"SLURMCluster": Service},
    "dask_kubernetes": {},
    "dask_kubernetes.operator": {"KubeCluster": Service, "make_cluster_spec": cluster_spec},
    "dask_cloudprovider": {},
    "dask_cloudprovider.aws": {"FargateCluster": Service},
}
"""Modules that are not installed, and what the snippets import from them."""


@pytest.mark.external
@pytest.mark.slow
@pytest.mark.parametrize("code", re.findall(r"^```python\n(.*?)^```$", TEXT, re.M | re.S), ids=["slurm", "k8s", "aws"])
def test_a_snippet_runs_tasks_on_the_cluster_that_it_makes(tmp_path, monkeypatch, code):
    for name, members in SERVICES.items():
        monkeypatch.setitem(sys.modules, name, types.SimpleNamespace(**members))
    monkeypatch.setenv("PYTHONPATH", ENVIRONMENT["PYTHONPATH"])
    summaries = []
    started = types.SimpleNamespace(run=lambda command, check: summaries.append(run(command, tmp_path)))
    exec(code.replace("import subprocess\n", ""), {"subprocess": started})
    (summary,) = summaries
    assert len(summary.ran) == 6 and not summary.failed


def command_of(index):
    blocks = re.findall(r"^```(sh|json|yaml)\n(.*?)^```$", TEXT, re.M | re.S)
    ((language, block),) = [found for found in blocks if index in found[1]]
    if language == "sh":
        return block
    content = json.loads(block) if language == "json" else yaml.safe_load(block)
    if language == "json":
        shell, flag, line = content["containerOverrides"]["command"]
        count = content["arrayProperties"]["size"]
    else:
        shell, flag, line = content["spec"]["template"]["spec"]["containers"][0]["command"]
        count = content["spec"]["completions"]
    assert (shell, flag, count) == ("sh", "-c", 1000)
    return line


ARRAYS = {"SLURM_ARRAY_TASK_ID": 1, "AWS_BATCH_JOB_ARRAY_INDEX": 0, "JOB_COMPLETION_INDEX": 0}
"""Variables with the number of a job in its array, and the first number."""


@pytest.mark.parametrize(("index", "first"), ARRAYS.items())
def test_a_job_of_an_array_does_its_thousandth(tmp_path, index, first):
    """Parts at the same time, one of them twice, are an undivided run: tests/faults/test_kills.py."""
    line = command_of(index)
    assert index != "SLURM_ARRAY_TASK_ID" or "--array=1-1000 " in line
    (tmp_path / "twillight").write_text('#!/bin/sh\necho "$@"\n')
    (tmp_path / "twillight").chmod(stat.S_IRWXU)
    environment = {"PATH": f"{tmp_path}{os.pathsep}{os.environ['PATH']}"}
    for number in (1, 17, 1000):
        job = environment | {index: str(first + number - 1)}
        called = subprocess.run(["sh", "-c", line], env=job, capture_output=True, text=True, check=True).stdout.split()
        app.parse_args(called, exit_on_error=False, print_error=False)
        assert called[:2] == ["generate", "full"] and called[-2:] == ["--part", f"{number}/1000"]


SRUN = """#!/bin/sh
"$@" &
"$@" &
wait
"""

TWILLIGHT = f"""#!{sys.executable}
import sys
from pathlib import Path
from tests.jobs.test_cluster_document import run
run(sys.argv, Path.cwd())
"""

DASK = f"""#!{sys.executable}
from dask.__main__ import main
if __name__ == "__main__":  # workers are started from it
    main()
"""


@pytest.mark.external
@pytest.mark.slow
def test_the_job_of_slurm_runs_tasks(tmp_path):
    (script,) = re.findall(r"^```sh\n(#!/bin/bash\n[^`]*?dask worker.*?)^```$", TEXT, re.M | re.S)
    folder = tmp_path / "bin"
    folder.mkdir()
    for name, content in (("srun", SRUN), ("twillight", TWILLIGHT), ("dask", DASK), ("job", script)):
        (folder / name).write_text(content)
        (folder / name).chmod(stat.S_IRWXU)
    environment = ENVIRONMENT | {"PATH": f"{folder}{os.pathsep}{os.environ['PATH']}"}
    command = ["setsid", "--wait", str(folder / "job")]
    options = {"capture_output": True, "text": True, "timeout": 120, "check": False}
    done = subprocess.run(command, cwd=tmp_path, env=environment, **options)
    assert "6 of 6 tasks" in done.stderr, done.stderr
    assert len(list((tmp_path / "generate").glob("*.txt"))) == 6
