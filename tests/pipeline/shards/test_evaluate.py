import csv
import json
import math
from threading import Barrier
from unittest.mock import Mock

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

import pipeline.shards.evaluate as evaluate_module
from pipeline.shards import query_file
from pipeline.shards.evaluate import Answerer, Summary, bad_list, evaluate_file, truth_answerer
from pipeline.shards.schema import QUERY_COLUMNS, STANDARD_ERRORS
from pipeline.truth.conventions import COMPONENTS
from pipeline.truth.estimator import estimate
from pipeline.truth.options import TruthOptions
from pipeline.truth.query import Answers, Queries
from tests.presets import slow
from tests.refusals import refusal
from weaves.errors import BadInput
from weaves.fabric import load_fabric

FABRIC = load_fabric("denim")
OPTIONS = TruthOptions(estimator="owen", relative_error=0.2, min_count=64, max_count=128)
ROWS = 300
SEED = 5


def query_columns(rows=ROWS, seed=1):
    """Return the least columns that a file needs, in float64."""
    rng = np.random.default_rng(seed)
    columns = {"u": rng.random(rows) * 4, "v": rng.random(rows) * 4, "sigma": np.exp(rng.normal(size=rows))}
    for name in ("wi", "wo"):
        w = rng.normal(size=(rows, 3))
        w[:, 2] = np.abs(w[:, 2]) + 0.2
        w /= np.linalg.norm(w, axis=1, keepdims=True)
        columns |= {f"{name}_{axis}": w[:, k] for k, axis in enumerate("xyz")}
    return columns


def expected(columns, start=0):
    """Return the answers of `estimate` to columns without an own shape of footprint."""
    single = {name: np.asarray(column, np.float32) for name, column in columns.items()}
    w = (np.stack([single[f"{name}_{axis}"] for axis in "xyz"], axis=-1) for name in ("wi", "wo"))
    return estimate(FABRIC, Queries.round(single["u"], single["v"], single["sigma"], *w), OPTIONS, SEED, start)


class Case:
    """A file of queries in a folder of its own, and its result."""

    def __init__(self, folder):
        self.queries, self.out = folder / "queries.parquet", folder / "deep" / "result.parquet"
        self.options = OPTIONS

    def write(self, columns, row_group_size=100):
        table = columns if isinstance(columns, pa.Table) else pa.table(columns)
        pq.write_table(table, self.queries, row_group_size=row_group_size)
        return self

    def run(self, answerer=None, chunk=2048, **choices):
        answerer = answerer or truth_answerer(FABRIC, self.options, SEED)
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(evaluate_module, "CHUNK", chunk)
            return evaluate_file(FABRIC, self.queries, self.out, answerer, **choices)

    def result(self):
        return pq.read_table(self.out)

    def refused(self, **choices):
        """Return the sentence, and check that nothing at all was written."""
        sentence = refusal(self.run, **choices)
        assert not self.out.parent.exists()
        return sentence


@pytest.fixture
def case(tmp_path):
    return Case(tmp_path)


def same(table, answers, rows=slice(None)):
    names = (*COMPONENTS, *STANDARD_ERRORS, "transparency", "count")
    columns = (*answers.mean.T, *answers.standard_error.T, answers.transparency, answers.count)
    for name, column in zip(names, columns, strict=True):
        np.testing.assert_array_equal(table[name].to_numpy()[rows], column)


def test_the_answers_are_those_of_estimate_and_a_result_read_alone_is_understood(case):
    columns = query_columns()
    tags = pa.array([f"tag {k % 3}" for k in range(ROWS)]).dictionary_encode()
    nested = pa.array([[k] if k % 2 else None for k in range(ROWS)])
    given = pa.table({"id": np.arange(ROWS), "tag": tags, **columns, "nested": nested})
    summary = case.write(given).run()
    table = case.result()
    assert table.column_names[: given.num_columns] == given.column_names
    assert table.select(given.column_names).combine_chunks().cast(given.schema).equals(given)
    same(table, expected(columns))
    assert (summary.rows, summary.bad) == (ROWS, 0) and summary.points == table["count"].to_numpy().sum()
    case.write(query_columns(3)).run()
    schema = case.result().schema
    about = json.loads(schema.metadata[b"twillight"])
    assert about["truth"] == OPTIONS.model_dump(mode="json") and about["seed"] == SEED
    assert about["fabric"]["name"] == "denim" and about["queries"] == "queries.parquet"
    assert about["left_out"] == {"sigma_minor": "sigma", "angle": 0.0, "curvature": 0.0}
    assert "1/sr" in schema.field("specular_warp").metadata[b"meaning"].decode()
    assert not schema.field("count").nullable


