"""Shards joined into one Parquet file, for data sets that others read.

The file has the columns of the shards, but plain names of fabrics, which every reader knows, in place of an Arrow
dictionary. Its metadata say what it was made of: the same shards give the same bytes.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import numpy.typing as npt
import pyarrow as pa
import pyarrow.parquet as pq

from pipeline.atomic import atomic_path
from pipeline.shards.schema import SCHEMA, SCHEMA_VERSION
from pipeline.shards.store import FACTS, ROW_GROUP, numbers_of, parquet_writer, read_table, readable, regrouped
from pipeline.storage import local_copy
from weaves.errors import BadInput
from weaves.reading import refuse_irregular

_JOINED: Final = SCHEMA.set(0, SCHEMA.field(0).with_type(pa.string()))


def columns_joined() -> list[tuple[str, str, str]]:
    """Return the name, the Arrow type and the meaning of every column."""
    return [(field.name, str(field.type), field.metadata[b"meaning"].decode()) for field in _JOINED]


def join_shards(path: Path, shards: Sequence[Path], about: dict[str, Any]) -> None:
    """Write the rows of shards of kind `components`, at least one, to one file in their order, whole or not at all.

    A file that is there, with the same JSON-able facts `about` it and no damaged page, is kept. BadInput if a shard is
    missing or damaged.
    """
    facts = json.dumps(about, sort_keys=True).encode()
    if _is_whole(path, facts):
        return
    schema = _JOINED.with_metadata({FACTS: facts})
    with atomic_path(path) as temporary, parquet_writer(temporary, schema, ["fabric"]) as writer:
        for table in regrouped(map(read_table, shards), ROW_GROUP):
            writer.write_table(table.cast(schema))


def read_fabric(path: Path, fabric: str) -> dict[str, npt.NDArray[Any]]:
    """Return a fabric's rows of a joined file by column, the fabric left out, with their checksums verified.

    BadInput if the file is missing or damaged, or has other columns.
    """
    refuse_irregular(path, "a file of rows")
    missing = "does not exist", "get the whole data set"
    with readable(path, missing, "get the data set again"), local_copy(path) as file:
        table = pq.read_table(file, filters=[("fabric", "==", fabric)], page_checksum_verification=True)
    if table.schema.names != _JOINED.names:
        odd = ", ".join(sorted(set(table.schema.names) ^ set(_JOINED.names)))
        raise BadInput(str(path), "schema", f"columns {odd} differ", f"must be schema version {SCHEMA_VERSION}")
    return numbers_of(table)


def _is_whole(path: Path, facts: bytes) -> bool:
    """Return whether a file has these facts and its pages have their checksums."""
    try:
        with pq.ParquetFile(path, page_checksum_verification=True) as file:
            if (file.schema_arrow.metadata or {}).get(FACTS) != facts:
                return False
            return bool(sum(len(batch) for batch in file.iter_batches(ROW_GROUP)) == file.metadata.num_rows)
    except (pa.ArrowException, OSError):
        return False
