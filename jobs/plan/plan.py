"""Plan: a recipe as the list of its tasks; pure, and made without any of the libraries that do the work.

Every task is listed after those it needs. Each kind of task defines its own identity.
"""

from collections.abc import Iterable
from typing import Final

from jobs.plan.dataset import DataSet, Shard
from jobs.plan.measurements import answers, fabrics, scenes, truth
from jobs.plan.measurements.measurement import Measurement
from jobs.plan.measurements.subjects import Subjects
from jobs.plan.page import Page
from jobs.plan.task import Task
from jobs.plan.training import Training
from jobs.recipe.recipe import Recipe

KINDS: Final[tuple[type[Measurement], ...]] = (
    truth.TruthPicture,
    truth.TruthFrames,
    truth.TruthEdge,
    fabrics.TruthNoise,
    fabrics.OnFabric,
    fabrics.OnUnseenPopulation,
    fabrics.Latents,
    scenes.SceneShot,
    scenes.FrameTime,
    fabrics.AtExtremes,
    fabrics.TimeOfMethods,
    fabrics.ErrorsBySize,
    fabrics.OfAddedMetric,
    answers.OfAnswers,
    truth.LivePage,
    truth.Study,
)
"""The kinds of measurement, each after those that it reads; `SceneShot` plans those in its frames too."""


def plan(recipe: Recipe) -> list[Task]:
    """Return the tasks of a recipe."""
    datasets = {id(member): DataSet(member) for member in recipe.together}
    own = datasets[id(recipe)]
    rows, trained = list(own.shards), {}
    for model in (model for model in recipe.models if model.options.learns):
        dataset = datasets[id(recipe.trainer_of(model))]
        trained[model.options.name] = Training.planned(dataset, model)
        # Of another recipe's rows those that its model learns from; they are the same for every seed.
        read = {need for task in trained[model.options.name][0].values() for need in task.needs}
        rows += [part for part in dataset.shards if part.id in read]
    subjects = Subjects(recipe, own, trained)
    benches = [task for kind in KINDS for task in kind.planned(subjects)]
    every = [task for seeds in trained.values() for tasks in seeds for task in tasks.values()]
    return [*_once(rows), *every, *benches, Page.planned(subjects, benches)]


def _once(parts: Iterable[Shard]) -> list[Shard]:
    """Return each shard once: one of two data sets is made once and lies in both folders."""
    shards: dict[str, Shard] = {}
    for part in parts:
        if (first := shards.setdefault(part.id, part)).folders != part.folders:
            folders = tuple(dict.fromkeys((*first.folders, *part.folders)))
            shards[part.id] = first.model_copy(update={"folders": folders})
    return list(shards.values())
