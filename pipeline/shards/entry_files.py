"""Files of a benchmark: its questions, which are held-out queries with an id each, and answers to all of them.

Answers come from anywhere, as Parquet or CSV; they are read as data and checked as a whole. A row is the `id` of a
question and its answer: the four components, or, if one of these is missing, linear RGB in the fabric's own colours.
Rows have any order, other columns are ignored.
"""

import hashlib
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt
import pyarrow as pa
from pyarrow import csv

from pipeline.atomic import atomic_path
from pipeline.compiled.arrays import Float32
from pipeline.shards.generate import ShardTask
from pipeline.shards.query_file import blocks, open_queries
from pipeline.shards.schema import QUERY_COLUMNS, SCHEMA
from pipeline.shards.store import ROW_GROUP, columns_of, parquet_writer
from pipeline.truth.conventions import COMPONENTS
from weaves.errors import BadInput, one_line
from weaves.reading import refuse_irregular

ID: Final = "id"
RGB_COLUMNS: Final = ("red", "green", "blue")  # columns of answers in colour

QUESTION_COLUMNS: Final = pa.schema(
    [
        pa.field(ID, pa.int64(), nullable=False, metadata={"meaning": "number of the question, from 0"}),
        pa.field("fabric", SCHEMA.field("fabric").type, nullable=False, metadata={"meaning": "name of the fabric"}),
        *(SCHEMA.field(name) for name in QUERY_COLUMNS),
    ]
)
"""Arrow schema of the questions, each column with its meaning."""

QUESTION_FILES: Final = ("questions.parquet", "questions.csv")

_MOST_BYTES: Final = 1024  # of a row of CSV
_MOST_ROWS: Final = 4  # for each question


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


def read_answers(path: Path, count: int) -> Float32:
    """Return the answers to the questions 0 to count - 1, (count, 4) components or (count, 3) RGB.

    BadInput for the first fault: columns that are missing or of another type, an id that is no question or is there
    twice, a value that is negative or not finite, a question without an answer.
    """
    given = read_numbers(path, _columns, _MOST_ROWS * count, f"there are {count:,} questions")
    ids = given.pop(ID)

    def refuse(bad: npt.NDArray[np.bool_], column: str, values: npt.NDArray[Any], allowed: str) -> None:
        if rows := int(bad.sum()):
            row = int(bad.argmax())
            more = f" ({rows - 1:,} more bad rows)" if rows > 1 else ""
            raise BadInput(str(path), f"row {row}, column {column}", values[row].item(), allowed + more)

    refuse((ids < 0) | (ids >= count), ID, ids, f"is no question: ids are 0 to {count - 1:,}")
    again = np.ones(len(ids), np.bool_)
    again[np.unique(ids, return_index=True)[1]] = False
    refuse(again, ID, ids, "is there more than once")
    with np.errstate(over="ignore", under="ignore"):
        single = {name: values.astype(np.float32) for name, values in given.items()}
    for name, values in single.items():
        refuse(~(np.isfinite(values) & (values >= 0)), name, given[name], "must be finite and at least 0")
    if len(ids) < count:
        first = int(np.setdiff1d(np.arange(count), ids)[0])
        left = f"{count - len(ids):,} of {count:,} questions have no answer"
        raise BadInput(str(path), "", f"the id {first} is missing", left)
    answers = np.empty((count, len(single)), np.float32)
    answers[ids.astype(np.int64)] = np.stack(list(single.values()), axis=1)
    return answers


def write_answers(path: Path, answers: Float32) -> None:
    """Write answers in the order of their questions; the same answers give the same bytes."""
    names = COMPONENTS if answers.shape[1] == len(COMPONENTS) else RGB_COLUMNS
    columns = {ID: np.arange(len(answers))} | dict(zip(names, np.ascontiguousarray(answers.T), strict=True))
    table = pa.table(columns)
    with atomic_path(path) as temporary, parquet_writer(temporary, table.schema, []) as writer:
        writer.write_table(table, ROW_GROUP)


def answers_sha256(answers: Float32) -> str:
    """Return the hash of answers, whatever file they came in."""
    return hashlib.sha256(str(answers.shape).encode() + answers.tobytes()).hexdigest()


def read_numbers(
    path: Path, columns: Callable[[Path, Sequence[str]], list[str]], most: int, why: str
) -> dict[str, npt.NDArray[Any]]:
    """Return columns of numbers of a Parquet or a CSV file, `ID` as integers; those that `columns` chooses by names.

    BadInput if the file cannot be read, has more than `most` rows (`why` says what limits them), or an empty cell.
    """
    table = (_parquet if path.suffix == ".parquet" else _csv)(path, columns, most, why)
    for name in table.column_names:
        if table[name].null_count:
            row = int(np.flatnonzero(table[name].is_null().to_numpy())[0])
            raise BadInput(str(path), f"row {row}, column {name}", None, "a number is needed")
    return {name: table[name].to_numpy() for name in table.column_names}


def _parquet(path: Path, columns: Callable[[Path, Sequence[str]], list[str]], most: int, why: str) -> pa.Table:
    with open_queries(path) as file:
        names, rows = columns(path, file.schema_arrow.names), file.metadata.num_rows
        for name in names:
            kind = file.schema_arrow.field(name).type
            if not (pa.types.is_integer(kind) if name == ID else kind in (pa.float32(), pa.float64())):
                allowed = "must be an integer" if name == ID else "must be float (32 bits) or double (64 bits)"
                raise BadInput(str(path), f"type of column {name}", str(kind), allowed)
        if rows > most:
            raise BadInput(str(path), "", f"has {rows:,} rows", why)
        read = (block.select(names) for block in blocks(path, file, names))
        return pa.concat_tables([file.schema_arrow.empty_table().select(names), *read])


def _csv(path: Path, columns: Callable[[Path, Sequence[str]], list[str]], most: int, why: str) -> pa.Table:
    refuse_irregular(path, "a file of CSV")
    most_bytes = _MOST_BYTES * (most + 1)
    try:
        if (size := path.stat().st_size) > most_bytes:
            raise BadInput(str(path), "", f"has {size:,} bytes", f"at most {most_bytes:,} are read: {why}")
        with csv.open_csv(path) as reader:
            names = columns(path, reader.schema.names)
        types = dict.fromkeys(names, pa.float64()) | ({ID: pa.int64()} if ID in names else {})
        return csv.read_csv(path, convert_options=csv.ConvertOptions(column_types=types, include_columns=names))
    except (pa.ArrowException, OSError, UnicodeDecodeError) as error:
        reason = f"cannot be read ({one_line(error, 120)})"
        raise BadInput(str(path), "", reason, "a heading, then numbers, are needed") from error


def _columns(path: Path, names: Sequence[str]) -> list[str]:
    """Return the columns of an answer that a file has."""
    answer = RGB_COLUMNS if set(RGB_COLUMNS) <= set(names) and not set(COMPONENTS) <= set(names) else COMPONENTS
    for name in (ID, *answer):
        if name not in names:
            allowed = f"needed are {ID} and {', '.join(COMPONENTS)}, or {ID} and {', '.join(RGB_COLUMNS)}"
            raise BadInput(str(path), "", f"column {name} missing", allowed)
        if Counter(names)[name] > 1:
            raise BadInput(str(path), "column", name, "is there more than once")
    return [ID, *answer]
