"""One task of ground truth: which rows of which fabric, answered and written as one shard.

Extra rows are what a model learns from beside the data set's queries, as its options declare it: a kind and its
parameters. Models whose options declare equal sets share the shards.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field

from pipeline import versions
from pipeline.fingerprint import fingerprint, stream_seed
from pipeline.shards.angular_samples import AngularSamples
from pipeline.shards.queries import Kind, QueryOptions, answered, draw_queries
from pipeline.shards.silhouettes import SilhouetteRows
from pipeline.truth.options import TruthOptions
from pipeline.truth.query import Queries
from weaves.fabric import Fabric
from weaves.validation import Frozen

ExtraRows = Annotated[AngularSamples | SilhouetteRows, Field(discriminator="kind")]
"""Any set of extra rows, distinguished by its kind."""


def set_name(rows: ExtraRows) -> str:
    """Return the name of a set in a manifest, where it replaces the split: kind and fingerprint."""
    return f"{rows.kind}-{fingerprint(rows.model_dump(mode='json'), 8)}"


class _AnyTask(Frozen):
    fabric: Fabric
    """The fabric; its colours and source do not enter the numbers."""
    start: int = Field(ge=0)
    """First row of the stream of the split or set."""
    rows: int = Field(gt=0)

    def identity(self) -> dict[str, Any]:
        """Return what the numbers depend on, without names, sources and colours; versions included."""
        specification = self.model_dump(mode="json", exclude={"fabric"})
        return {"version": versions.TRUTH, "optics": self.fabric.optics(), "name": self.fabric.name, **specification}


class ShardTask(_AnyTask):
    """Everything that a shard of the data set's own rows depends on, and the fabric's name."""

    kind: ClassVar[Kind] = "components"

    split: Literal["train", "validation", "test"]
    """Each split draws its own queries."""
    seed: int = Field(ge=0)
    """The data set's seed."""
    queries: QueryOptions = QueryOptions()
    truth: TruthOptions = TruthOptions()

    def stream(self, purpose: str) -> int:
        """Return the seed of its queries or points."""
        return stream_seed(purpose, [self.fabric.optics(), self.split, self.seed])

    def drawn(self) -> Queries:
        """Return its queries."""
        return draw_queries(self.queries, self.fabric.weave.repeat, self.stream("queries"), self.start, self.rows)


class ExtraShardTask(_AnyTask):
    """Everything that a shard of extra rows depends on, and the fabric's name."""

    extra: ExtraRows
    """The set that the rows belong to."""

    @property
    def kind(self) -> Kind:
        """Kind of the rows, which names their columns (`pipeline.shards.schema`)."""
        return self.extra.kind

    @property
    def split(self) -> str:
        """Name of the set, in place of a split."""
        return set_name(self.extra)


AnyShardTask = ShardTask | ExtraShardTask


def generate_shard(task: AnyShardTask, path: Path, progress: Callable[[float], None] = lambda fraction: None) -> None:
    """Answer a task's queries and write them to `path`; `progress` receives the finished share."""
    # Imported here so that a plan can name tasks without loading compilers.
    from pipeline.shards.store import columns_of, write_columns

    def finished(rows: int) -> None:
        progress(rows / task.rows)

    if isinstance(task, ShardTask):
        queries, points = task.drawn(), task.stream("points")
        columns = columns_of(queries, answered(task.fabric, queries, task.truth, points, task.start, finished))
    else:
        columns = task.extra.answer(task.fabric, task.start, task.rows, finished)
    write_columns(path, task.kind, task.fabric.name, columns, {"task": task.identity()})
