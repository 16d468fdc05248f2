"""Plan: a recipe as the list of its tasks; pure, and made without any of the libraries that do the work.

Every task is listed after those it needs. What enters an identity is written out here: shards by their fabric's optics,
models by their options and the shards they read, benchmarks by the models, the shards and the fabrics with colours, the
page by the benchmarks and by what was measured without a recipe.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import Any

from jobs.plan.dataset import Shard, fingerprint_of, folder_of, shards
from jobs.plan.measurements import bench_tasks
from jobs.plan.scenes import fabrics_of
from jobs.plan.task import Task, identity
from jobs.recipe.recipe import ModelRecipe, Recipe
from pipeline import versions
from pipeline.fingerprint import fingerprint
from pipeline.shards.extra_rows import set_name


def plan(recipe: Recipe, alone: Mapping[str, str] = MappingProxyType({})) -> list[Task]:
    """Return the tasks of a recipe.

    Parameters
    ----------
    recipe : Recipe
        What is asked for.
    alone : mapping
        Files of Records that no task writes and the page shows, each with its hash.
    """
    parts = {id(one): shards(one) for one in recipe.together}
    own = parts[id(recipe)]
    rows = [part.task for part in own]
    trained = {}
    for model in (model for model in recipe.models if model.learns):
        teacher = recipe.teacher_of(model)
        tasks = trained[model.options.name] = train_tasks(teacher, model, parts[id(teacher)])
        # Of another recipe's rows those that its model learns from.
        read = {need for task in tasks.values() for need in task.needs}
        rows += [part.task for part in parts[id(teacher)] if part.task.id in read]
    trainings = [task for tasks in trained.values() for task in tasks.values()]
    benches = list(bench_tasks(recipe, own, trained))
    return [*_once(rows), *trainings, *benches, _report_task(recipe, own, trained, benches, alone)]


def _once(tasks: Iterable[Task]) -> list[Task]:
    """Return each task once: a shard of two data sets is made once and lies in both folders."""
    found: dict[str, Task] = {}
    for task in tasks:
        if first := found.get(task.id):
            task = replace(first, products=tuple(dict.fromkeys((*first.products, *task.products))))
        found[task.id] = task
    return list(found.values())


def train_tasks(recipe: Recipe, model: ModelRecipe, parts: Sequence[Shard]) -> dict[str, Task]:
    """Return the trainings of a model: one under the key "", or one a fabric for a model of a single material."""
    if model.of_one_material:
        groups = {fabric.name: [fabric.name] for fabric in (*recipe.seen, *recipe.unseen)}
    else:
        groups = {"": [fabric.name for fabric in (*recipe.seen, *recipe.population)]}
    return {alone_on: _train_task(model, names, alone_on, parts) for alone_on, names in groups.items()}


def _report_task(
    recipe: Recipe,
    parts: Sequence[Shard],
    trained: Mapping[str, Mapping[str, Task]],
    benches: Sequence[Task],
    alone: Mapping[str, str],
) -> Task:
    """Return the task that writes the page of all measurements."""
    pictures = []
    for task in benches:
        make, fabric = task.setting["make"], task.setting.get("fabric", "")
        if make in recipe.bench.views:
            truth = {"fabric": fabric["name"], "scene": make, "method": "truth", "setting": ""}
            pictures.append(truth | {"path": task.products[0]})
        if make in ("shot", "scene"):
            pictures += _of_scene(task)
        for setting, scenes in task.setting.get("pictures", {}).items():
            method = {"fabric": fabric, "method": task.setting["model"]["name"], "setting": setting}
            pictures += [method | {"scene": scene, "path": path} for scene, path in scenes.items()]
    fabrics = [(fabric, "seen") for fabric in recipe.seen] + [(fabric, "unseen") for fabric in recipe.unseen]
    return Task(
        "report",
        "page",
        f"page of {recipe.name}",
        {
            "version": versions.BENCH,
            "recipe": recipe.name,
            "about": recipe.about,
            "measured": [task.id for task in benches],
            "alone": dict(alone),
            "fabrics": [[fabric.name, fabric.source] for fabric, _ in fabrics],
        },
        (f"report/{recipe.name}/index.html",),
        tuple(task.id for task in benches),
        cost=15.0,
        size=10_000_000,
        setting={
            "dataset": f"{recipe.name}, {fingerprint_of(parts)}",
            "fabrics": [(fabric.model_dump(mode="json"), role) for fabric, role in fabrics],
            "models": [_note(recipe, model, trained.get(model.options.name, {})) for model in recipe.models],
            "options": recipe.bench.model_dump(mode="json"),
            "records": [task.products[0] for task in benches if task.products[0].endswith(".json")],
            "timing": benches[-1].products[0],
            "pictures": pictures,
        },
    )


def _of_scene(task: Task) -> list[dict[str, str]]:
    """Return the pictures of a task on a scene."""
    if task.setting["make"] == "shot":
        return [
            {
                "fabric": "",
                "scene": task.spec["scene"]["name"],
                "method": "truth",
                "setting": "",
                "path": task.products[1],
            }
        ]
    method = {"fabric": "", "scene": task.setting["scene"], "method": task.setting["model"]["name"]}
    return [method | {"setting": setting, "path": path} for setting, path in task.setting["pictures_of"].items()]


def _note(recipe: Recipe, model: ModelRecipe, trainings: Mapping[str, Task]) -> dict[str, Any]:
    """Return what the page says of a model."""
    options, training = model.options, model.training
    about = "nothing is trained" if options.name == options.model else f"{options.model}: nothing is trained"
    if trainings:
        first = next(iter(trainings.values()))
        what = "each fabric by itself" if model.of_one_material else f"{len(first.spec['fabrics'])} fabrics at once"
        kind = "" if options.name == options.model else f"{options.model}: "
        about = f"{kind}{what}, {training.steps:,} steps of {training.batch:,} queries"
        if options.departures:
            about += f"; unlike the paper: {', '.join(options.departures)}"
        about += _taught(recipe, model) + _left_out(recipe, model, trainings)
    return {
        "name": options.name,
        "about": about,
        "fingerprint": " ".join(task.id for task in trainings.values()),
        "per_material": model.of_one_material,
        "kind": options.model,
    }


def _taught(recipe: Recipe, model: ModelRecipe) -> str:
    """Say which other recipe trains a model."""
    teacher = recipe.teacher_of(model)
    own = "" if teacher.dataset.queries == recipe.dataset.queries else ", on queries of its own"
    return "" if teacher is recipe else f"; trained by the recipe {teacher.name}{own}"


def _left_out(recipe: Recipe, model: ModelRecipe, trainings: Mapping[str, Task]) -> str:
    """Say where a model is left out because it does not know the cloth."""
    if not model.of_one_material:
        return ""
    fabrics = [fabric.name for fabric in (*recipe.seen, *recipe.unseen) if fabric.name not in trainings]
    scenes = [f"in the scene {name}" for name in recipe.bench.scenes.names if not fabrics_of(name) <= set(trainings)]
    where = [f"on {name}" for name in fabrics] + scenes
    return f"; left out {', '.join(where)}: it was not trained on that cloth" if where else ""


def _train_task(model: ModelRecipe, fabrics: list[str], alone_on: str, parts: Sequence[Shard]) -> Task:
    """Return one training; it reads its fabrics' training and validation rows and the extra rows of its options."""
    options, training = model.options, model.training
    splits = {"train", "validation", *map(set_name, options.extra_rows)}
    read = [part for part in parts if part.question.fabric.name in fabrics and part.question.split in splits]
    needs = tuple(part.task.id for part in read)
    spec: dict[str, Any] = {
        "versions": [options.version, versions.TRAINING],
        "options": options.model_dump(mode="json"),
        "training": training.model_dump(mode="json", exclude={"device", "checkpoint_every"}),
        "fabrics": fabrics,
        "shards": fingerprint(needs),
    }
    name = f"{options.name}-{alone_on}" if alone_on else options.name
    folder = f"models/{name}-{identity('train', spec)[:8]}"
    return Task(
        "train",
        options.name,
        f"{options.name} on {alone_on or f'{len(fabrics)} fabrics'}",
        spec,
        (f"{folder}/model.safetensors", f"{folder}/card.json"),
        needs,
        cost=training.steps * training.batch * options.seconds[0],
        size=500_000,
        setting={
            "dataset": folder_of(parts),
            "training": training.model_dump(mode="json"),
        },
    )
