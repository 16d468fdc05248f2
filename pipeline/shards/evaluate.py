"""Any list of questions answered: Parquet in, the same rows with their answers out, in bounded memory.

Row i of the result is row i of the file, and its numbers depend on the seed and on i alone, not on how the file is cut
into row groups or chunks. Rows that have no answer stop everything before anything is computed, or, if they are to be
skipped, have null answers and are listed beside the result.
"""

from __future__ import annotations

import csv
import json
import time
from collections.abc import Callable
from contextlib import ExitStack
from itertools import pairwise
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt
import pyarrow as pa
import pyarrow.parquet as pq

from pipeline.atomic import atomic_path
from pipeline.fingerprint import file_sha256
from pipeline.shards.questions import (
    ANSWERS,
    OPTIONAL,
    ROW_GROUP,
    BadRow,
    blocks,
    check_columns,
    open_questions,
    questions_of,
    refuse_bad,
)
from pipeline.shards.schema import SCHEMA_VERSION
from pipeline.shards.version import VERSION
from pipeline.truth.estimator import estimate
from pipeline.truth.options import TruthOptions
from pipeline.truth.query import Answers, Queries
from weaves.errors import BadInput
from weaves.fabric import Fabric

CHUNK: Final = 2048
"""Rows between two signs of progress; no row depends on it."""

_KEY = b"twillight"


