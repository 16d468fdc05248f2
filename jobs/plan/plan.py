"""Plan: a recipe as the list of its tasks; pure, and made without any of the libraries that do the work.

Every task is listed after those it needs. Each kind of task defines its own identity.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from types import MappingProxyType

from jobs.plan.dataset import Shard, shards
from jobs.plan.measurements.catalogue import measurements
from jobs.plan.measurements.subjects import Subjects
from jobs.plan.page import page_of
from jobs.plan.task import Task
from jobs.plan.training import trainings
from jobs.recipe.recipe import Recipe


def plan(recipe: Recipe, alone: Mapping[str, str] = MappingProxyType({})) -> list[Task]:
    """Return the tasks of a recipe.

    Parameters
    ----------
    recipe : Recipe
        The recipe.
    alone : mapping
        Files of Records that no task writes and the page shows, each with its hash.
    """
    parts = {id(one): shards(one) for one in recipe.together}
    own = parts[id(recipe)]
    rows, trained = list(own), {}
    for model in (model for model in recipe.models if model.learns):
        trainer = recipe.trainer_of(model)
        trained[model.options.name] = trainings(trainer, model, parts[id(trainer)])
        # Of another recipe's rows those that its model learns from; they are the same for every seed.
        read = {need for task in trained[model.options.name][0].values() for need in task.needs}
        rows += [part for part in parts[id(trainer)] if part.id in read]
    subjects = Subjects(recipe, own, trained)
    benches = measurements(subjects)
    every = [task for seeds in trained.values() for tasks in seeds for task in tasks.values()]
    return [*_once(rows), *every, *benches, page_of(subjects, benches, alone)]


def _once(parts: Iterable[Shard]) -> list[Shard]:
    """Return each shard once: one of two data sets is made once and lies in both folders."""
    found: dict[str, Shard] = {}
    for part in parts:
        if first := found.get(part.id):
            part = first.model_copy(update={"folders": tuple(dict.fromkeys((*first.folders, *part.folders)))})
        found[part.id] = part
    return list(found.values())
