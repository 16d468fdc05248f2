"""The data set of a recipe: its shards as tasks, and its folder.

Beside the recipe's own rows the folder holds the extra rows that its models learn from (`Options.extra_rows`). These
are part of the models' identities and not of the data set's: another model changes no measurement of the others.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, ClassVar, Final

from jobs.plan.task import Places, Progress, Stage, Task
from jobs.recipe.recipe import Recipe
from pipeline import versions
from pipeline.atomic import link
from pipeline.fingerprint import fingerprint
from pipeline.shards.angular_samples import AngularSamples
from pipeline.shards.generate import AnyShardTask, ExtraShardTask, ShardTask
from pipeline.truth.options import TruthOptions

DATASETS: Final = "datasets"
"""Folder of all data sets, relative to the output folder."""

SECONDS_A_POINT: Final = 3.5e-7
"""One point of the truth, on one core of a server of 2021."""

_POINTS_A_ROW: Final = 1700  # for 2 % relative error, on average
_SAVED: Final = 0.25  # share of the time of sampling that `auto` takes: tables answer most rows
_OF_TABLE: Final = 250  # points that take as long as a row of `node_table`
_START: Final = 0.2  # seconds until a shard's tables are there


class Shard(Task):
    """The task that makes one shard."""

    stage: ClassVar[Stage] = "generate"
    shares_process: ClassVar[bool] = True

    shard: AnyShardTask
    """Rows of one fabric, and how they are answered."""
    role: str
    """Role of the fabric in the data set (`pipeline.shards.manifest`)."""
    folders: Places
    """Folders of the data sets that hold the shard."""

    @property
    def is_extra(self) -> bool:
        """True if single models alone read its rows."""
        return isinstance(self.shard, ExtraShardTask)

    @property
    def group(self) -> str:
        """Role and split, or kind of extra rows."""
        shard = self.shard
        what = shard.kind.replace("_", " ") if isinstance(shard, ExtraShardTask) else shard.split
        return f"{self.role.replace('_', ' ')} · {what}"

    @property
    def title(self) -> str:
        """Fabric, split and rows."""
        shard = self.shard
        last = shard.start + shard.rows - 1
        return f"{shard.fabric.name} {shard.split} rows {shard.start}–{last}"

    @property
    def products(self) -> tuple[str, ...]:
        """The same shard in every folder."""
        return tuple(f"{folder}/part-{self.id}.parquet" for folder in self.folders)

    @property
    def cost(self) -> float:
        """Estimated seconds on one core."""
        return _START + self.rows * SECONDS_A_POINT * _points(self.shard)

    @property
    def rows(self) -> int:
        """Rows of the shard."""
        return self.shard.rows

    def versions(self) -> dict[str, int]:
        """Return the version of the truth."""
        return {"truth": versions.TRUTH}

    def identity(self) -> dict[str, Any]:
        """Return the identity that the shard itself holds."""
        return self.shard.identity()

    def run(self, out: Path, progress: Progress) -> None:
        """Write the shard to its first folder and link it into the others."""
        from pipeline.shards.generate import generate_shard

        first, *others = (out / path for path in self.products)
        generate_shard(self.shard, first, progress)
        for other in others:
            link(first, other)


def shards(recipe: Recipe) -> list[Shard]:
    """Return all shards of a recipe's data set, in the order of its fabrics, splits and rows; extra rows last."""
    rows: list[tuple[str, AnyShardTask]] = [*_own_rows(recipe), *_extra_rows(recipe)]
    parts = [Shard(shard=shard, role=role, folders=()) for role, shard in rows]
    folder = f"{DATASETS}/{recipe.name}-{fingerprint(sorted(part.id for part in parts if not part.is_extra), 8)}"
    return [part.model_copy(update={"folders": (folder,)}) for part in parts]


def fingerprint_of(parts: Sequence[Shard]) -> str:
    """Return the data set's fingerprint: that of its own rows' shards, in whatever order."""
    return fingerprint(sorted(part.id for part in parts if not part.is_extra))


def folder_of(parts: Sequence[Shard]) -> str:
    """Return the data set's folder, relative to the output folder."""
    return parts[0].folders[0]


def _own_rows(recipe: Recipe) -> Iterator[tuple[str, ShardTask]]:
    """Cut every fabric's splits into shards, each with the role of its fabric."""
    dataset = recipe.dataset
    for role, fabric, split, total in recipe.own_rows():
        for start, count in _cut(total, dataset.shard_rows):
            shard = ShardTask(
                fabric=fabric,
                split=split,
                start=start,
                rows=count,
                seed=dataset.seed,
                queries=dataset.queries,
                truth=dataset.truth_of(split),
            )
            yield role, shard


def _extra_rows(recipe: Recipe) -> Iterator[tuple[str, ExtraShardTask]]:
    """Cut every fabric's extra rows into shards, each with the role of its fabric."""
    for role, fabric, extra, total in recipe.extra_rows():
        for start, count in _cut(total, recipe.dataset.shard_rows):
            yield role, ExtraShardTask(fabric=fabric, extra=extra, start=start, rows=count)


def _cut(total: int, most: int) -> Iterator[tuple[int, int]]:
    """Yield the start and the number of rows of each shard."""
    for start in range(0, total, most):
        yield start, min(most, total - start)


def _points(shard: AnyShardTask) -> float:
    """Estimate the points of a row."""
    if isinstance(shard, ShardTask):
        return points_a_row(shard.truth)
    extra = shard.extra
    return points_a_row(extra.truth) if isinstance(extra, AngularSamples) else float(extra.points)


def points_a_row(truth: TruthOptions) -> float:
    """Return how many points take as long as a row, estimated.

    Points grow a little slower than 1 / error^2, within the limits of the options.
    """
    if truth.estimator == "node_table":
        return _OF_TABLE
    points = min(max(_POINTS_A_ROW * (0.02 / truth.relative_error) ** 1.5, truth.min_count), truth.max_count)
    return points * _SAVED if truth.estimator == "auto" else float(points)
