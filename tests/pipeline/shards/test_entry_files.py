import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from pyarrow import csv

from pipeline.shards.entry_files import ID, RGB_COLUMNS, answers_sha256, read_answers, write_answers
from pipeline.truth.conventions import COMPONENTS
from tests.refusals import accepted, refusal

COUNT = 40
RIGHT = np.random.default_rng(0).random((COUNT, 4)).astype(np.float32)
ENDINGS = (".csv", ".parquet")

bounded = settings(max_examples=40, suppress_health_check=[HealthCheck.function_scoped_fixture])


def columns(names=COMPONENTS):
    return {ID: np.arange(COUNT)} | dict(zip(names, RIGHT.T.copy(), strict=False))


def write(path, given):
    table = pa.table(given)
    csv.write_csv(table, path) if path.suffix == ".csv" else pq.write_table(table, path)
    return path


def refused(path, given):
    """Return the sentence that refuses answers, which begins with the file."""
    sentence = refusal(read_answers, write(path, given), COUNT)
    assert path.name in sentence
    return sentence


@bounded
@given(st.permutations(range(COUNT)), st.sampled_from(ENDINGS), st.sampled_from([np.int32, np.uint64]))
def test_rows_in_any_order_of_either_form_are_the_same_answers(tmp_path, order, ending, kind):
    given = {name: values[list(order)] for name, values in columns().items()}
    given[ID] = given[ID].astype(kind)
    path = write(tmp_path / f"a{ending}", {"note": ["a, b"] * COUNT, **given})
    found = read_answers(path, COUNT)
    np.testing.assert_array_equal(found, RIGHT)
    assert answers_sha256(found) == answers_sha256(RIGHT) != answers_sha256(RIGHT[:, :3])


def test_answers_are_read_as_they_were_written_components_and_colours(tmp_path):
    for answers in (RIGHT, RIGHT[:, :3]):
        write_answers(tmp_path / "a.parquet", answers)
        np.testing.assert_array_equal(read_answers(tmp_path / "a.parquet", COUNT), answers)
        first = (tmp_path / "a.parquet").read_bytes()
        write_answers(tmp_path / "a.parquet", answers)
        assert (tmp_path / "a.parquet").read_bytes() == first


rows = st.integers(0, COUNT - 1)


@bounded
@given(rows, st.sampled_from(COMPONENTS), st.sampled_from([-1.0, -1e-30, np.nan, np.inf, -np.inf, 1e39]))
def test_a_number_that_no_answer_has_is_named_with_its_row(tmp_path, row, name, value):
    for ending in ENDINGS:
        given = {column: values.astype(np.float64) for column, values in columns().items()}
        given |= {ID: np.arange(COUNT)}
        given[name][row] = value
        assert f"row {row}, column {name}" in refused(tmp_path / f"a{ending}", given)


@bounded
@given(rows, rows, st.sampled_from(ENDINGS))
def test_missing_repeated_and_foreign_ids_are_named(tmp_path, one, other, ending):
    path, right = tmp_path / f"a{ending}", columns()
    left = {name: np.delete(values, one) for name, values in right.items()}
    assert f"the id {one} is missing: 1 of {COUNT} questions" in refused(path, left)
    more = {name: np.append(values, values[one]) for name, values in right.items()}
    assert f"row {COUNT}, column id = {one}: is there more than once" in refused(path, more)
    for foreign in (-1 - one, COUNT + other, 2**62):
        right[ID][one] = foreign
        assert f"row {one}, column id = {foreign}: is no question: ids are 0 to 39" in refused(path, right)


@bounded
@given(st.sampled_from(ENDINGS), st.lists(st.tuples(st.integers(0, 10**6), st.binary(max_size=4)), max_size=4))
def test_a_damaged_file_is_read_or_one_sentence(tmp_path, ending, changes):
    path = write(tmp_path / f"a{ending}", columns())
    content = bytearray(path.read_bytes())
    for place, new in changes:
        start = place % len(content)
        content[start : start + 2] = new or b"\0"
    path.write_bytes(content)
    answers = accepted(read_answers, path, COUNT)
    assert answers is None or (answers.shape[0] == COUNT and np.isfinite(answers).all() and (answers >= 0).all())


@pytest.mark.parametrize("ending", ENDINGS)
def test_columns_that_are_missing_empty_or_of_another_type_are_named(tmp_path, ending):
    path = tmp_path / f"a{ending}"
    for name in (ID, *COMPONENTS):
        left = {column: values for column, values in columns().items() if column != name}
        assert f"column {name} missing: needed are id and specular_warp" in refused(path, left)
        assert ("'x'" if ending == ".csv" else f"type of column {name}") in refused(
            path, columns() | {name: ["x"] * COUNT}
        )
        gap = pa.array([0, 1, 2, None] * 10, pa.int64() if name == ID else pa.float64())
        assert f"row 3, column {name} = None: a number is needed" in refused(path, columns() | {name: gap})
    assert "column specular_warp missing" in refused(path, columns(RGB_COLUMNS[:2]))
    often = refused(path, {name: np.tile(values, 5) for name, values in columns().items()})
    assert ("more than once" if ending == ".csv" else "has 200 rows: there are 40 questions") in often


@pytest.mark.parametrize(
    "content", [b"", b"id", b"\xff\xfe\0", b"id,\xff\n0,1\n", b"id,red\n" + b"1," * 10**6, b"PAR1" * 9, b"id,id\n1,2\n"]
)
@pytest.mark.parametrize("ending", ENDINGS)
def test_what_is_no_table_is_one_sentence(tmp_path, ending, content):
    path = tmp_path / f"a{ending}"
    path.write_bytes(content)
    refusal(read_answers, path, COUNT)
    path.unlink()
    refusal(read_answers, path, COUNT)
    path.mkdir()
    refusal(read_answers, path, COUNT)
