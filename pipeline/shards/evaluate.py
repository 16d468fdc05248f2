"""Answers to a file of queries: Parquet in, the same rows with their answers out, in bounded memory.

Row i of the result is row i of the file, and the truth's numbers depend on the seed and on i alone, not on how the file
is cut into row groups or chunks, nor on how many threads answer these. Rows that have no answer stop everything before
anything is computed, or, if they are to be skipped, have null answers and are listed beside the result.
"""

from __future__ import annotations

import csv
import json
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Executor, ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from itertools import pairwise
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt
import pyarrow as pa
import pyarrow.parquet as pq

from pipeline import versions
from pipeline.atomic import atomic_path
from pipeline.fingerprint import file_sha256
from pipeline.shards.query_file import (
    ANSWERS,
    OPTIONAL,
    ROW_GROUP,
    BadRow,
    Faults,
    blocks,
    check_columns,
    checked_queries,
    open_queries,
    refuse_bad,
)
from pipeline.shards.schema import SCHEMA_VERSION
from pipeline.truth.estimator import estimate
from pipeline.truth.options import TruthOptions
from pipeline.truth.query import Answers, Queries, faults
from weaves.errors import BadInput
from weaves.fabric import Fabric

CHUNK: Final = 2048
"""Rows that a thread answers at a time, at most; no row depends on it."""

_KEY = b"twillight"


class Answerer(NamedTuple):
    """A method that answers queries about a fabric in place of the ground truth, without standard errors.

    Attributes
    ----------
    answer : callable
        Takes queries, returns components (N, 4) and transparency (N,), float32. BadInput if it cannot.
    about : dict
        What the result's metadata says of it.
    faults : callable
        Faults of queries that it cannot answer, in addition to those that have no answer at all.
    """

    answer: Callable[[Queries], tuple[npt.NDArray[np.float32], npt.NDArray[np.float32]]]
    about: dict[str, Any]
    faults: Faults = lambda queries: {}


class Summary:
    """Statistics of the results, collected row by row in constant memory.

    Attributes
    ----------
    rows, bad : int
        Rows of the file, and how many of them have no answer.
    points : int
        Points evaluated.
    seconds : float
        Time that the answers took, on all threads together.
    """

    _EDGES = np.linspace(-8.0, 2.0, 5001)  # of log10: a median to 0.25 %

    def __init__(self) -> None:
        self.rows = self.bad = self.points = 0
        self.seconds = 0.0
        self._relative = np.zeros(len(self._EDGES) - 1, np.int64)

    def add(self, answers: Answers) -> None:
        """Count answered rows."""
        size, error = (np.linalg.norm(x, axis=1) for x in (answers.mean, answers.standard_error))
        known = (size > 0) & (error > 0)  # a model states no errors
        relative = np.log10(np.maximum(error[known] / size[known], 1e-30))
        self._relative += np.histogram(np.clip(relative, -8.0, 2.0), self._EDGES)[0]
        self.points += int(answers.count.sum(dtype=np.int64))

    @property
    def median_relative_error(self) -> float:
        """Median of |standard errors| / |means| over rows that return light and state errors; NaN if there are none."""
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
    threads: int = 1,
    progress: Callable[[float], None] = lambda fraction: None,
    other: Answerer | None = None,
) -> Summary:
    """Answer every row of a Parquet file; the result appears whole or not at all.

    Parameters
    ----------
    fabric : Fabric
        The cloth.
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
        Rows that a thread answers at a time.
    threads : int
        Threads that answer; kernels run without the interpreter's lock.
    progress : callable
        Receives the finished share.
    other : Answerer, optional
        Who answers in place of the ground truth. Errors are then null; `options` and `seed` mean nothing.

    Raises
    ------
    BadInput
        If a file or folder cannot be used, a column is missing, odd or named as an answer, or a row is bad.
    """
    if out.is_dir():
        raise BadInput("evaluate", "--out", str(out), "is a folder; the path of a file is needed")
    if out.exists() and queries.exists() and out.samefile(queries):
        raise BadInput("evaluate", "--out", str(out), "must not be the file of the queries")

    def wrong(batch: Queries) -> dict[int, tuple[str, object, str]]:
        found = faults(batch)
        return (other.faults(batch) | found) if other else found

    with open_queries(queries) as file, ExitStack() as stack:
        check_columns(queries, file.schema_arrow)
        if not skip_bad:
            refuse_bad(queries, file, fabric.weave.repeat, wrong)
        about = _about(fabric, queries, file.schema_arrow, options, seed, other)
        schema = _schema(file.schema_arrow, about, skip_bad or other is not None)
        result = stack.enter_context(atomic_path(out))
        writer = stack.enter_context(_writer(result, schema))
        listing = None
        if skip_bad:
            path = stack.enter_context(atomic_path(bad_list(out)))
            listing = csv.writer(stack.enter_context(path.open("w", encoding="utf-8", newline="")))
            listing.writerow(BadRow._fields)
        summary = Summary()
        crew = _Crew(fabric, options, seed, stack.enter_context(_threads(threads)), other)
        for block in blocks(queries, file):
            batch, bad = checked_queries(block, summary.rows, fabric.weave.repeat, wrong)
            if listing:
                listing.writerows(bad)
            good = np.ones(len(batch.u), np.bool_)
            good[[row.row - summary.rows for row in bad]] = False
            answers = _answers(crew, batch, good, summary, chunk, file.metadata.num_rows, progress)
            writer.write_table(
                pa.table([*block.columns, *_arrays(answers, good, other is None)], schema=schema), ROW_GROUP
            )
        return summary


