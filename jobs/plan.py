"""Plan: a recipe as the list of its tasks; pure, and made without any of the libraries that do the work.

Every task is listed after those it needs. What enters an identity is written out here: shards by their fabric's optics,
models by their options and the shards they read, benchmarks by the models, the shards and the fabrics with colours.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

from jobs.dataset import Shard, folder_of, shards
from jobs.measurements import bench_tasks
from jobs.recipe import ModelRecipe, Recipe
from jobs.task import Task, identity
from pipeline.fingerprint import fingerprint
from pipeline.models.options import VERSIONS
from pipeline.training.options import VERSION as TRAINING_VERSION

SECONDS_A_QUERY: Final = {"woven": 4.5e-6, "neumip": 3e-6}
"""Forward and backward pass of one query, on one core of a server of 2021."""


def plan(recipe: Recipe) -> list[Task]:
    """Return the tasks of a recipe."""
    parts = shards(recipe)
    trained = {model.options.name: train_tasks(recipe, model, parts) for model in recipe.models if model.learns}
    trainings = [task for tasks in trained.values() for task in tasks.values()]
    return [*(part.task for part in parts), *trainings, *bench_tasks(recipe, parts, trained)]


def train_tasks(recipe: Recipe, model: ModelRecipe, parts: Sequence[Shard]) -> dict[str, Task]:
    """Return the trainings of a model: one under the key "", or one a fabric for a model of a single material."""
    if model.of_one_material:
        groups = {fabric.name: [fabric.name] for fabric in (*recipe.seen, *recipe.unseen)}
    else:
        groups = {"": [fabric.name for fabric in (*recipe.seen, *recipe.population)]}
    return {alone_on: _train_task(model, names, alone_on, parts) for alone_on, names in groups.items()}


def _train_task(model: ModelRecipe, fabrics: list[str], alone_on: str, parts: Sequence[Shard]) -> Task:
    """Return one training; it reads the training and validation rows of its fabrics and nothing else."""
    options, training = model.options, model.training
    read = [part for part in parts if part.question.fabric.name in fabrics and part.question.split != "test"]
    needs = tuple(part.task.id for part in read)
    spec: dict[str, Any] = {
        "versions": [VERSIONS[options.model], TRAINING_VERSION],
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
        cost=training.steps * training.batch * SECONDS_A_QUERY[options.model],
        size=500_000,
        setting={
            "dataset": folder_of(parts),
            "training": training.model_dump(mode="json"),
        },
    )