@pytest.mark.parametrize("estimator", ["owen", slow("auto")])
def test_no_byte_depends_on_the_cut_nor_on_the_number_of_threads(case, monkeypatch, estimator):
    """Queries from both sides, lit from both, some bad; chunks of any size, blocks that end inside row groups."""
    case.options = OPTIONS.model_copy(update={"estimator": estimator})
    columns = query_columns(100)
    columns["wi_z"][::5] *= -1.0
    columns["wo_z"][::7] *= -1.0
    columns["sigma"][[9, 10, 80]] = 0.0
    summary = case.write(columns).run(skip_bad=True)
    whole, listed, table = case.out.read_bytes(), bad_list(case.out).read_bytes(), case.result()
    for chunk, threads in ((1, 2), (7, 1), (40, 8), (10_000, 3)):
        shares = []
        again = case.run(skip_bad=True, chunk=chunk, threads=threads, progress=shares.append)
        assert (case.out.read_bytes(), bad_list(case.out).read_bytes()) == (whole, listed)
        assert (again.rows, again.bad, again.points) == (summary.rows, summary.bad, summary.points)
        assert shares == sorted(shares) and shares[-1] == 1.0
    case.write(columns, row_group_size=17).run(skip_bad=True)
    assert case.result().equals(table)
    monkeypatch.setattr(query_file, "ROW_GROUP", 40)
    case.run(skip_bad=True, chunk=5, threads=3)
    assert case.result().equals(table)


def test_a_method_in_place_of_the_truth_answers_on_all_threads(case):
    """Two chunks wait for one another, so that a single thread would wait for ever; rows stay in their order."""
    together = Barrier(2)

    def answer(queries, first):
        together.wait(timeout=300.0)
        mean = np.tile(queries.sigma[:, None], (1, 4))
        return Answers.opaque(mean, np.zeros_like(mean), np.zeros(len(mean), np.int32))

    columns = query_columns(40)
    case.write(columns).run(Answerer(answer, {"model": "sigma"}), chunk=10, threads=2)
    np.testing.assert_array_equal(case.result()["diffuse_weft"].to_numpy(), columns["sigma"].astype(np.float32))
    assert all(case.result()[name].null_count == 40 for name in STANDARD_ERRORS)


def test_what_stops_a_thread_stops_everything(case):
    """The table knows nothing of tiny footprints: the first such row in the file is named, whoever meets it first."""
    case.options = OPTIONS.model_copy(update={"estimator": "node_table"})
    columns = query_columns()
    columns["sigma"] = np.where(np.isin(np.arange(ROWS), [150, 250]), 0.001, 32.0)
    assert "row 150" in refusal(case.write(columns).run, chunk=10, threads=4)
    assert not list(case.out.parent.iterdir())


def test_viewers_too_low_for_parallax_are_bad_rows(case):
    columns = query_columns(30)
    for axis, value in zip("xyz", (0.9999, 0.0, 0.01414), strict=True):
        columns[f"wo_{axis}"][[7, 9]] = value
    with pytest.raises(BadInput, match=r"row 7, .*within 89 degrees of the normal"):
        case.write(columns).run()
    assert case.run(skip_bad=True).bad == 2


def test_a_footer_that_claims_other_rows_than_there_are_is_refused(case):
    case.write(query_columns(), 1000)
    content, field = case.queries.read_bytes(), b"\x16\xd8\x04\x19"  # number of rows, 300, before the row groups
    assert content.count(field) == 1
    case.queries.write_bytes(content.replace(field, b"\x16\x80\x00\x19"))
    assert "rows in the footer = 0: its row groups have 300" in case.refused()


