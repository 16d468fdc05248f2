"""Tasks that write a few bytes, for the executor's tests; a module of its own so that workers can import it."""

import io
import json
import os
import signal
import time
from pathlib import Path
from typing import ClassVar, NamedTuple

from rich.console import Console

from jobs.plan.task import Place, Task
from jobs.run.executor import execute
from jobs.run.ledger import Ledger
from jobs.run.receipt import Product


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
        log(out, "start", self.title)
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
        log(out, "end", self.title)


class FakeTraining(Fake):
    stage: ClassVar = "train"


class FakeBench(Fake):
    stage: ClassVar = "bench"


class FakeTiming(FakeBench):
    slots: ClassVar = "all"


def task(name, kind=Fake, needs=(), **fields):
    return kind(name=name, after=tuple(need.id for need in needs), **fields)


class Group(NamedTuple):
    """Stands in for a group of kernels."""

    name: str
    out: Path
    fails: bool = False

    def compile(self, ready):
        ready(f"kernel of {self.name}")
        if self.fails:
            raise ValueError("no kernel")
        log(self.out, "compiled", self.name)


class Heard(list):
    """Stands in for a manifest: titles of tasks that are done, and "saved"; `hook` is called with each task."""

    def __init__(self, hook=lambda task: None):
        self.hook = hook

    def add(self, task, files):
        self.append(task.title)
        self.hook(task)

    def save(self):
        self.append("saved")


def run(tasks, out, console=None, **options):
    """Execute tasks; what is shown of it is lost but for the `console`."""
    return execute(tasks, Ledger(out), console=console or Console(file=io.StringIO(), width=400), **options)


def done(out, *tasks):
    """Write the products and receipts of tasks, as a run would."""
    for task in tasks:
        task.run(out, lambda share: None)
        Ledger(out).finish(task, {Path(path).name: Product.of(out / path) for path in task.products}, 1.0)


def log(out, event, name):
    threads = os.environ.get("NUMBA_NUM_THREADS")
    line = json.dumps({"event": event, "name": name, "pid": os.getpid(), "at": time.time(), "threads": threads})
    with (out / "log.jsonl").open("a") as file:
        file.write(line + "\n")


def events(out):
    return [json.loads(line) for line in (out / "log.jsonl").read_text().splitlines()]
