"""The data set of a recipe: its shards as tasks, and its folder.

Beside the recipe's own rows the folder holds the extra rows that its models learn from (`Options.extra_rows`). These
are part of the models' identities and not of the data set's: a model more changes no measurement of the others.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from jobs.plan.task import Task, identity
from jobs.recipe.recipe import Recipe
from pipeline.fingerprint import fingerprint
from pipeline.shards.angular_samples import AngularSamples
from pipeline.shards.generate import AnyShardTask, ExtraShardTask, ShardTask
from pipeline.truth.options import TruthOptions

SECONDS_A_POINT: Final = 3.5e-7
"""One point of the truth, on one core of a server of 2021."""
POINTS_A_ROW: Final = 1700
"""Points for 2 % relative error, on average."""
BYTES_A_ROW: Final = 62


@dataclass(frozen=True)
class Shard:
    """A shard and the task that makes it."""

    question: AnyShardTask
    task: Task

    @property
    def is_extra(self) -> bool:
        """Whether single models alone read its rows."""
        return isinstance(self.question, ExtraShardTask)


def shards(recipe: Recipe) -> list[Shard]:
    """Return all shards of a recipe's data set, in the order of its fabrics, splits and rows; extra rows last."""
    own: list[tuple[str, AnyShardTask]] = list(_own_rows(recipe))
    folder = f"datasets/{recipe.name}-{fingerprint(sorted(_id(question) for _, question in own), 8)}"
    return [_shard(role, question, folder) for role, question in [*own, *_extra_rows(recipe)]]


def fingerprint_of(parts: Sequence[Shard]) -> str:
    """Return the data set's fingerprint: that of its own rows' shards, in whatever order."""
    return fingerprint(sorted(part.task.id for part in parts if not part.is_extra))


def folder_of(parts: Sequence[Shard]) -> str:
    """Return the data set's folder, relative to the output folder."""
    return str(Path(parts[0].task.products[0]).parent)


def _id(question: AnyShardTask) -> str:
    return identity("generate", question.identity())


def _shard(role: str, question: AnyShardTask, folder: str) -> Shard:
    """Return a shard of a fabric in this role."""
    rows = f"rows {question.start}–{question.start + question.rows - 1}"
    what = question.kind.replace("_", " ") if isinstance(question, ExtraShardTask) else question.split
    task = Task(
        "generate",
        f"{role} · {what}",
        f"{question.fabric.name} {question.split} {rows}",
        question.identity(),
        (f"{folder}/part-{_id(question)}.parquet",),
        cost=question.rows * SECONDS_A_POINT * _points(question),
        rows=question.rows,
        size=question.rows * BYTES_A_ROW,
        setting={"question": question.model_dump(mode="json")},
    )
    return Shard(question, task)


def _own_rows(recipe: Recipe) -> Iterator[tuple[str, ShardTask]]:
    """Cut every fabric's splits into shards, each with the role of its fabric."""
    rows = recipe.dataset.rows
    named = {"train": rows.train, "validation": rows.validation, "test": rows.test}
    learners = [model for model in recipe.own_models if model.learns]  # those of other recipes read rows of their own
    idle = bool(recipe.models) and not learners
    if idle:
        named = {"test": rows.test}
    # Only a model of one material learns from an unseen fabric; without one, there is nobody to read those rows.
    unseen = named if any(model.of_one_material for model in learners) else {"test": rows.test}
    for role, fabrics, splits in (
        ("seen", recipe.seen, named),
        ("population", recipe.population, {} if idle else {"train": rows.population}),
        ("unseen", recipe.unseen, unseen),
    ):
        for fabric in fabrics:
            for split, total in splits.items():
                for start, count in _cut(total, recipe.dataset.shard_rows):
                    yield (
                        role,
                        ShardTask(
                            fabric=fabric,
                            split=split,
                            start=start,
                            rows=count,
                            seed=recipe.dataset.seed,
                            queries=recipe.dataset.queries,
                            truth=recipe.dataset.truth_of(split),
                        ),
                    )


def _extra_rows(recipe: Recipe) -> Iterator[tuple[str, ExtraShardTask]]:
    """Cut the extra rows of the fabrics that each model is trained on into shards; equal sets of two models once."""
    for role, fabrics in (("seen", recipe.seen), ("population", recipe.population), ("unseen", recipe.unseen)):
        readers = [model for model in recipe.own_models if role in model.trained_roles]
        for extra in dict.fromkeys(extra for model in readers for extra in model.options.extra_rows):
            for fabric in fabrics:
                for start, count in _cut(extra.count(fabric), recipe.dataset.shard_rows):
                    yield role, ExtraShardTask(fabric=fabric, extra=extra, start=start, rows=count)


def _cut(total: int, most: int) -> Iterator[tuple[int, int]]:
    """Yield the start and the number of rows of each shard."""
    for start in range(0, total, most):
        yield start, min(most, total - start)


def _points(question: AnyShardTask) -> float:
    """Estimate the points of a row."""
    if isinstance(question, ShardTask):
        return points_a_row(question.truth)
    extra = question.extra
    return points_a_row(extra.truth) if isinstance(extra, AngularSamples) else float(extra.points)


def points_a_row(truth: TruthOptions) -> float:
    """Estimate the points of a row: they grow a little slower than 1 / error^2, within the limits of the options."""
    points = POINTS_A_ROW * (0.02 / truth.relative_error) ** 1.5
    return float(min(max(points, truth.min_count), truth.max_count))
