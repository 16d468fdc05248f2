"""One task of ground truth: which rows of which fabric, answered and written as one shard."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, Final, Literal

import numpy as np
from pydantic import Field, TypeAdapter

from pipeline import versions
from pipeline.fingerprint import stream_seed
from pipeline.shards.extra_rows import ExtraRows, Kind, set_name
from pipeline.shards.queries import QueryOptions, draw_queries
from pipeline.truth.options import TruthOptions
from weaves.fabric import Fabric
from weaves.validation import Frozen

_CHUNK = 2048  # rows between two signs of progress; no row depends on it


class ShardTask(Frozen):
    """Everything that a shard of the data set's own rows depends on, and the fabric's name."""

    fabric: Fabric
    """The fabric; its colours and source do not enter the numbers."""
    split: Literal["train", "validation", "test"]
    """Each split draws its own queries."""
    start: int = Field(ge=0)
    """First row of the split's stream."""
    rows: int = Field(gt=0)
    """Rows in this shard."""
    seed: int = Field(ge=0)
    """The data set's seed."""
    queries: QueryOptions = QueryOptions()
    """Distribution of the queries."""
    truth: TruthOptions = TruthOptions()
    """How they are answered."""

    @property
    def kind(self) -> Kind:
        """Kind of the rows, which names their columns (`pipeline.shards.schema`)."""
        return "components"

    def identity(self) -> dict[str, Any]:
        """Return what the numbers depend on, without names, sources and colours; versions included."""
        return _identity(self)


class ExtraShardTask(Frozen):
    """Everything that a shard of extra rows depends on, and the fabric's name."""

    fabric: Fabric
    """The fabric; its colours and source do not enter the numbers."""
    extra: ExtraRows
    """The set that the rows belong to."""
    start: int = Field(ge=0)
    """First row of the set's stream."""
    rows: int = Field(gt=0)
    """Rows in this shard."""

    @property
    def kind(self) -> Kind:
        """Kind of the rows, which names their columns (`pipeline.shards.schema`)."""
        return self.extra.kind

    @property
    def split(self) -> str:
        """Name of the set, in place of a split."""
        return set_name(self.extra)

    def identity(self) -> dict[str, Any]:
        """Return what the numbers depend on, without names, sources and colours; versions included."""
        return _identity(self)


AnyShardTask = ShardTask | ExtraShardTask

SHARD_TASK: Final = TypeAdapter[ShardTask | ExtraShardTask](AnyShardTask)
"""Reads either kind of task from its JSON."""


def generate_shard(task: AnyShardTask, path: Path, progress: Callable[[float], None] = lambda fraction: None) -> None:
    """Answer a task's queries and write them to `path`; `progress` receives the finished share."""
    # Imported here so that a plan can name tasks without loading compilers.
    from pipeline.shards.store import columns_of, write_columns

    if isinstance(task, ShardTask):
        columns = columns_of(*_answered(task, progress))
    else:
        answered = task.extra.answer(task.fabric, task.start, task.rows, lambda done: progress(done / task.rows))
        columns = answered if isinstance(answered, dict) else columns_of(*answered)
    write_columns(path, task.kind, task.fabric.name, columns, {"task": task.identity()})


def _answered(task: ShardTask, progress: Callable[[float], None]) -> Any:
    """Return queries and answers of a task of the data set's own rows."""
    from pipeline.truth.estimator import estimate
    from pipeline.truth.query import Answers

    stream = [task.fabric.optics(), task.split, task.seed]
    seed = stream_seed("queries", stream)
    queries = draw_queries(task.queries, task.fabric.weave.repeat, seed, task.start, task.rows)
    parts = []
    for first in range(0, task.rows, _CHUNK):
        chunk = queries.take(slice(first, first + _CHUNK))
        parts.append(estimate(task.fabric, chunk, task.truth, stream_seed("points", stream), task.start + first))
        progress(min(1.0, (first + _CHUNK) / task.rows))
    return queries, Answers(*(np.concatenate(columns) for columns in zip(*parts, strict=True)))


def _identity(task: AnyShardTask) -> dict[str, Any]:
    specification = task.model_dump(mode="json", exclude={"fabric"})
    return {"version": versions.TRUTH, "optics": task.fabric.optics(), "name": task.fabric.name, **specification}
