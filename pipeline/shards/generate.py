"""One task of ground truth: which rows of which fabric, answered and written as one shard."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from pipeline import versions
from pipeline.fingerprint import fingerprint
from pipeline.shards.queries import QueryOptions, draw_queries
from pipeline.truth.options import TruthOptions
from weaves.fabric import Fabric

_CHUNK = 2048  # rows between two signs of progress; no row depends on it


class ShardTask(BaseModel):
    """Everything that a shard's numbers depend on, and the fabric's name."""

    model_config = ConfigDict(frozen=True, extra="forbid", use_attribute_docstrings=True)

    fabric: Fabric
    """The fabric asked about; its colours and source do not enter the numbers."""
    split: Literal["train", "validation", "test"]
    """Each split draws its own queries."""
    start: int = Field(ge=0)
    """First row of the split's stream."""
    rows: int = Field(gt=0)
    """Rows in this shard."""
    seed: int = Field(ge=0)
    """The data set's seed."""
    queries: QueryOptions = QueryOptions()
    """Distribution of the questions."""
    truth: TruthOptions = TruthOptions()
    """How they are answered."""

    def identity(self) -> dict[str, Any]:
        """Return what the numbers depend on, without names, sources and colours; versions included."""
        specification = self.model_dump(mode="json", exclude={"fabric"})
        return {"version": versions.TRUTH, "optics": self.fabric.optics(), "name": self.fabric.name, **specification}


def generate_shard(task: ShardTask, path: Path, progress: Callable[[float], None] = lambda fraction: None) -> None:
    """Answer a task's queries and write them to `path`; `progress` is told the share done."""
    # Imported here so that a plan can name tasks without loading compilers.
    from pipeline.shards.store import write_shard
    from pipeline.truth.estimator import estimate
    from pipeline.truth.query import Answers

    stream = [task.fabric.optics(), task.split, task.seed]
    queries = draw_queries(task.queries, task.fabric.weave.repeat, _seed("queries", stream), task.start, task.rows)
    seed = _seed("points", stream)
    parts = []
    for first in range(0, task.rows, _CHUNK):
        chunk = queries.take(slice(first, first + _CHUNK))
        parts.append(estimate(task.fabric, chunk, task.truth, seed, task.start + first))
        progress(min(1.0, (first + _CHUNK) / task.rows))
    answers = Answers(*(np.concatenate(columns) for columns in zip(*parts, strict=True)))
    write_shard(path, task.fabric.name, queries, answers, {"task": task.identity()})


def _seed(purpose: str, stream: list[Any]) -> int:
    """Return the 64-bit name of a stream of random numbers."""
    return int(fingerprint([purpose, *stream], 16), 16)
