"""`twillight evaluate` as a user meets it: what it prints, one sentence for whatever is wrong, what a kill leaves."""

import signal
import subprocess
import sys
from functools import partial
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

import pipeline.shards.evaluate
from jobs.verbs.evaluate import truth_options
from pipeline.truth.options import TruthOptions

ROWS = 40


def query_columns():
    rng = np.random.default_rng(2)
    ones = np.ones(ROWS)
    wi = {"wi_x": 0.6 * ones, "wi_y": 0.0 * ones, "wi_z": 0.8 * ones}
    wo = {"wo_x": 0.0 * ones, "wo_y": 0.28 * ones, "wo_z": 0.96 * ones}
    return {"id": np.arange(ROWS), "u": rng.random(ROWS), "v": rng.random(ROWS), "sigma": ones, **wi, **wo}


@pytest.fixture
def evaluate(twillight, tmp_path):
    """Run the verb on a file of queries; return exit code, output and complaint."""
    pq.write_table(pa.table(query_columns()), tmp_path / "queries.parquet")
    return partial(twillight, "evaluate", "denim", "queries.parquet", "--out")


def test_a_summary_tells_what_was_done(evaluate, tmp_path):
    code, text, complaint = evaluate("deep/result.parquet", "--relative-error", "0.1")
    assert (code, complaint) == (0, "")
    table = pq.read_table(tmp_path / "deep" / "result.parquet")
    assert table["id"].to_pylist() == list(range(ROWS))
    cells = text.splitlines()[1].split()
    assert cells[:2] == [str(ROWS), str(ROWS)] and cells[2].endswith("%")
    assert float(cells[3].replace(",", "")) == pytest.approx(table["count"].to_numpy().mean(), rel=0.01)
    assert "deep/result.parquet" in text
    # The same command writes the same bytes on any number of threads; another seed, estimator or footprint does not.
    first = (tmp_path / "deep" / "result.parquet").read_bytes()
    evaluate("deep/one.parquet", "--relative-error", "0.1", "--workers", "1")
    assert (tmp_path / "deep" / "one.parquet").read_bytes() == first
    for choice in ((), ("--seed", "1"), ("--estimator", "mc"), ("--footprint", "box")):
        evaluate("deep/result.parquet", "--relative-error", "0.1", *choice)
        assert ((tmp_path / "deep" / "result.parquet").read_bytes() == first) == (not choice), choice


def test_bad_rows_are_listed_when_skipped(evaluate, tmp_path):
    columns = query_columns()
    columns["sigma"][3] = 0.0
    pq.write_table(pa.table(columns), tmp_path / "queries.parquet")
    code, text, complaint = evaluate("result.parquet", "--skip-bad")
    assert (code, complaint) == (0, "") and "1 bad row has no answer; see result.bad.csv" in text
    listed = (tmp_path / "result.bad.csv").read_text().splitlines()
    assert listed == ["row,column,value,reason", "3,sigma,0.0,must be greater than 0"]


def test_ctrl_c_says_that_nothing_was_written(evaluate, tmp_path, monkeypatch):
    def stop(*arguments, **options):
        raise KeyboardInterrupt

    monkeypatch.setattr(pipeline.shards.evaluate, "estimate", stop)
    code, _, complaint = evaluate("result.parquet")
    assert code == 130 and complaint == "stopped; result.parquet was not written\n"
    assert [path.name for path in tmp_path.iterdir()] == ["queries.parquet"]


def test_a_kill_leaves_no_half_file_and_the_next_run_clears_up(evaluate, tmp_path):
    """The process kills itself after half of the rows, with rows already handed to the writer."""
    code = (
        "import os, signal, pipeline.shards.query_file as q, pipeline.shards.evaluate as e\n"
        "from pathlib import Path; from weaves.fabric import load_fabric\n"
        "from pipeline.truth.options import TruthOptions\n"
        "q.ROW_GROUP = 8\n"
        "denim = load_fabric('denim')\n"
        "truth = e.truth_answerer(denim, TruthOptions(), 0)\n"
        "e.evaluate_file(denim, Path('queries.parquet'), Path('result.parquet'), truth,\n"
        "    skip_bad=True, progress=lambda share: share < 0.5 or os.kill(os.getpid(), signal.SIGKILL))\n"
    )
    root = Path(__file__).parents[3]
    done = subprocess.run(
        [sys.executable, "-c", f"import sys; sys.path.insert(0, {str(root)!r})\n{code}"], cwd=tmp_path
    )
    assert done.returncode == -signal.SIGKILL
    left = {path.name for path in tmp_path.iterdir()}
    assert left <= {"queries.parquet", ".tmp-result.parquet", ".tmp-result.bad.csv"} and ".tmp-result.parquet" in left
    assert evaluate("result.parquet", "--skip-bad")[0] == 0
    assert sorted(path.name for path in tmp_path.iterdir()) == ["queries.parquet", "result.bad.csv", "result.parquet"]
    assert pq.read_table(tmp_path / "result.parquet").num_rows == ROWS


def test_options_that_are_left_out_keep_their_defaults():
    assert truth_options(estimator=None, relative_error=None) == TruthOptions()
    assert truth_options(estimator="mc").estimator == "mc"
