"""Tasks that write a few bytes, for the executor's tests; a module of its own so that workers can import it."""

import json
import os
import signal
import sys
import time
from pathlib import Path
from typing import ClassVar

from jobs.plan.task import Place, Task


class Fake(Task):
    """Logs, sleeps, dies, fails, writes."""

    stage: ClassVar = "generate"

    name: str
    after: tuple[str, ...] = ()
    folder: Place = ""
    seconds: float = 0
    dies: bool = False
    fails: str = ""
    forgets: bool = False
    hides: bool = False
    breaks: bool = False
    damages: str = ""
    always: bool = False

    @property
    def group(self):
        return self.stage

    @property
    def title(self):
        return self.name

    @property
    def products(self):
        # A worker that sees another folder under the same name, as in a container.
        folder = "elsewhere" if self.hides and os.environ.get("ELSEWHERE") else self.folder or self.stage
        return (f"{folder}/{self.name}.txt",)

    @property
    def needs(self):
        return self.after

    def versions(self):
        return {"fake": 1}

    def run(self, out, progress):
        log(out, "start", self)
        for step in range(10):
            time.sleep(self.seconds / 10)
            progress(step / 10)
        if self.dies and (self.always or not (out / f"{self.name}.died").exists()):
            (out / f"{self.name}.died").touch()
            os.kill(os.getpid(), signal.SIGKILL)
        if self.damages and (self.always or not (out / f"{self.name}.damaged").exists()):
            (out / f"{self.name}.damaged").touch()
            Path(self.damages).write_text("damaged\n" * 100)
            raise ValueError("a file that cannot be read")
        if self.fails:
            raise eval(self.fails)
        if self.breaks and os.environ.get("ELSEWHERE"):
            raise OSError("this worker has a broken disk")
        if not self.forgets:
            path = out / self.products[0]
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(f"{self.name}\n" * 100)
        log(out, "end", self)


class FakeTraining(Fake):
    stage: ClassVar = "train"


class FakeBench(Fake):
    stage: ClassVar = "bench"


class FakeTiming(FakeBench):
    slots: ClassVar = "all"


def task(name, kind=Fake, needs=(), **fields):
    return kind(name=name, after=tuple(need.id for need in needs), **fields)


def prepare(argument, ready):
    """Stand in for the compiling of a group of kernels; `argument` is a folder and a task."""
    out, of = argument
    ready(f"kernel of {of.title}")
    if of.fails:
        raise eval(of.fails)
    log(out, "prepared", of)


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
    return [*shards, task("net", FakeTraining, needs=shards)]


def timed():
    """Two shards, then a task that runs alone for a minute."""
    shards = [task(f"shard {index}") for index in range(2)]
    return [*shards, task("long", FakeTiming, needs=shards, seconds=60)]


if __name__ == "__main__":
    import fake_stages  # so that its classes have the name by which other processes import them

    from jobs.run.executor import execute
    from jobs.run.ledger import Ledger

    execute(getattr(fake_stages, sys.argv[2])(), Ledger(Path(sys.argv[1])), workers=2)
