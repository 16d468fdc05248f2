"""Products of real plans without their work: each task writes bytes that depend on its id alone, times excepted."""

import json
import random
import time
from pathlib import Path

import numpy as np

from jobs.plan.dataset import DataSet, Shard
from jobs.plan.page import Page
from jobs.plan.plan import plan
from jobs.plan.task import STAGES
from jobs.plan.training import Training
from jobs.recipe.load import load_recipe
from jobs.run.executor import RunSummary
from jobs.run.ledger import Ledger
from jobs.run.manifest_file import ManifestFile
from jobs.run.receipt import Product
from pipeline.atomic import link
from pipeline.models.card import write_model
from pipeline.shards.generate import ShardTask
from pipeline.shards.queries import draw_queries
from pipeline.shards.store import columns_of, write_columns
from pipeline.truth.query import Answers
from reports.page.files import write_files
from tests.jobs.small_recipes import write_toml


def write_recipe(folder, name, *models, bench=None, **dataset):
    """Write a recipe of denim and small shards, with models by name or with options; return its path."""
    dataset = {"seen": ["denim"], "shard_rows": 64, "rows": {"train": 128, "validation": 32, "test": 64}} | dataset
    models = [{"model": model} if isinstance(model, str) else model for model in models]
    content = {"name": name, "dataset": dataset, "models": models, "bench": bench or {"views": ["plane"]}}
    return write_toml(folder, content)


def flip(path, chance=random.Random(0)):  # noqa: B008, any byte will do
    content = bytearray(path.read_bytes())
    content[chance.randrange(len(content))] ^= chance.randrange(1, 256)
    path.write_bytes(content)


def make(task, out):
    paths = [out / path for path in task.products]
    for path in paths:
        path.parent.mkdir(parents=True, exist_ok=True)
    if isinstance(task, Shard):
        assert isinstance(task.shard, ShardTask)
        shard = task.shard
        queries = draw_queries(shard.queries, shard.fabric.weave.repeat, int(task.id, 16), shard.start, shard.rows)
        mean = np.full((shard.rows, 4), 0.1, np.float32)
        answers = Answers.opaque(mean, mean, np.full(shard.rows, 8, np.int32))
        write_columns(paths[0], "components", shard.fabric.name, columns_of(queries, answers), {})
        for path in paths[1:]:
            link(paths[0], path)
    elif isinstance(task, Training):
        write_model(out / task.folder, task.id.encode() * 20, {"steps_taken": task.training.steps, "of": task.id})
    elif isinstance(task, Page):
        (out / task.folder / "figures").mkdir(exist_ok=True)
        for name in ("records.json", "figures/a.png"):
            (out / task.folder / name).write_text(name * 20)
        write_files(out / task.folder, ["records.json", "figures/a.png"])
        paths[0].write_text("".join((out / path).read_text() for path in task.records))
    else:
        for path in paths:
            now = time.time_ns() if task.slots == "all" or path.name.endswith(".machine.json") else 0
            path.write_text(json.dumps({"file": path.name, "date": now, "values": [0.5] * 20}))


def finish(task, ledger):
    """Write the receipt of a task whose products are there; return what they are."""
    files = {Path(path).name: Product.of(ledger.out / path) for path in task.products}
    ledger.finish(task, files, 1.5)
    return files


def execute(tasks, ledger, *, stages=STAGES, manifests=(), **rest):
    """Do the unfinished tasks one after the other in this process, as `jobs.run.executor.execute` would."""
    summary = RunSummary([], [], [], [])
    for task in tasks:
        if ledger.state(task) == "done" or ledger.adopt(task):
            summary.before.append(task)
        elif task.stage in stages:
            make(task, ledger.out)
            files = finish(task, ledger)
            for manifest in manifests:
                manifest.add(task, files)
            summary.ran.append(task)
    for manifest in manifests:
        manifest.save()
    return summary


def finished(recipe, out, stages=STAGES):
    """Write all products of a recipe, and return its plan."""
    loaded = load_recipe(recipe)
    tasks = plan(loaded)
    execute(tasks, Ledger(out), stages=stages)
    for one in loaded.together:
        ManifestFile(DataSet(one), Ledger(out)).save()
    return tasks


def contents(out):
    """Return the bytes of all files but the locks."""
    files = [path for path in out.rglob("*") if path.is_file() and path.suffix != ".lock" and path.name != "lock"]
    return {str(path.relative_to(out)): path.read_bytes() for path in files}
