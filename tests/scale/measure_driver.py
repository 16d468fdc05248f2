"""Measure the driver: its time for each task and its memory, at 10^3, 10^4 and 10^5 tasks.

Command: ``PYTHONPATH=. python tests/scale/measure_driver.py [--tasks 1000 --tasks 10000 --tasks 100000]``

A recipe with so many shards is planned. Tasks with the same fields, which only write a short file, are then finished
on a scheduler with two workers of eight threads, all in processes of their own; then everything is resumed. Each
number of tasks has a fresh process. Printed: milliseconds a task, of the clock and (in brackets) of the driver's
processor time, and its peak memory. The workers share the processors with the driver, so that a run's time by the clock
is mostly theirs.
"""

import io
import json
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import ClassVar

import cyclopts
from rich.console import Console

from jobs.plan.dataset import DataSet, Shard
from jobs.plan.plan import plan
from jobs.plan.task import Progress
from jobs.recipe.load import load_recipe
from jobs.run.executor import execute
from jobs.run.ledger import Ledger
from jobs.run.manifest_file import ManifestFile
from tests.jobs.dask_processes import DaskProcesses

RECIPE = """
name = "many"
[dataset]
seen = ["denim"]
shard_rows = {rows}
rows = {{ train = {train}, validation = 64, test = 64 }}
[[models]]
model = "woven"
"""


def write_many(folder: Path, shards: int, rows: int = 64) -> Path:
    """Write a recipe of so many shards of training rows, and two others; return its path."""
    (folder / "many.toml").write_text(RECIPE.format(rows=rows, train=shards * rows))
    return folder / "many.toml"


class ShortShard(Shard):
    """A shard that writes a short file in place of its rows."""

    group: ClassVar = "short"

    def run(self, out: Path, progress: Progress) -> None:
        for path in self.products:
            (out / path).parent.mkdir(parents=True, exist_ok=True)
            (out / path).write_text(self.id)


def timed(count: int, function: Callable[[], object]) -> dict[str, float]:
    """Return milliseconds a task, and the peak memory of this process so far in MiB."""
    wall, cpu = time.perf_counter(), time.process_time()
    function()
    wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    return {"wall": 1000 * wall / count, "cpu": 1000 * cpu / count, "memory": memory}


def measure(count: int) -> dict[str, dict[str, float]]:
    """Measure a number of tasks in this process."""
    # Other processes would not find the class of `__main__`.
    from tests.scale import measure_driver as importable

    result = {}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "out").mkdir()
        recipe = load_recipe(write_many(folder, count - 2))
        parts: list[Shard] = []
        result["plan"] = timed(count, lambda: parts.extend(plan(recipe)))  # type: ignore[arg-type]
        tasks = [importable.ShortShard.model_construct(**dict(part)) for part in parts if isinstance(part, Shard)]
        parts.clear()

        def run() -> None:
            ledger = Ledger(folder / "out")
            manifest = ManifestFile(DataSet(recipe), ledger)
            manifest.save()
            quiet = Console(file=io.StringIO())
            summary = execute(tasks, ledger, scheduler=connection, workers=2, manifests=[manifest], console=quiet)
            assert len(summary.ran) + len(summary.before) == count, summary

        with DaskProcesses(folder) as dask:
            for _ in range(2):
                dask.add("--nthreads", "8")
            connection = dask.given
            result["run"] = timed(count, run)
        result["resume"] = timed(count, run)
    return result


def main(tasks: tuple[int, ...] = (10**3, 10**4, 10**5), one: bool = False) -> None:
    """Measure each number of tasks and print a table; `one` as JSON."""
    if one:
        print(json.dumps(measure(tasks[0])))
        return
    print("| tasks | plan | run | resume | peak memory |\n|---|---|---|---|---|")
    for count in tasks:
        command = [sys.executable, __file__, "--one", "--tasks", str(count)]
        found = json.loads(subprocess.run(command, stdout=subprocess.PIPE, check=True, text=True).stdout)
        cells = [f"{found[name]['wall']:.2f} ({found[name]['cpu']:.2f})" for name in ("plan", "run", "resume")]
        print(f"| {count:,} | {' | '.join(cells)} | {found['resume']['memory']:.0f} MiB |", flush=True)


if __name__ == "__main__":
    cyclopts.run(main)
