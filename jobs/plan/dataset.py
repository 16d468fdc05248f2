"""The data set of a recipe: its shards as tasks, and its folder.

Beside the recipe's own rows the folder holds the extra rows that its models learn from (`Options.extra_rows`). These
are part of the models' identities and not of the data set's: another model changes no measurement of the others.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Final

from jobs.plan.task import Places, Progress, Stage, Task
from jobs.plan.truth_cost import SECONDS_A_POINT, TruthCost
from jobs.recipe.recipe import Recipe
from pipeline import versions
from pipeline.atomic import link
from pipeline.fingerprint import fingerprint, fingerprints
from pipeline.shards.angular_samples import AngularSamples
from pipeline.shards.generate import AnyShardTask, ExtraShardTask, ShardTask

if TYPE_CHECKING:
    from pipeline.shards.manifest import ShardEntry

DATASETS: Final = "datasets"  # folder of all data sets, relative to the output folder
_START: Final = 0.1  # seconds of any shard


class Shard(Task):
    """The task that makes one shard."""

    stage: ClassVar[Stage] = "generate"
    shares_process: ClassVar[bool] = True
    needs: ClassVar = ()

    shard: AnyShardTask  # rows of one fabric, and how they are answered
    role: str  # role of the fabric in the data set (`pipeline.shards.manifest`)
    folders: Places

    @property
    def group(self) -> str:
        """Role and split, or kind of extra rows."""
        what = self.shard.kind if isinstance(self.shard, ExtraShardTask) else self.shard.split
        return f"{self.role} · {what}".replace("_", " ")

    @property
    def title(self) -> str:
        """Fabric, split and rows."""
        shard = self.shard
        return f"{shard.fabric.name} {shard.split} rows {shard.start}–{shard.start + shard.rows - 1}"

    @property
    def products(self) -> tuple[str, ...]:
        """The same shard in every folder."""
        return tuple(f"{folder}/part-{self.id}.parquet" for folder in self.folders)

    @property
    def cost(self) -> float:
        """Estimated seconds on one core."""
        shard = self.shard
        if isinstance(shard, ShardTask):
            truth, flat = shard.truth, shard.queries.curvature[1] == 0.0
        elif isinstance(shard.extra, AngularSamples):
            truth, flat = shard.extra.truth, True
        else:
            return _START + self.rows * SECONDS_A_POINT * shard.extra.points
        answers = TruthCost(truth, shard.fabric)
        first = shard.start == 0 and shard.split != "validation"  # others find the table in their process
        return _START + (answers.table if first else 0.0) + self.rows * answers.row(flat)

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

    def entry(self, sha256: str) -> ShardEntry:
        """Return its entry in a manifest."""
        from pipeline.shards.manifest import ShardEntry

        shard = self.shard
        rows = {name: getattr(shard, name) for name in ("kind", "split", "start", "rows")}
        return ShardEntry(file=Path(self.products[0]).name, fabric=shard.fabric.name, sha256=sha256, **rows)

    def run(self, out: Path, progress: Progress) -> None:
        """Write the shard to its first folder and link it into the others."""
        from pipeline.shards.generate import generate_shard

        first, *others = (out / path for path in self.products)
        generate_shard(self.shard, first, progress)
        for other in others:
            link(first, other)


class DataSet:
    """The data set of a recipe: its shards in the order of fabrics, splits and rows, extra rows last."""

    def __init__(self, recipe: Recipe) -> None:
        self.recipe = recipe
        cuts = list(_cuts(recipe))
        self.fingerprint = fingerprint(sorted(id for first, _, id in cuts if isinstance(first.shard, ShardTask)))
        """Of its own rows."""
        self.folder = f"{DATASETS}/{recipe.name}-{self.fingerprint[:8]}"  # relative to the output folder
        self.shards: list[Shard] = []
        for first, numbers, id in cuts:  # only the first of each set is validated
            own = {"shard": first.shard.model_copy(update=numbers), "folders": (self.folder,), "id": id}
            self.shards.append(first.model_copy(update=own))


def _cuts(recipe: Recipe) -> Iterator[tuple[Shard, dict[str, int], str]]:
    """Yield for every shard the first one of its set, its own first row and number of rows, and the id of its task."""
    dataset = recipe.dataset
    for role, fabric, kind, total in (*recipe.own_rows(), *recipe.extra_rows()):
        starts = range(0, total, dataset.shard_rows)
        numbers = [{"start": start, "rows": min(dataset.shard_rows, total - start)} for start in starts]
        if not numbers:
            continue
        shard: AnyShardTask
        if isinstance(kind, str):
            truth = (dataset.training_truth if kind == "train" else None) or dataset.truth
            own = {"split": kind, "seed": dataset.seed, "queries": dataset.queries, "truth": truth}
            shard = ShardTask(fabric=fabric, **numbers[0], **own)
        else:
            shard = ExtraShardTask(fabric=fabric, **numbers[0], extra=kind)
        first = Shard(shard=shard, role=role, folders=())
        for cut, id in zip(numbers, fingerprints(first.stage, first.identity(), numbers), strict=True):
            yield first, cut, id
