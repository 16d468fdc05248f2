"""The data set that a recipe asks for: its shards as tasks, and its folder."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Literal

from jobs.plan.task import Task, identity
from jobs.recipe.recipe import Recipe
from pipeline.fingerprint import fingerprint
from pipeline.shards.generate import ShardTask
from pipeline.truth.options import TruthOptions

Split = Literal["train", "validation", "test"]

SECONDS_A_POINT: Final = 3.5e-7
"""One point of the truth, on one core of a server of 2021."""
POINTS_A_ROW: Final = 1700
"""Points for 2 % relative error, on average."""
BYTES_A_ROW: Final = 62


@dataclass(frozen=True)
class Shard:
    """A shard and the task that makes it."""

    question: ShardTask
    task: Task


def shards(recipe: Recipe) -> list[Shard]:
    """Return all shards of a recipe's data set, in the order of its fabrics, splits and rows."""
    asked = list(_questions(recipe))
    ids = [identity("generate", question.identity()) for _, question in asked]
    folder = f"datasets/{recipe.name}-{fingerprint(sorted(ids), 8)}"
    return [
        Shard(
            question,
            Task(
                "generate",
                f"{role} · {question.split}",
                f"{question.fabric.name} {question.split} rows {question.start}–{question.start + question.rows - 1}",
                question.identity(),
                (f"{folder}/part-{key}.parquet",),
                cost=question.rows * SECONDS_A_POINT * points_a_row(question.truth),
                rows=question.rows,
                size=question.rows * BYTES_A_ROW,
                setting={"question": question.model_dump(mode="json")},
            ),
        )
        for (role, question), key in zip(asked, ids, strict=True)
    ]


def fingerprint_of(parts: Sequence[Shard]) -> str:
    """Return the data set's fingerprint: that of its shards, in whatever order."""
    return fingerprint(sorted(part.task.id for part in parts))


def folder_of(parts: Sequence[Shard]) -> str:
    """Return the data set's folder, relative to the output folder."""
    return str(Path(parts[0].task.products[0]).parent)


def _questions(recipe: Recipe) -> Iterator[tuple[str, ShardTask]]:
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
                for start in range(0, total, recipe.dataset.shard_rows):
                    yield (
                        role,
                        ShardTask(
                            fabric=fabric,
                            split=split,
                            start=start,
                            rows=min(recipe.dataset.shard_rows, total - start),
                            seed=recipe.dataset.seed,
                            queries=recipe.dataset.queries,
                            truth=recipe.dataset.truth_of(split),
                        ),
                    )


def points_a_row(truth: TruthOptions) -> float:
    """Estimate the points of a row: they grow a little slower than 1 / error^2, within the limits of the options."""
    points = POINTS_A_ROW * (0.02 / truth.relative_error) ** 1.5
    return float(min(max(points, truth.min_count), truth.max_count))
