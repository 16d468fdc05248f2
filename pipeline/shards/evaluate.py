"""Answers to a file of queries: Parquet in, the same rows with their answers out, in bounded memory.

Row i of the result is row i of the file, and the truth's numbers depend on the seed and on i alone, not on how the file
is cut into row groups or chunks, nor on how many threads answer these. Rows that have no answer stop everything before
anything is computed, or, if they are to be skipped, have null answers and are listed beside the result.
"""

import csv
import json
import time
from collections.abc import Callable
from concurrent.futures import Executor, ThreadPoolExecutor
from contextlib import ExitStack
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
import pyarrow as pa

from pipeline import versions
from pipeline.atomic import atomic_path
from pipeline.compiled.arrays import Mask
from pipeline.fingerprint import file_sha256
from pipeline.shards import query_file
from pipeline.shards.entry_files import RGB_COLUMNS
from pipeline.shards.schema import SCHEMA_VERSION
from pipeline.shards.store import FACTS, ROW_GROUP, columns_of, parquet_writer
from pipeline.truth.estimator import estimate
from pipeline.truth.options import TruthOptions
from pipeline.truth.query import Answers, Queries, faults
from weaves.errors import BadInput
from weaves.fabric import Fabric

CHUNK: Final = 2048  # rows that a thread answers at a time, at most; no row depends on it


class Answerer(NamedTuple):
    """A source of answers about a fabric: the ground truth, or a method."""

    answer: Callable[[Queries, int], Answers]
    """Takes queries and the place of the first in the file. BadInput if it cannot answer."""
    about: dict[str, Any]  # facts of it for the result's metadata
    faults: query_file.FindFaults = faults  # faults of queries that it cannot answer
    prepare: Callable[[Queries], None] = lambda queries: None
    """Takes the queries of a block before threads begin with them."""
    errors: bool = False  # true if it states errors; else their columns are null
    rgb: bool = False  # true if its answers are red, green, blue and 0 in place of components


def truth_answerer(fabric: Fabric, options: TruthOptions, seed: int) -> Answerer:
    """Return the ground truth; `seed` names its random numbers, 0 <= seed < 2^64."""
    met: set[tuple[bool, ...]] = set()

    def prepare(queries: Queries) -> None:
        """Load kernels and tabulate the sides of the fabric that queries need."""
        behind = np.stack([queries.wi[:, 2] < 0, queries.wo[:, 2] < 0], axis=1)
        for sides in map(tuple, np.unique(behind, axis=0).tolist()):
            if sides not in met:
                met.add(sides)
                # A wide footprint and a narrow one, for they may use different tables; seen from straight above or
                # beneath, where every table knows it.
                wi, wo = (np.array([[0.0, 0.0, -1.0 if back else 1.0]] * 2, np.float32) for back in sides)
                centre, widths = np.zeros(2, np.float32), np.array([1.0, 0.12], np.float32)
                estimate(fabric, Queries.round(centre, centre, widths, wi, wo), options, seed, 0)

    def answer(queries: Queries, first: int) -> Answers:
        return estimate(fabric, queries, options, seed, first)

    about = {"version": versions.TRUTH, "truth": options.model_dump(mode="json"), "seed": seed}
    return Answerer(answer, about, partial(faults, parallax=options.parallax), prepare, errors=True)