def test_only_the_first_of_many_bad_rows_is_described(case, monkeypatch):
    describe = Mock(wraps=query_file.BadRow)
    monkeypatch.setattr(query_file, "BadRow", describe)
    columns = query_columns()
    columns["sigma"][:] = -1
    assert f"row 0, column sigma = -1.0: must be greater than 0 ({ROWS - 1} more" in case.write(columns).refused()
    assert describe.call_count == 1


@pytest.mark.parametrize("row_group_size", [10, 1000])
def test_no_more_than_a_block_is_held_and_no_more_than_a_chunk_is_asked(case, monkeypatch, row_group_size):
    case.write(query_columns(), row_group_size)
    answer, check = Mock(wraps=estimate), Mock(wraps=query_file.checked_queries)
    monkeypatch.setattr(query_file, "ROW_GROUP", 64)
    monkeypatch.setattr(evaluate_module, "estimate", answer)
    monkeypatch.setattr(query_file, "checked_queries", check)
    case.run(chunk=16, skip_bad=True)
    blocks, asked = [call.args[0] for call in check.mock_calls], [len(call.args[1].u) for call in answer.mock_calls]
    assert [block.num_rows for block in blocks] == [64, 64, 64, 64, 44]
    assert max(block.nbytes for block in blocks) <= 9 * (64 * 8 + 64 // 8)  # nine columns, and a bit a null
    assert max(asked) == 16 and sum(asked) == ROWS + 2  # two for the compiler, outside the clock


def test_single_precision_and_missing_columns_are_what_they_stand_for_and_places_far_off_keep_their_digits(case):
    columns = query_columns()
    case.write(columns).run()
    table = case.result()
    single = {name: np.asarray(column, np.float32) for name, column in columns.items()}
    full = {**single, "sigma_minor": single["sigma"], "angle": np.zeros(ROWS), "curvature": np.zeros(ROWS, np.float32)}
    case.write(full).run()
    assert set(full) == set(QUERY_COLUMNS)
    assert all(case.result()[name].equals(table[name]) for name in COMPONENTS)
    # An own shape is no default.
    case.write(full | {"sigma_minor": single["sigma"] * 0.5, "angle": np.ones(ROWS)}).run()
    assert not case.result()["diffuse_warp"].equals(table["diffuse_warp"])
    columns = query_columns()
    columns["u"], columns["v"] = (np.round(columns[name] * 2**20) / 2**20 for name in ("u", "v"))
    case.write(columns).run()
    near = case.result()
    case.write(columns | {"u": columns["u"] + 4 * 2**28, "v": columns["v"] - 4 * 2**28}).run()
    for name in COMPONENTS:
        np.testing.assert_allclose(case.result()[name].to_numpy(), near[name].to_numpy(), rtol=1e-4, atol=1e-6)


def spoilt():
    """Return queries with six bad rows, and what is wrong with each."""
    columns = query_columns()
    columns["sigma"][7] = -1.0
    columns["sigma"][8] = 1e-60
    columns["u"][120] = math.nan
    columns["wi_z"][200] += 0.5
    columns["curvature"] = np.where(np.arange(ROWS) == 250, 1.5, 0.0)
    columns["v"] = pa.array(columns["v"], mask=np.arange(ROWS) == 299)
    return columns, [
        (7, "sigma", "-1.0", "must be greater than 0"),
        (8, "sigma", "1e-60", "must be greater than 0 in single precision"),
        (120, "u", "nan", "must be finite"),
        (200, "wi_x..z", None, "must have unit length"),
        (250, "curvature", "1.5", "must be from 0 to 1"),
        (299, "v", "", "must not be null"),
    ]


def test_bad_rows_are_refused_or_skipped_listed_and_change_no_other_row(case):
    table, faults = spoilt()
    sentence = case.write(table).refused()
    assert "queries.parquet: row 7, column sigma = -1.0: must be greater than 0 (5 more bad rows;" in sentence
    summary = case.run(skip_bad=True)
    assert (summary.rows, summary.bad) == (ROWS, len(faults))
    head, *listed = csv.reader(bad_list(case.out).read_text().splitlines())
    assert head == ["row", "column", "value", "reason"]
    for row, (index, column, value, reason) in zip(listed, faults, strict=True):
        assert row[:2] == [str(index), column] and value in (None, row[2]) and row[3].startswith(reason)
    result, good = case.result(), np.ones(ROWS, bool)
    good[[index for index, *_ in faults]] = False
    np.testing.assert_array_equal(result["count"].is_valid().to_numpy(), good)
    same(result, expected(query_columns()).take(good), good)
    # The list is empty where nothing is bad.
    case.write(query_columns()).run(skip_bad=True)
    assert bad_list(case.out).read_text().splitlines() == ["row,column,value,reason"]


def test_files_without_a_good_row_are_answered(case):
    assert case.write({name: column[:0] for name, column in query_columns().items()}).run().rows == 0
    assert case.result().num_rows == 0
    columns = query_columns(4) | {"sigma": np.zeros(4)}
    summary = case.write(columns).run(skip_bad=True)
    assert summary.bad == 4 and math.isnan(summary.median_relative_error)
    assert case.result()["count"].null_count == 4


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda t: t.drop_columns(["wi_z"]), "column wi_z missing"),
        (lambda t: t.drop_columns(["wi_z", "u"]), "columns u, wi_z missing"),
        (lambda t: t.append_column("count", t["u"]), "column = 'count': has the name of an answer"),
        (lambda t: t.append_column("u", t["u"]), "column = 'u': is there more than once"),
        (lambda t: t.set_column(0, "u", t["u"].cast("string")), "type of column u = 'string'"),
        (lambda t: t.set_column(0, "u", pa.nulls(ROWS)), "type of column u = 'null'"),
        (lambda t: t.set_column(2, "sigma", pa.array(np.ones(ROWS, np.int64))), "type of column sigma = 'int64'"),
        (lambda t: t.append_column("angle", pa.array(np.full(ROWS, np.inf))), "row 0, column angle = inf"),
    ],
)
def test_files_that_ask_nothing_are_refused(case, change, words):
    assert words in case.write(change(pa.table(query_columns()))).refused()


