"""Shards joined into one Parquet file, for data sets that others read.

The file has the columns of the shards, but plain names of fabrics, which every reader knows, in place of an Arrow
dictionary. Its metadata say what it was made of: the same shards give the same bytes.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, Final

import numpy.typing as npt
import pyarrow as pa
import pyarrow.parquet as pq

from pipeline.atomic import atomic_path
from pipeline.shards.query_file import ROW_GROUP
from pipeline.shards.schema import SCHEMA, SCHEMA_VERSION
from pipeline.shards.store import read_table
from pipeline.storage import local_copy
from weaves.errors import BadInput
from weaves.reading import refuse_irregular

JOINED: Final = SCHEMA.set(0, SCHEMA.field(0).with_type(pa.string()))
"""Arrow schema of a joined file of kind `components`."""

_KEY: Final = b"twillight"


def columns_joined() -> list[tuple[str, str, str]]:
    """Return the name, the Arrow type and the meaning of every column."""
    return [(field.name, str(field.type), field.metadata[b"meaning"].decode()) for field in JOINED]


def join_shards(path: Path, shards: Sequence[Path], about: dict[str, Any]) -> None:
    """Write the rows of shards, in their order, to one file, whole or not at all.

    Parameters
    ----------
    path : Path
        The file.
    shards : sequence of Path
        Shards of kind `components`, at least one.
    about : dict
        JSON-able facts of the file. A file that is there and has these facts, and no damaged page, is kept.

    Raises
    ------
    BadInput
        If a shard is missing or damaged.
    """
    facts = json.dumps(about, sort_keys=True).encode()
    if _is_whole(path, facts):
        return
    schema = JOINED.with_metadata({_KEY: facts})
    with atomic_path(path) as temporary, _writer(temporary, schema) as writer:
        for table in _row_groups(shards):
            writer.write_table(table.cast(schema))


def read_fabric(path: Path, fabric: str) -> dict[str, npt.NDArray[Any]]:
    """Return a fabric's rows of a joined file by column, the fabric left out, with their checksums verified.

    Raises
    ------
    BadInput
        If the file is missing or damaged, or has other columns.
    """
    refuse_irregular(path, "a file of rows")
    try:
        with local_copy(path) as file:
            table = pq.read_table(file, filters=[("fabric", "==", fabric)], page_checksum_verification=True)
    except FileNotFoundError as error:
        raise BadInput(str(path), "", "does not exist", "get the whole data set") from error
    except (pa.ArrowException, OSError) as error:
        reason = str(error).splitlines()[0].rstrip(".")
        raise BadInput(str(path), "", f"not a whole Parquet file ({reason})", "get the data set again") from error
    if table.schema.names != JOINED.names:
        odd = ", ".join(sorted(set(table.schema.names) ^ set(JOINED.names)))
        raise BadInput(str(path), "schema", f"columns {odd} differ", f"must be schema version {SCHEMA_VERSION}")
    return {name: table.column(name).to_numpy() for name in JOINED.names[1:]}


def _row_groups(shards: Sequence[Path]) -> Iterator[pa.Table]:
    """Yield the rows of shards, as many at a time as a row group has."""
    held = read_table(shards[0]).slice(0, 0)
    for shard in shards:
        held = pa.concat_tables([held, read_table(shard)])
        whole = held.num_rows - held.num_rows % ROW_GROUP
        for start in range(0, whole, ROW_GROUP):
            yield held.slice(start, ROW_GROUP)
        held = held.slice(whole)
    if held.num_rows:
        yield held


def _writer(path: Path, schema: pa.Schema) -> pq.ParquetWriter:
    return pq.ParquetWriter(
        path,
        schema,
        compression="zstd",
        use_dictionary=["fabric"],
        use_byte_stream_split=[field.name for field in schema if field.type == pa.float32()],
        write_page_checksum=True,
    )


def _is_whole(path: Path, facts: bytes) -> bool:
    """Return whether a file has these facts and its pages have their checksums."""
    try:
        with pq.ParquetFile(path, page_checksum_verification=True) as file:
            if (file.schema_arrow.metadata or {}).get(_KEY) != facts:
                return False
            return bool(sum(len(batch) for batch in file.iter_batches(ROW_GROUP)) == file.metadata.num_rows)
    except (pa.ArrowException, OSError):
        return False