class Summary:
    """Statistics in constant memory: `rows`, `bad` ones among them, `points` evaluated in `seconds` of all threads."""

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
    answerer: Answerer,
    skip_bad: bool = False,
    threads: int = 1,
    progress: Callable[[float], None] = lambda fraction: None,
) -> Summary:
    """Answer every row of a Parquet file; the result appears whole or not at all.

    The file of `queries` has `QUERY_COLUMNS` as float32 or float64, less any of `OPTIONAL`; its other columns are
    carried along. `out` gets all of them and the answers, named as in a shard; or red, green and blue. `skip_bad`
    leaves the answers of bad rows null and lists these beside it (`bad_list`). `progress` receives the finished share.

    BadInput if a file or folder cannot be used, a column is missing, odd or named as an answer, or a row is bad.
    """
    if out.is_dir():
        raise BadInput("evaluate", "--out", str(out), "is a folder; the path of a file is needed")
    if out.exists() and queries.exists() and out.samefile(queries):
        raise BadInput("evaluate", "--out", str(out), "must not be the file of the queries")
    with query_file.open_queries(queries) as file, ExitStack() as stack:
        carried, total, repeat = file.schema_arrow, file.metadata.num_rows, fabric.weave.repeat
        fields = query_file.ANSWERS
        if answerer.rgb:
            fields = [pa.field(name, pa.float32()) for name in RGB_COLUMNS]
        query_file.check_columns(queries, carried, [field.name for field in fields])
        if not skip_bad:
            query_file.refuse_bad(queries, file, repeat, answerer.faults)
        about = {
            "schema_version": SCHEMA_VERSION,
            "fabric": fabric.model_dump(mode="json"),
            **answerer.about,
            "queries": queries.name,
            "queries_sha256": file_sha256(queries),
            "left_out": {name: value for name, value in query_file.OPTIONAL.items() if name not in carried.names},
        }
        fields = [field.with_nullable(skip_bad or not answerer.errors) for field in fields]
        facts = {FACTS: json.dumps(about, sort_keys=True).encode()}
        schema = pa.schema([*carried, *fields]).with_metadata((carried.metadata or {}) | facts)
        result = stack.enter_context(atomic_path(out))
        encoded = [field.name for field in schema if field.type not in (pa.float32(), pa.float64())]
        writer = stack.enter_context(parquet_writer(result, schema, encoded))
        listing = None
        if skip_bad:
            path = stack.enter_context(atomic_path(bad_list(out)))
            listing = csv.writer(stack.enter_context(path.open("w", encoding="utf-8", newline="")))
            listing.writerow(query_file.BadRow._fields)
        summary, pool = Summary(), ThreadPoolExecutor(threads)
        stack.callback(pool.shutdown, cancel_futures=True)  # what is stopped early begins nothing more
        for block in query_file.blocks(queries, file):
            batch, bad = query_file.checked_queries(block, repeat, answerer.faults)
            if listing:
                listing.writerows(query_file.bad_rows(block, summary.rows, bad))
            good = np.ones(len(batch.u), np.bool_)
            good[list(bad)] = False
            answers = _answers(pool, answerer, batch, good, summary, lambda rows: progress(rows / total))
            columns = [*block.columns, *_arrays(batch, answers, good, answerer)]
            writer.write_table(pa.table(columns, schema=schema), ROW_GROUP)
        return summary


def bad_list(out: Path) -> Path:
    """Return the file that lists the bad rows of a result."""
    return out.with_suffix(".bad.csv")


def _answers(
    pool: Executor, answerer: Answerer, batch: Queries, good: Mask, summary: Summary, progress: Callable[[int], None]
) -> Answers:
    """Answer the good rows of a block, in runs of neighbours that are no longer than a chunk."""
    rows, before = len(good), summary.rows
    whole = Answers.opaque(np.zeros((rows, 4), np.float32), np.zeros((rows, 4), np.float32), np.zeros(rows, np.int32))
    cuts = {0, rows, *range(0, rows, CHUNK), *(np.flatnonzero(np.diff(good)) + 1).tolist()}
    runs = [slice(start, stop) for start, stop in pairwise(sorted(cuts)) if good[start]]
    # Kernels are loaded and the fabric is tabulated outside the clock.
    answerer.prepare(batch.take(good))
    begun = time.perf_counter()
    parts = pool.map(lambda run: answerer.answer(batch.take(run), before + run.start), runs)
    for run, part in zip(runs, parts, strict=True):
        summary.add(part)
        for column, values in zip(whole, part, strict=True):
            column[run] = values
        progress(before + run.stop)
    summary.rows += rows
    summary.bad += rows - int(good.sum())
    progress(summary.rows)
    summary.seconds += time.perf_counter() - begun
    return whole


def _arrays(batch: Queries, answers: Answers, good: Mask, answerer: Answerer) -> list[pa.Array]:
    """Return the columns of answers; those of bad rows are null, and errors that are not stated."""
    columns = columns_of(batch, answers)
    hidden = None if good.all() else ~good
    if answerer.rgb:
        return [pa.array(np.ascontiguousarray(answers.mean[:, i]), mask=hidden) for i in range(len(RGB_COLUMNS))]
    unstated = hidden if answerer.errors else np.ones(len(good), np.bool_)
    names = [field.name for field in query_file.ANSWERS]
    masks = {name: unstated if name.endswith(("_error", "_bound")) else hidden for name in names}
    return [pa.array(np.ascontiguousarray(columns[name]), mask=mask) for name, mask in masks.items()]
