"""One shard on disk: Parquet with page checksums, written whole or not at all, the same bytes for the same rows."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pyarrow as pa
import pyarrow.parquet as pq

from pipeline.atomic import atomic_path
from pipeline.shards.extra_rows import Kind
from pipeline.shards.schema import BOUNDS, SCHEMA_VERSION, SCHEMAS, STANDARD_ERRORS
from pipeline.storage import local_copy
from pipeline.truth.conventions import COMPONENTS, TRANSPARENCY
from pipeline.truth.query import Answers, Queries
from weaves.errors import BadInput
from weaves.reading import refuse_irregular

_KEY = b"twillight"
_ROW_GROUP = 16_384

Columns = Mapping[str, npt.NDArray[Any]]
"""Columns of rows by name, all of one length; the fabric's name is none of them."""


def write_shard(path: Path, fabric: str, queries: Queries, answers: Answers, about: dict[str, Any]) -> None:
    """Write N queries with their answers as a shard of kind `components`; parameters as for `write_columns`."""
    write_columns(path, "components", fabric, columns_of(queries, answers), about)


def write_columns(path: Path, kind: Kind, fabric: str, columns: Columns, about: dict[str, Any]) -> None:
    """Write one shard.

    Parameters
    ----------
    path : Path
        The file; it appears whole.
    kind : Kind
        Kind of the rows, a key of `SCHEMAS`.
    fabric : str
        Name of the fabric of every row.
    columns : mapping
        All columns of the kind but `fabric`, N values each.
    about : dict
        JSON-able facts of the file: the task that made it, options, versions.
    """
    schema = SCHEMAS[kind]
    rows = len(next(iter(columns.values())))
    names = pa.DictionaryArray.from_arrays(np.zeros(rows, np.int32), pa.array([fabric]))
    arrays = [names, *(pa.array(np.ascontiguousarray(columns[name])) for name in schema.names[1:])]
    facts = json.dumps({"schema_version": SCHEMA_VERSION, **about}, sort_keys=True).encode()
    table = pa.Table.from_arrays(arrays, schema=schema.with_metadata({_KEY: facts}))
    with atomic_path(path) as temporary:
        pq.write_table(
            table,
            temporary,
            row_group_size=_ROW_GROUP,
            compression="zstd",
            use_dictionary=["fabric"],
            use_byte_stream_split=[field.name for field in schema if field.type == pa.float32()],
            write_page_checksum=True,
        )


def read_table(path: Path, kind: Kind = "components", names: Sequence[str] = ()) -> pa.Table:
    """Read a shard of a kind, or only some of its columns by their `names`, with checksums verified.

    Raises
    ------
    BadInput
        If the file is missing, cut short, damaged, or not a shard of this kind and schema.
    """
    schema = pa.schema([SCHEMAS[kind].field(name) for name in names]) if names else SCHEMAS[kind]
    refuse_irregular(path, "a shard")
    try:
        with local_copy(path) as file:
            # Shards are small: threads within one cost more than they save.
            table = pq.read_table(
                file, columns=list(names) or None, page_checksum_verification=True, memory_map=False, use_threads=False
            )
    except FileNotFoundError as error:
        raise BadInput(str(path), "", "does not exist", "generate it again with `twillight generate`") from error
    except (pa.ArrowException, OSError) as error:
        reason = str(error).splitlines()[0].rstrip(".")
        raise BadInput(
            str(path), "", f"not a whole Parquet file ({reason})", "delete it and run `twillight generate`"
        ) from error
    if not table.schema.equals(schema, check_metadata=False):
        odd = sorted(set(table.schema.names) ^ set(schema.names))
        detail = f"columns {', '.join(odd)} differ" if odd else "column types differ"
        raise BadInput(str(path), "schema", detail, f"must be schema version {SCHEMA_VERSION} of {kind}")
    return table


def read_about(path: Path) -> dict[str, Any]:
    """Return the facts that a shard's metadata hold."""
    metadata = pq.read_schema(path).metadata or {}
    facts: dict[str, Any] = json.loads(metadata.get(_KEY, b"{}"))
    return facts


def read_columns(path: Path, kind: Kind) -> dict[str, npt.NDArray[Any]]:
    """Read a shard's columns but the fabric with their checksums verified; errors as `read_table`."""
    table = read_table(path, kind)
    return {name: table.column(name).to_numpy() for name in SCHEMAS[kind].names[1:]}


def read_shard(path: Path) -> tuple[Queries, Answers]:
    """Read a shard of kind `components`; errors as `read_table`."""
    return rows_of(read_columns(path, "components"))


def columns_of(queries: Queries, answers: Answers) -> dict[str, npt.NDArray[Any]]:
    """Return queries and answers by column."""
    axes = [("wi_x", "wi_y", "wi_z"), ("wo_x", "wo_y", "wo_z"), COMPONENTS, STANDARD_ERRORS, BOUNDS]
    stacked = queries.wi, queries.wo, answers.mean, answers.standard_error, answers.bound
    columns: dict[str, npt.NDArray[Any]] = {"u": queries.u, "v": queries.v, "sigma": queries.sigma}
    for names, values in zip(axes, stacked, strict=True):
        columns |= dict(zip(names, values.T, strict=True))
    columns |= {"sigma_minor": queries.sigma_minor, "angle": queries.angle, "curvature": queries.curvature}
    columns |= {TRANSPARENCY: answers.transparency, "count": answers.count}
    columns |= {f"{TRANSPARENCY}_standard_error": answers.transparency_standard_error}
    return columns | {f"{TRANSPARENCY}_bound": answers.transparency_bound}


def rows_of(column: Columns) -> tuple[Queries, Answers]:
    """Return the queries and answers that columns hold: the inverse of `columns_of`."""
    mean, error, bound = (
        np.stack([column[name] for name in names], axis=-1) for names in (COMPONENTS, STANDARD_ERRORS, BOUNDS)
    )
    through = (column[TRANSPARENCY + suffix] for suffix in ("", "_standard_error", "_bound"))
    return queries_of(column), Answers(mean, error, bound, column["count"], *through)


def queries_of(column: Mapping[str, npt.NDArray[np.float32]]) -> Queries:
    """Return the queries that columns hold."""
    return Queries(
        column["u"],
        column["v"],
        column["sigma"],
        np.stack([column["wi_x"], column["wi_y"], column["wi_z"]], axis=-1),
        np.stack([column["wo_x"], column["wo_y"], column["wo_z"]], axis=-1),
        column["sigma_minor"],
        column["angle"],
        column["curvature"],
    )
