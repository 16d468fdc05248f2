import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from pipeline.shards.pieces import columns_joined, join_shards
from pipeline.shards.queries import QueryOptions, draw_queries
from pipeline.shards.query_file import ROW_GROUP
from pipeline.shards.schema import SCHEMA
from pipeline.shards.store import columns_of, write_columns
from pipeline.truth.query import Answers
from tests.refusals import refusal

ROWS = (10_000, 10_000, 20_000, 7)


@pytest.fixture
def shards(tmp_path):
    """Shards whose column count numbers all their rows."""
    paths, start = [], 0
    for number, rows in enumerate(ROWS):
        queries = draw_queries(QueryOptions(), (4, 4), 1, start, rows)
        mean = np.ones((rows, 4), np.float32)
        answers = Answers.opaque(mean, mean, np.arange(start, start + rows, dtype=np.int32))
        paths.append(tmp_path / f"{number}.parquet")
        write_columns(paths[-1], "components", f"fabric_{number % 2}", columns_of(queries, answers), {})
        start += rows
    return paths


def test_all_rows_are_there_in_their_order(shards, tmp_path):
    join_shards(tmp_path / "joined", shards, {"a": 1})
    with pq.ParquetFile(tmp_path / "joined", page_checksum_verification=True) as file:
        groups = [file.metadata.row_group(group).num_rows for group in range(file.num_row_groups)]
        table = file.read()
    assert groups == [ROW_GROUP, ROW_GROUP, sum(ROWS) - 2 * ROW_GROUP]
    assert table["count"].to_pylist() == list(range(sum(ROWS)))
    assert table["fabric"].type == pa.string()
    names = np.array(table["fabric"].to_pylist())
    assert np.array_equal(names, np.repeat([f"fabric_{number % 2}" for number in range(4)], ROWS))
    assert table.schema.metadata[b"twillight"] == b'{"a": 1}'
    expected, ours = ([(f.name, f.metadata[b"meaning"].decode()) for f in schema] for schema in (SCHEMA, table.schema))
    assert ours == expected == [(name, meaning) for name, _, meaning in columns_joined()]


def test_a_whole_file_with_the_same_facts_is_kept(shards, tmp_path):
    path = tmp_path / "joined"
    join_shards(path, shards, {"a": 1})
    whole, before = path.read_bytes(), path.stat().st_ino
    join_shards(path, shards, {"a": 1})
    assert path.stat().st_ino == before

    join_shards(path, shards, {"a": 2})
    assert path.read_bytes() != whole
    join_shards(path, shards, {"a": 1})
    assert path.read_bytes() == whole


@pytest.mark.parametrize("place", [0.001, 0.5, 0.999], ids=["first page", "in the middle", "last bytes"])
def test_a_damaged_file_is_written_again(place, shards, tmp_path):
    path = tmp_path / "joined"
    join_shards(path, shards, {})
    whole = path.read_bytes()
    at = int(place * len(whole))
    path.write_bytes(whole[:at] + bytes([whole[at] ^ 0xFF]) + whole[at + 1 :])
    join_shards(path, shards, {})
    assert path.read_bytes() == whole


def test_a_damaged_shard_is_refused_and_nothing_is_written(shards, tmp_path):
    shards[2].write_bytes(shards[2].read_bytes()[:-100])
    assert "not a whole Parquet file" in refusal(join_shards, tmp_path / "joined", shards, {})
    assert sorted(path.name for path in tmp_path.iterdir()) == [path.name for path in shards]
