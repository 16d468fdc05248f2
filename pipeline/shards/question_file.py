"""Questions of a benchmark as files: the held-out queries of its fabrics, with an id each and without answers."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Final

import numpy as np
import pyarrow as pa
from pyarrow import csv

from pipeline.shards.answer_file import ID
from pipeline.shards.generate import ShardTask
from pipeline.shards.schema import QUERY_COLUMNS, SCHEMA
from pipeline.shards.store import ROW_GROUP, columns_of, parquet_writer

QUESTION_COLUMNS: Final = pa.schema(
    [
        pa.field(ID, pa.int64(), nullable=False, metadata={"meaning": "number of the question, from 0"}),
        pa.field("fabric", SCHEMA.field("fabric").type, nullable=False, metadata={"meaning": "name of the fabric"}),
        *(SCHEMA.field(name) for name in QUERY_COLUMNS),
    ]
)
"""Arrow schema of the questions, each column with its meaning."""

QUESTION_FILES: Final = ("questions.parquet", "questions.csv")


def write_questions(folder: Path, parts: Iterable[ShardTask]) -> int:
    """Write the queries of held-out shards, in their order, as Parquet and as CSV, and return their number."""
    start, bare = 0, csv.WriteOptions(include_header=False, quoting_style="none")
    with (
        parquet_writer(folder / QUESTION_FILES[0], QUESTION_COLUMNS, ["fabric"]) as parquet,
        (folder / QUESTION_FILES[1]).open("wb") as file,
        csv.CSVWriter(file, QUESTION_COLUMNS, write_options=bare) as text,
    ):
        file.write(f"{','.join(QUESTION_COLUMNS.names)}\n".encode())  # with quotes it would not suit a plain reader
        for part in parts:
            names = pa.DictionaryArray.from_arrays(np.zeros(part.rows, np.int32), pa.array([part.fabric.name]))
            columns = columns_of(part.drawn())
            arrays = [pa.array(np.arange(start, start + part.rows)), names, *(columns[name] for name in QUERY_COLUMNS)]
            table = pa.Table.from_arrays(arrays, schema=QUESTION_COLUMNS)
            parquet.write_table(table, ROW_GROUP)
            text.write_table(table)
            start += part.rows
    return start
