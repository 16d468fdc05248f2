"""One shard on disk: Parquet with page checksums, written whole or not at all, the same bytes for the same rows."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pyarrow as pa
import pyarrow.parquet as pq

from pipeline.atomic import atomic_path
from pipeline.shards.schema import SCHEMA, SCHEMA_VERSION, STANDARD_ERRORS
from pipeline.truth.conventions import COMPONENTS, TRANSPARENCY
from pipeline.truth.query import Answers, Queries
from weaves.errors import BadInput

_KEY = b"twillight"
_ROW_GROUP = 16_384
_FLOATS = [field.name for field in SCHEMA if field.type == pa.float32()]


def write_shard(path: Path, fabric: str, queries: Queries, answers: Answers, about: dict[str, Any]) -> None:
    """Write one shard.

    Parameters
    ----------
    path : Path
        The file; it appears whole.
    fabric : str
        Name of the fabric of every row.
    queries, answers : Queries, Answers
        N rows.
    about : dict
        JSON-able facts of the file: the task that made it, options, versions.
    """
    names = pa.DictionaryArray.from_arrays(np.zeros(len(queries.u), np.int32), pa.array([fabric]))
    columns = [queries.u, queries.v, queries.sigma, *queries.wi.T, *queries.wo.T]
    columns += [queries.sigma_minor, queries.angle, queries.curvature]
    columns += [*answers.mean.T, *answers.standard_error.T]
    columns += [answers.transparency, answers.transparency_standard_error, answers.count]
    arrays = [names, *(pa.array(np.ascontiguousarray(column)) for column in columns)]
    facts = json.dumps({"schema_version": SCHEMA_VERSION, **about}, sort_keys=True).encode()
    table = pa.Table.from_arrays(arrays, schema=SCHEMA.with_metadata({_KEY: facts}))
    with atomic_path(path) as temporary:
        pq.write_table(
            table,
            temporary,
            row_group_size=_ROW_GROUP,
            compression="zstd",
            use_dictionary=["fabric"],
            use_byte_stream_split=_FLOATS,
            write_page_checksum=True,
        )


def read_table(path: Path) -> pa.Table:
    """Read a shard with its checksums verified.

    Raises
    ------
    BadInput
        If the file is missing, cut short, damaged, or not a shard of this schema.
    """
    try:
        table = pq.read_table(path, page_checksum_verification=True, memory_map=False)
    except FileNotFoundError as error:
        raise BadInput(str(path), "", "does not exist", "generate it again with `twillight generate`") from error
    except (pa.ArrowException, OSError) as error:
        reason = str(error).splitlines()[0].rstrip(".")
        raise BadInput(
            str(path), "", f"not a whole Parquet file ({reason})", "delete it and run `twillight generate`"
        ) from error
    if not table.schema.equals(SCHEMA, check_metadata=False):
        odd = sorted(set(table.schema.names) ^ set(SCHEMA.names))
        detail = f"columns {', '.join(odd)} differ" if odd else "column types differ"
        raise BadInput(str(path), "schema", detail, f"must be schema version {SCHEMA_VERSION}")
    return table


def read_about(path: Path) -> dict[str, Any]:
    """Return the facts that `write_shard` stored in a shard's metadata."""
    metadata = pq.read_schema(path).metadata or {}
    facts: dict[str, Any] = json.loads(metadata.get(_KEY, b"{}"))
    return facts


def read_shard(path: Path) -> tuple[Queries, Answers]:
    """Read a shard's rows with their checksums verified; errors as `read_table`."""
    table = read_table(path)
    column = {name: table.column(name).to_numpy() for name in SCHEMA.names if name != "fabric"}
    queries = queries_of(column)
    mean = np.stack([column[name] for name in COMPONENTS], axis=-1)
    standard_error = np.stack([column[name] for name in STANDARD_ERRORS], axis=-1)
    through = column[TRANSPARENCY], column[f"{TRANSPARENCY}_standard_error"]
    return queries, Answers(mean, standard_error, column["count"], *through)


def queries_of(column: Mapping[str, npt.NDArray[np.float32]]) -> Queries:
    """Gather the columns of questions."""
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
