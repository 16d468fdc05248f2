"""Measure which share of the workers' time is not spent in tasks while there is work for all of them.

Command: ``PYTHONPATH=. python tests/scale/measure_overhead.py [--shards 16] [--workers 2] [--rows 8192]``

Shards of the default size are generated on a cluster of this machine. Each task's own time is that of its receipt; the
time of the workers is counted from the first start to the last start of a task, when every worker should be busy.
"""

from __future__ import annotations

import io
import json
import tempfile
from pathlib import Path

import cyclopts
from rich.console import Console

from jobs.plan.plan import plan
from jobs.recipe.load import load_recipe
from jobs.recipe.recipe import DatasetOptions
from jobs.run.executor import execute
from jobs.run.ledger import Ledger
from tests.scale.measure_driver import write_many

SHARD_ROWS = DatasetOptions.model_fields["shard_rows"].default


def main(shards: int = 16, workers: int = 2, rows: int = SHARD_ROWS) -> None:
    """Generate the shards and print the share."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        recipe = write_many(folder, shards, rows)
        tasks = [task for task in plan(load_recipe(recipe)) if task.stage == "generate" and " train " in task.title]
        log = io.StringIO()
        ledger = Ledger(folder)
        execute(tasks, ledger, workers=workers, console=Console(file=log), progress="json")
        seconds = {task.id: ledger.seconds(task) for task in tasks}
    events = [json.loads(line) for line in log.getvalue().splitlines()]
    ends = {event["task"]: event["time"] for event in events if event["event"] == "end"}
    starts = {id: ends[id] - seconds[id] for id in seconds}
    first, last = min(starts.values()), max(starts.values())
    busy = sum(min(ends[id], last) - starts[id] for id in seconds)
    share = 1 - busy / (workers * (last - first))
    mean = sum(seconds.values()) / len(seconds)
    print(f"{len(tasks)} shards of {rows:,} rows, {mean:.1f} s each, {workers} workers: {share:.2%}")


if __name__ == "__main__":
    cyclopts.run(main)
