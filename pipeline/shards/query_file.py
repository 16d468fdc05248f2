"""Files of a user's queries: read in blocks of bounded size; each fault is one sentence."""

from collections import Counter
from collections.abc import Callable, Collection, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt
import pyarrow as pa
import pyarrow.parquet as pq

from pipeline.shards.schema import QUERY_COLUMNS, SCHEMA
from pipeline.shards.store import ROW_GROUP, queries_of, readable, regrouped
from pipeline.storage import local_copy
from pipeline.truth.query import Queries, faults
from weaves.errors import BadInput
from weaves.reading import refuse_irregular

OPTIONAL: Final = {"sigma_minor": "sigma", "angle": 0.0, "curvature": 0.0}
"""Columns that may be left out, and what is taken then: another column, or a number."""
ANSWERS: Final = [field for field in SCHEMA if field.name not in ("fabric", *QUERY_COLUMNS)]  # the columns of an answer

_REMEDIES = ("no such file", "the path of a Parquet file is needed"), "one that can be read is needed"
_BUFFER = 1 << 20  # bytes of a column read at a time, so that one huge row group is not held whole


class BadRow(NamedTuple):
    """A row that has no answer: its index in the file, the column, the value there, and what is wrong with it."""

    row: int
    column: str
    value: object
    reason: str


@contextmanager
def open_queries(path: Path) -> Iterator[pq.ParquetFile]:
    """Open a Parquet file whose pages are verified as they are read; BadInput if it is missing, cut short, or none."""
    refuse_irregular(path, "a Parquet file")
    with ExitStack() as stack:
        with readable(path, *_REMEDIES):
            here = stack.enter_context(local_copy(path))
            file = pq.ParquetFile(here, page_checksum_verification=True, buffer_size=_BUFFER)
        about = file.metadata
        if about.num_rows != (rows := sum(about.row_group(i).num_rows for i in range(about.num_row_groups))):
            raise BadInput(str(path), "rows in the footer", about.num_rows, f"its row groups have {rows:,}")
        yield stack.enter_context(file)


def blocks(path: Path, file: pq.ParquetFile, columns: list[str] | None = None) -> Iterator[pa.Table]:
    """Yield the rows in blocks of `ROW_GROUP`, however the file is cut."""
    batches = (pa.Table.from_batches([batch]) for batch in file.iter_batches(ROW_GROUP, columns=columns))
    joined = regrouped(batches, ROW_GROUP)
    while True:
        with readable(path, *_REMEDIES):
            block = next(joined, None)
        if block is None:
            return
        yield block.combine_chunks()


def check_columns(path: Path, schema: pa.Schema, answers: Collection[str]) -> None:
    """Refuse columns that are missing, of another type, there twice, or named as one of the answers."""
    where, names = str(path), Counter(schema.names)
    if missing := [name for name in QUERY_COLUMNS if name not in names and name not in OPTIONAL]:
        found = f"column{'s' if len(missing) > 1 else ''} {', '.join(missing)} missing"
        needed = ", ".join(name for name in QUERY_COLUMNS if name not in OPTIONAL)
        raise BadInput(where, "", found, f"needed are {needed}; {', '.join(OPTIONAL)} may be left out")
    for name, times in names.items():
        if times > 1:
            raise BadInput(where, "column", name, "is there more than once")
        if name in answers:
            raise BadInput(where, "column", name, "has the name of an answer: rename it or leave it out")
        kind = schema.field(name).type
        if name in QUERY_COLUMNS and kind not in (pa.float32(), pa.float64()):
            raise BadInput(where, f"type of column {name}", str(kind), "must be float (32 bits) or double (64 bits)")


Faults = dict[int, tuple[str, object, str]]  # faults of queries: row -> (column, value, what is allowed)
FindFaults = Callable[[Queries], Faults]


def refuse_bad(path: Path, file: pq.ParquetFile, repeat: tuple[int, int], find: FindFaults = faults) -> None:
    """Read all queries once and refuse the file if any has no answer, by the first and the number of the others."""
    asked = [name for name in QUERY_COLUMNS if name in file.schema_arrow.names]
    first, count, start = None, 0, 0
    for block in blocks(path, file, asked):
        _, bad = checked_queries(block, repeat, find)
        if bad and first is None:
            row = min(bad)
            first = next(bad_rows(block, start, {row: bad[row]}))
        count += len(bad)
        start += len(block)
    if first:
        more = f"{count - 1:,} more bad row{'s' if count > 2 else ''}; " if count > 1 else ""
        allowed = f"{first.reason} ({more}--skip-bad answers the others)"
        raise BadInput(str(path), f"row {first.row}, column {first.column}", first.value, allowed)


def checked_queries(block: pa.Table, repeat: tuple[int, int], find: FindFaults = faults) -> tuple[Queries, Faults]:
    """Return a block's queries in single precision and their faults."""
    given = {name: block[name].to_numpy() for name in QUERY_COLUMNS if name in block.column_names}
    single: dict[str, npt.NDArray[np.float32]] = {}
    for name in QUERY_COLUMNS:
        default = OPTIONAL.get(name, 0.0)
        column = given.get(name, single["sigma"] if default == "sigma" else np.full(len(block), default))
        with np.errstate(over="ignore", under="ignore"):
            single[name] = column.astype(np.float32)
        if name in ("u", "v"):
            # A place far off would lose its digits: fold it into the repeat first.
            far = np.isfinite(column) & (single[name] != column)
            single[name][far] = np.fmod(column[far], repeat[name == "v"]).astype(np.float32)
    batch = queries_of(single)
    return batch, find(batch)


def bad_rows(block: pa.Table, start: int, found: Faults) -> Iterator[BadRow]:
    """Yield the faults of a block, from row `start` of the file on, by the file's own columns and values."""
    axes = {name: [f"{name}_{axis}" for axis in "xyz"] if name in ("wi", "wo") else [name] for name in Queries._fields}
    named = {name: {c: block[c].to_pylist() for c in axes[name]} for name in {name for name, _, _ in found.values()}}
    for row, (name, _, allowed) in sorted(found.items()):
        values = {column: of[row] for column, of in named[name].items()}
        empty = [column for column, value in values.items() if value is None]
        if empty:
            yield BadRow(start + row, empty[0], None, "must not be null")
        elif len(values) > 1:
            yield BadRow(start + row, f"{name}_x..z", list(values.values()), allowed)
        else:
            value = float(values[name])
            with np.errstate(over="ignore", under="ignore"):
                rounded = np.float32(value)
            lost = np.isfinite(value) and value != 0 and (rounded == 0 or not np.isfinite(rounded))
            yield BadRow(start + row, name, value, allowed + (" in single precision" if lost else ""))
