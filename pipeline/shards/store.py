"""One shard on disk: Parquet with page checksums, written whole or not at all, the same bytes for the same rows.

Also what all files of rows share: how they are written, and that one which cannot be read is one sentence.
"""

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt
import pyarrow as pa
import pyarrow.parquet as pq

from pipeline.atomic import atomic_path
from pipeline.shards.queries import Kind
from pipeline.shards.schema import BOUNDS, SCHEMA_VERSION, SCHEMAS, STANDARD_ERRORS
from pipeline.storage import local_copy
from pipeline.truth.conventions import COMPONENTS
from pipeline.truth.query import Answers, Queries
from weaves.errors import BadInput
from weaves.reading import refuse_irregular

FACTS: Final = b"twillight"  # key of a file's metadata: its facts, as JSON

ROW_GROUP: Final = 16_384  # rows written at a time

_REMEDIES: Final = (
    ("does not exist", "generate it again with `twillight generate`"),
    "delete it and run `twillight generate`",
)

_STACKED: Final = {
    "wi": ("wi_x", "wi_y", "wi_z"),
    "wo": ("wo_x", "wo_y", "wo_z"),
    "mean": COMPONENTS,
    "standard_error": STANDARD_ERRORS,
    "bound": BOUNDS,
}
"""Columns of the fields of queries and answers that have several; the others are named as their columns."""

Columns = Mapping[str, npt.NDArray[Any]]
"""Columns of rows by name, all of one length; the fabric's name is none of them."""


def write_columns(path: Path, kind: Kind, fabric: str, columns: Columns, about: dict[str, Any]) -> None:
    """Write one shard, whole: all columns of its kind, the name of its fabric, and JSON-able facts `about` it."""
    schema = SCHEMAS[kind]
    rows = len(next(iter(columns.values())))
    names = pa.DictionaryArray.from_arrays(np.zeros(rows, np.int32), pa.array([fabric]))
    arrays = [names, *(pa.array(np.ascontiguousarray(columns[name])) for name in schema.names[1:])]
    facts = json.dumps({"schema_version": SCHEMA_VERSION, **about}, sort_keys=True).encode()
    table = pa.Table.from_arrays(arrays, schema=schema.with_metadata({FACTS: facts}))
    with atomic_path(path) as temporary, parquet_writer(temporary, table.schema, ["fabric"]) as writer:
        writer.write_table(table, ROW_GROUP)


def parquet_writer(path: Path, schema: pa.Schema, dictionaries: Sequence[str]) -> pq.ParquetWriter:
    """Return a writer with page checksums; columns of few different values are written as `dictionaries`."""
    return pq.ParquetWriter(
        path,
        schema,
        compression="zstd",
        use_dictionary=list(dictionaries),
        use_byte_stream_split=[field.name for field in schema if field.type in (pa.float32(), pa.float64())],
        write_page_checksum=True,
    )


def regrouped(tables: Iterable[pa.Table], rows: int) -> Iterator[pa.Table]:
    """Yield the rows of tables, so many at a time, the last of them fewer."""
    rest: pa.Table | None = None
    for table in tables:
        joined = table if rest is None else pa.concat_tables([rest, table])
        whole = joined.num_rows - joined.num_rows % rows
        for start in range(0, whole, rows):
            yield joined.slice(start, rows)
        rest = joined.slice(whole)
    if rest is not None and rest.num_rows:
        yield rest


@contextmanager
def readable(path: Path, missing: tuple[str, str], broken: str) -> Iterator[None]:
    """Turn what pyarrow says of a Parquet file that cannot be read into a BadInput.

    `missing` is what is said of a file that is not there, and what to do; `broken` what to do with a damaged one.
    """
    try:
        yield
    except FileNotFoundError as error:
        raise BadInput(str(path), "", *missing) from error
    except (pa.ArrowException, OSError) as error:
        reason = " ".join(str(error).split(". ")[0].split()).rstrip(".")
        raise BadInput(str(path), "", f"not a whole Parquet file ({reason})", broken) from error


def read_table(
    path: Path, kind: Kind = "components", names: Sequence[str] = (), groups: slice = slice(None)
) -> pa.Table:
    """Read a shard, or its columns `names` of some row groups, verified.

    BadInput if it is missing, damaged or of another kind.
    """
    schema = pa.schema([SCHEMAS[kind].field(name) for name in names]) if names else SCHEMAS[kind]
    refuse_irregular(path, "a shard")
    with readable(path, *_REMEDIES), local_copy(path) as copy:
        file = pq.ParquetFile(copy, page_checksum_verification=True)
        # Shards are small: threads within one cost more than they save.
        table = file.read_row_groups(range(file.num_row_groups)[groups], columns=list(names) or None, use_threads=False)
    if not table.schema.equals(schema, check_metadata=False):
        odd = sorted(set(table.schema.names) ^ set(schema.names))
        detail = f"columns {', '.join(odd)} differ" if odd else "column types differ"
        raise BadInput(str(path), "schema", detail, f"must be schema version {SCHEMA_VERSION} of {kind}")
    return table


def read_about(path: Path) -> dict[str, Any]:
    """Return the facts that a shard's metadata hold."""
    return dict(json.loads((pq.read_schema(path).metadata or {}).get(FACTS, b"{}")))


def numbers_of(table: pa.Table) -> dict[str, npt.NDArray[Any]]:
    """Return the columns of rows of one fabric, without its name."""
    return {name: table.column(name).to_numpy() for name in table.column_names if name != "fabric"}


def columns_of(*rows: Queries | Answers) -> dict[str, npt.NDArray[Any]]:
    """Return queries, answers or both by column."""
    columns: dict[str, npt.NDArray[Any]] = {}
    for field, values in (item for part in rows for item in part._asdict().items()):
        names = _STACKED.get(field)
        columns |= dict(zip(names, values.T, strict=True)) if names else {field: values}
    return columns


def rows_of(column: Columns) -> tuple[Queries, Answers]:
    """Return the queries and answers that columns hold: the inverse of `columns_of`."""
    return queries_of(column), Answers(*_fields(column, Answers._fields))


def queries_of(column: Columns) -> Queries:
    """Return the queries that columns hold."""
    return Queries(*_fields(column, Queries._fields))


def _fields(column: Columns, fields: Sequence[str]) -> Iterator[npt.NDArray[Any]]:
    for field in fields:
        names = _STACKED.get(field)
        yield np.stack([column[name] for name in names], axis=-1) if names else column[field]