def test_files_that_are_not_whole_are_refused_and_leave_nothing(case):
    assert "no such file" in case.refused()
    pq.write_table(pa.table(query_columns(20_000)), case.queries, write_page_checksum=True, compression="none")
    content = bytearray(case.queries.read_bytes())
    cut = bytes(content[: len(content) // 2])
    content[len(content) // 2] ^= 1  # in a page
    for damaged in (b"u,v\n1,2\n", b"", cut, bytes(content)):
        case.queries.write_bytes(damaged)
        assert "not a whole Parquet file" in case.refused()
    assert "not a whole Parquet file" in refusal(case.run, skip_bad=True)
    assert not list(case.out.parent.iterdir())


def test_outputs_that_cannot_be_written_are_refused_before_any_work(case, monkeypatch, tmp_path):
    case.write(query_columns())
    monkeypatch.setattr(evaluate_module, "estimate", None)
    before = case.queries.read_bytes()
    (tmp_path / "link.parquet").symlink_to(case.queries)
    for out in (case.queries, tmp_path / "link.parquet", tmp_path, case.queries / "result.parquet"):
        with pytest.raises(BadInput):
            evaluate_file(FABRIC, case.queries, out, truth_answerer(FABRIC, OPTIONS, SEED))
    assert case.queries.read_bytes() == before


def test_an_evaluation_that_is_stopped_leaves_what_was_there(case, monkeypatch):
    case.write(query_columns()).run()
    before = case.out.read_bytes()

    def stop(share):
        if share > 0.5:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        case.run(chunk=50, progress=stop, skip_bad=True)
    assert case.out.read_bytes() == before and [path.name for path in case.out.parent.iterdir()] == [case.out.name]


def test_the_median_is_that_of_the_rows():
    rng = np.random.default_rng(3)
    mean = np.exp(rng.normal(size=(1001, 4))).astype(np.float32)
    error = (mean * np.exp(rng.normal(size=(1001, 1)))).astype(np.float32)
    mean[:100], error[:100] = 0.0, 0.0
    summary = Summary()
    for part in (slice(0, 300), slice(300, None)):
        summary.add(Answers.opaque(mean[part], error[part], np.ones(1001, np.int32)[part]))
    relative = np.linalg.norm(error[100:], axis=1) / np.linalg.norm(mean[100:], axis=1)
    assert summary.median_relative_error == pytest.approx(np.median(relative), rel=0.005)
    assert summary.points == 1001
