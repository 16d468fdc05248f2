"""Measure the requests to object storage, and the time, that finished tasks cost a plan, a status and a resumed run.

Command: ``PYTHONPATH=. python tests/scale/measure_requests.py [--tasks 1000]``

An S3 server of the tests (moto, in a thread of this process) holds receipts and short products of a recipe's shards.
Printed: requests, and seconds of the clock and (in brackets) of processor time, the server's included. A workspace is
kept from line to line: the first look at the receipts fetches them.
"""

from __future__ import annotations

import io
import os
import tempfile
from collections.abc import Callable
from pathlib import Path

import cyclopts
from rich.console import Console

from jobs.plan.dataset import Shard
from jobs.plan.plan import plan
from jobs.recipe.load import load_recipe
from jobs.run.executor import execute
from jobs.run.ledger import Ledger
from jobs.run.receipt import Product
from jobs.verbs.plan import facts_of
from pipeline.storage import place
from tests.jobs.s3_server import serving
from tests.scale.measure_driver import timed, write_many


def fill(tasks: list[Shard], folder: Path, address: str) -> None:
    import s3fs

    ledger = Ledger(folder)
    for task in tasks:
        for path in task.products:
            (folder / path).parent.mkdir(parents=True, exist_ok=True)
            (folder / path).write_text(task.id)
        ledger.finish(task, {Path(path).name: Product.of(folder / path) for path in task.products}, 1.0)
    storage = s3fs.S3FileSystem()
    storage.makedirs(address.split("/")[2])
    storage.put(str(folder) + "/", address + "/", recursive=True)


def main(tasks: int = 1000) -> None:
    """Measure and print a table."""
    with tempfile.TemporaryDirectory() as name, serving() as (server, switch):
        secret = {"AWS_ACCESS_KEY_ID": "key", "AWS_SECRET_ACCESS_KEY": "secret", "AWS_DEFAULT_REGION": "us-east-1"}
        os.environ |= {"AWS_ENDPOINT_URL": server, "XDG_CACHE_HOME": f"{name}/cache"} | secret
        recipe = load_recipe(write_many(Path(name), tasks - 2))
        shards = [task for task in plan(recipe) if isinstance(task, Shard)]
        fill(shards, Path(name) / "out", "s3://products/many")
        out = place("s3://products/many")

        def resume() -> None:
            summary = execute(shards, Ledger(out), console=Console(file=io.StringIO()))
            assert len(summary.before) == len(shards)

        looks: dict[str, Callable[[], object]] = {
            "status, first": lambda: list(map(Ledger(out).state, shards)),
            "status": lambda: list(map(Ledger(out).state, shards)),
            "plan": lambda: facts_of(shards, Ledger(out)),
            "resume": resume,
        }
        print(f"{len(shards):,} finished tasks\n| | requests | seconds |\n|---|---|---|")
        for what, look in looks.items():
            switch.paths.clear()
            took = timed(1000, look)  # in seconds
            print(f"| {what} | {len(switch.paths):,} | {took['wall']:.1f} ({took['cpu']:.1f}) |", flush=True)


if __name__ == "__main__":
    cyclopts.run(main)