class Summary:
    """What was answered, gathered row by row in constant memory.

    Attributes
    ----------
    rows, bad : int
        Rows of the file, and how many of them have no answer.
    points : int
        Points evaluated.
    seconds : float
        Time that the answers took.
    """

    _EDGES = np.linspace(-8.0, 2.0, 5001)  # of log10: a median to 0.25 %

    def __init__(self) -> None:
        self.rows = self.bad = self.points = 0
        self.seconds = 0.0
        self._relative = np.zeros(len(self._EDGES) - 1, np.int64)

    def add(self, answers: Answers) -> None:
        """Count answered rows."""
        size, error = (np.linalg.norm(x, axis=1) for x in (answers.mean, answers.standard_error))
        relative = np.log10(np.maximum(error[size > 0] / size[size > 0], 1e-30))
        self._relative += np.histogram(np.clip(relative, -8.0, 2.0), self._EDGES)[0]
        self.points += int(answers.count.sum(dtype=np.int64))

    @property
    def median_relative_error(self) -> float:
        """Median of |standard errors| / |means| over rows that return light; NaN if there are none."""
        total = np.cumsum(self._relative)
        if not total[-1]:
            return float("nan")
        return float(10.0 ** self._EDGES[int(np.searchsorted(total, (total[-1] + 1) // 2))])


def evaluate_file(
    fabric: Fabric,
    queries: Path,
    out: Path,
    options: TruthOptions,
    seed: int,
    skip_bad: bool = False,
    chunk: int = CHUNK,
    progress: Callable[[float], None] = lambda fraction: None,
) -> Summary:
    """Answer every row of a Parquet file; the result appears whole or not at all.

    Parameters
    ----------
    fabric : Fabric
        What is asked about.
    queries : Path
        A file with `QUERY_COLUMNS` as float32 or float64, less any of `OPTIONAL`; other columns are carried along.
    out : Path
        The result: all columns of the file and the answers, named as in a shard.
    options : TruthOptions
        How they are answered.
    seed : int
        Name of the random numbers, 0 <= seed < 2^64.
    skip_bad : bool
        Leave the answers of bad rows null and list these in ``out`` with the suffix ``.bad.csv``.
    chunk : int
        Rows answered at a time.
    progress : callable
        Told the share done.

    Raises
    ------
    BadInput
        If a file or folder cannot be used, a column is missing, odd or named as an answer, or a row is bad.
    """
    if out.is_dir():
        raise BadInput("evaluate", "--out", str(out), "is a folder; the path of a file is needed")
    if out.exists() and queries.exists() and out.samefile(queries):
        raise BadInput("evaluate", "--out", str(out), "must not be the file of the queries")
    with open_questions(queries) as file, ExitStack() as stack:
        check_columns(queries, file.schema_arrow)
        if not skip_bad:
            refuse_bad(queries, file, fabric.weave.repeat)
        schema = _schema(file.schema_arrow, _about(fabric, queries, file.schema_arrow, options, seed), skip_bad)
        result = stack.enter_context(atomic_path(out))
        writer = stack.enter_context(_writer(result, schema))
        listing = None
        if skip_bad:
            path = stack.enter_context(atomic_path(bad_list(out)))
            listing = csv.writer(stack.enter_context(path.open("w", encoding="utf-8", newline="")))
            listing.writerow(BadRow._fields)
        summary = Summary()
        for block in blocks(queries, file):
            questions, bad = questions_of(block, summary.rows, fabric.weave.repeat)
            if listing:
                listing.writerows(bad)
            good = np.ones(len(questions.u), np.bool_)
            good[[row.row - summary.rows for row in bad]] = False
            answers = _answers(fabric, questions, good, options, seed, summary, chunk, file.metadata.num_rows, progress)
            writer.write_table(pa.table([*block.columns, *_arrays(answers, good)], schema=schema), ROW_GROUP)
        return summary


def bad_list(out: Path) -> Path:
    """Return the file that lists the bad rows of a result."""
    return out.with_suffix(".bad.csv")


def _answers(
    fabric: Fabric,
    questions: Queries,
    good: npt.NDArray[np.bool_],
    options: TruthOptions,
    seed: int,
    summary: Summary,
    chunk: int,
    total: int,
    progress: Callable[[float], None],
) -> Answers:
    """Answer the good rows of a block, in runs of neighbours that are no longer than a chunk."""
    rows = len(good)
    whole = Answers.opaque(np.zeros((rows, 4), np.float32), np.zeros((rows, 4), np.float32), np.zeros(rows, np.int32))
    cuts = {0, rows, *range(0, rows, chunk), *(np.flatnonzero(np.diff(good)) + 1).tolist()}
    edges = sorted(cuts)
    for start, stop in pairwise(edges):
        if good[start]:
            run = questions.take(slice(start, stop))
            if not summary.points:
                # Kernels are loaded and the fabric is tabulated outside the clock.
                estimate(fabric, run.take(slice(0, 1)), options, seed, summary.rows)
            begun = time.perf_counter()
            part = estimate(fabric, run, options, seed, summary.rows)
            summary.seconds += time.perf_counter() - begun
            summary.add(part)
            for column, values in zip(whole, part, strict=True):
                column[start:stop] = values
        summary.rows += stop - start
        summary.bad += 0 if good[start] else stop - start
        progress(summary.rows / total)
    return whole


def _about(fabric: Fabric, path: Path, schema: pa.Schema, options: TruthOptions, seed: int) -> dict[str, Any]:
    """Return what makes a result understood when it is read alone."""
    return {
        "schema_version": SCHEMA_VERSION,
        "version": VERSION,
        "fabric": fabric.model_dump(mode="json"),
        "truth": options.model_dump(mode="json"),
        "seed": seed,
        "queries": path.name,
        "queries_sha256": file_sha256(path),
        "left_out": {name: value for name, value in OPTIONAL.items() if name not in schema.names},
    }


def _schema(carried: pa.Schema, about: dict[str, Any], nullable: bool) -> pa.Schema:
    answers = [field.with_nullable(nullable) for field in ANSWERS]
    facts = {_KEY: json.dumps(about, sort_keys=True).encode()}
    return pa.schema([*carried, *answers]).with_metadata((carried.metadata or {}) | facts)


def _writer(path: Path, schema: pa.Schema) -> pq.ParquetWriter:
    floats = [field.name for field in schema if field.type in (pa.float32(), pa.float64())]
    return pq.ParquetWriter(
        path,
        schema,
        compression="zstd",
        use_dictionary=[field.name for field in schema if field.name not in floats],
        use_byte_stream_split=floats,
        write_page_checksum=True,
    )


def _arrays(answers: Answers, good: npt.NDArray[np.bool_]) -> list[pa.Array]:
    columns = [*answers.mean.T, *answers.standard_error.T]
    columns += [answers.transparency, answers.transparency_standard_error, answers.count]
    mask = None if good.all() else ~good
    return [pa.array(np.ascontiguousarray(column), mask=mask) for column in columns]
