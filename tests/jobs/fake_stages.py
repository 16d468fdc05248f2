"""Stages that write a few bytes, for the executor's tests; a module of its own so that workers can import it."""

import json
import os
import signal
import sys
import time
from pathlib import Path

from jobs.plan.task import Task


def task(name, stage="generate", needs=(), cost=1.0, alone=False, **spec):
    products = (f"{stage}/{name}.txt",)
    return Task(
        stage, stage, name, {"name": name, **spec}, products, tuple(n.id for n in needs), cost=cost, alone=alone
    )


def run(task, out, progress):
    """Do what the specification says: log, sleep, die, fail, write."""
    spec = task.spec
    log(out, "start", task)
    for step in range(10):
        time.sleep(spec.get("seconds", 0) / 10)
        progress(step / 10)
    if spec.get("dies") and not (out / f"{spec['name']}.died").exists():
        (out / f"{spec['name']}.died").touch()
        os.kill(os.getpid(), signal.SIGKILL)
    if "fails" in spec:
        raise eval(spec["fails"])
    if not spec.get("forgets"):
        path = out / task.products[0]
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(f"{spec['name']}\n" * 100)
    log(out, "end", task)


def log(out, event, task):
    threads = os.environ.get("NUMBA_NUM_THREADS")
    line = json.dumps({"event": event, "name": task.title, "pid": os.getpid(), "at": time.time(), "threads": threads})
    with (out / "log.jsonl").open("a") as file:
        file.write(line + "\n")


def events(out):
    return [json.loads(line) for line in (out / "log.jsonl").read_text().splitlines()]


def chain():
    """Eight slow shards and a training that needs them."""
    shards = [task(f"shard {index}", seconds=0.4) for index in range(8)]
    return [*shards, task("net", "train", needs=shards)]


if __name__ == "__main__":
    from jobs.run.executor import execute

    execute(chain(), Path(sys.argv[1]), run, workers=2)