def bad_list(out: Path) -> Path:
    """Return the file that lists the bad rows of a result."""
    return out.with_suffix(".bad.csv")


class _Crew:
    """Threads that answer queries about one fabric."""

    def __init__(
        self, fabric: Fabric, options: TruthOptions, seed: int, pool: Executor, other: Answerer | None
    ) -> None:
        self.fabric, self.options, self.seed, self.pool, self.other = fabric, options, seed, pool, other
        self._met: set[tuple[bool, bool]] = set()

    def prepare(self, batch: Queries) -> None:
        """Load kernels and tabulate the sides of the fabric that queries need, before threads start."""
        if self.other:
            return
        sides = np.stack([batch.wi[:, 2] < 0, batch.wo[:, 2] < 0], axis=1)
        for row in np.unique(sides, axis=0, return_index=True)[1].tolist():
            key = bool(sides[row, 0]), bool(sides[row, 1])
            if key not in self._met:
                self._met.add(key)
                # A wide footprint and a narrow one, for they may use different tables.
                wi, wo = (np.repeat(w[row : row + 1], 2, axis=0) for w in (batch.wi, batch.wo))
                centre, widths = np.zeros(2, np.float32), np.array([1.0, 0.1], np.float32)
                estimate(self.fabric, Queries.round(centre, centre, widths, wi, wo), self.options, self.seed, 0)

    def answers(self, runs: Iterable[tuple[Queries, int]]) -> Iterator[Answers]:
        """Answer runs of queries, each with the place of its first row in the file; in their order."""
        return self.pool.map(self._answer, runs)

    def _answer(self, run: tuple[Queries, int]) -> Answers:
        batch, first = run
        if self.other is None:
            return estimate(self.fabric, batch, self.options, self.seed, first)
        mean, transparency = self.other.answer(batch)
        nothing = np.zeros_like(mean)
        return Answers.opaque(mean, nothing, np.zeros(len(mean), np.int32))._replace(transparency=transparency)


@contextmanager
def _threads(count: int) -> Iterator[Executor]:
    """Hold a pool of threads; what is stopped early begins nothing more."""
    pool = ThreadPoolExecutor(count)
    try:
        yield pool
    finally:
        pool.shutdown(cancel_futures=True)


def _answers(
    crew: _Crew,
    batch: Queries,
    good: npt.NDArray[np.bool_],
    summary: Summary,
    chunk: int,
    total: int,
    progress: Callable[[float], None],
) -> Answers:
    """Answer the good rows of a block, in runs of neighbours that are no longer than a chunk."""
    rows, first = len(good), summary.rows
    whole = Answers.opaque(np.zeros((rows, 4), np.float32), np.zeros((rows, 4), np.float32), np.zeros(rows, np.int32))
    cuts = {0, rows, *range(0, rows, chunk), *(np.flatnonzero(np.diff(good)) + 1).tolist()}
    edges = list(pairwise(sorted(cuts)))
    # Kernels are loaded and the fabric is tabulated outside the clock.
    crew.prepare(batch.take(good))
    begun = time.perf_counter()
    parts = crew.answers((batch.take(slice(start, stop)), first + start) for start, stop in edges if good[start])
    for start, stop in edges:
        if good[start]:
            part = next(parts)
            summary.add(part)
            for column, values in zip(whole, part, strict=True):
                column[start:stop] = values
        summary.rows += stop - start
        summary.bad += 0 if good[start] else stop - start
        progress(summary.rows / total)
    summary.seconds += time.perf_counter() - begun
    return whole


def _about(
    fabric: Fabric, path: Path, schema: pa.Schema, options: TruthOptions, seed: int, other: Answerer | None
) -> dict[str, Any]:
    """Return what makes a result understood when it is read alone."""
    truth = {"version": versions.TRUTH, "truth": options.model_dump(mode="json"), "seed": seed}
    return {
        "schema_version": SCHEMA_VERSION,
        "fabric": fabric.model_dump(mode="json"),
        **(truth if other is None else other.about),
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


def _arrays(answers: Answers, good: npt.NDArray[np.bool_], errors_known: bool) -> list[pa.Array]:
    values, errors = [*answers.mean.T], [*answers.standard_error.T, *answers.bound.T]
    mask = None if good.all() else ~good
    unknown = mask if errors_known else np.ones(len(good), np.bool_)
    columns = [(column, mask) for column in values] + [(column, unknown) for column in errors]
    columns += [(answers.transparency, mask), (answers.transparency_standard_error, unknown)]
    columns += [(answers.transparency_bound, unknown), (answers.count, mask)]
    return [pa.array(np.ascontiguousarray(column), mask=hidden) for column, hidden in columns]
