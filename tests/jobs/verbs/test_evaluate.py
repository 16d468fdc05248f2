import json
import signal
import subprocess
import sys
from pathlib import Path
from unittest.mock import Mock

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import safetensors.torch
import torch

import pipeline.shards.evaluate
from jobs import exits
from pipeline.fingerprint import IDENTITY
from pipeline.models.card import write_model
from pipeline.models.domain import Domain
from pipeline.models.woven import WovenOptions
from pipeline.models.woven.model import Woven, WovenNetwork
from pipeline.shards.queries import QueryOptions, draw_queries
from pipeline.truth.conventions import COMPONENTS
from weaves.fabric import load_fabric

ROWS = 40
SMALL = WovenOptions(map_texels=16, encoder_channels=4, hidden=16, latent=8)


def drawn(rows=ROWS, **options):
    return draw_queries(QueryOptions(**options), (4, 4), 1, 0, rows)


QUERIES = drawn()


@pytest.fixture
def evaluate(twillight, tmp_path):
    """Evaluate queries by the verb; return the exit code, output and complaint, each in one line, and the answers."""

    def evaluate(*more, fabric="denim", queries=QUERIES, out="result.parquet"):
        columns = {"id": np.arange(len(queries.u))} | {name: getattr(queries, name) for name in ("u", "v", "sigma")}
        for name in ("wi", "wo"):
            columns |= {f"{name}_{axis}": getattr(queries, name)[:, k] for k, axis in enumerate("xyz")}
        pq.write_table(pa.table(columns), tmp_path / "queries.parquet")
        code, text, complaint = twillight("evaluate", fabric, "queries.parquet", "--out", out, *more)
        answers = pq.read_table(tmp_path / out) if (tmp_path / out).exists() else None
        return code, text, " ".join(complaint.split()), answers

    return evaluate


def test_a_summary_tells_what_was_done(evaluate, tmp_path):
    path, coarse = tmp_path / "deep" / "result.parquet", ("--relative-error", "0.1")
    code, text, complaint, table = evaluate(*coarse, out="deep/result.parquet")
    assert (code, complaint) == (0, "") and "deep/result.parquet" in text
    assert table["id"].to_pylist() == list(range(ROWS))
    cells = text.splitlines()[1].split()
    assert cells[:2] == [str(ROWS), str(ROWS)] and cells[2].endswith("%")
    assert float(cells[3].replace(",", "")) == pytest.approx(table["count"].to_numpy().mean(), rel=0.01)
    # The same command writes the same bytes on any number of threads; another seed, estimator or footprint does not.
    first = path.read_bytes()
    others = ("--seed", "1"), ("--estimator", "mc"), ("--footprint", "box"), ("--no-parallax",), ("--walls", "left_out")
    for choice in ((), ("--workers", "1"), *others):
        assert evaluate(*coarse, *choice, out="deep/result.parquet")[0] == 0
        assert (path.read_bytes() == first) == (not choice or choice[0] == "--workers"), choice


@pytest.mark.parametrize(("stop", "code"), [(KeyboardInterrupt(), 130), (exits._Stopped(signal.SIGTERM), 143)])
def test_a_stop_says_that_nothing_was_written(evaluate, tmp_path, monkeypatch, stop, code):
    monkeypatch.setattr(pipeline.shards.evaluate, "estimate", Mock(side_effect=stop))
    assert evaluate() == (code, "", "stopped; result.parquet was not written", None)
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
    evaluate()
    (tmp_path / "result.parquet").unlink()
    start = f"import sys; sys.path.insert(0, {str(Path(__file__).parents[3])!r})\n{code}"
    assert subprocess.run([sys.executable, "-c", start], cwd=tmp_path).returncode == -signal.SIGKILL
    left = {path.name for path in tmp_path.iterdir()}
    assert left <= {"queries.parquet", ".tmp-result.parquet", ".tmp-result.bad.csv"} and ".tmp-result.parquet" in left
    code, _, _, table = evaluate("--skip-bad")
    assert code == 0 and table.num_rows == ROWS
    assert sorted(path.name for path in tmp_path.iterdir()) == ["queries.parquet", "result.bad.csv", "result.parquet"]


@pytest.fixture(scope="module")
def network():
    torch.manual_seed(3)
    return WovenNetwork(SMALL).eval()


@pytest.fixture
def folder(network, tmp_path):
    """Return a folder with a model as training leaves it, taught on two fabrics."""
    domain = Domain.of({}, [load_fabric("denim"), load_fabric("silk_charmeuse")])
    card = {"model": "woven", "version": {"model": SMALL.version}, "domain": domain.model_dump(mode="json")}
    card |= {"options": SMALL.model_dump(mode="json", context=IDENTITY)}
    write_model(tmp_path / "model", safetensors.torch.save(network.state_dict()), card)
    return tmp_path / "model"


def test_a_model_answers_and_states_no_error(network, evaluate, folder):
    code, _, _, table = evaluate("--model", folder)
    assert code == 0
    found = np.stack([table[name].to_numpy() for name in COMPONENTS], axis=1)
    np.testing.assert_allclose(found, Woven(network).predict(load_fabric("denim"), QUERIES), rtol=1e-5, atol=1e-7)
    assert table["specular_warp_standard_error"].null_count == ROWS
    about = json.loads(table.schema.metadata[b"twillight"])
    assert about["model"] == "woven" and json.loads(about["card"])["model"] == "woven"


def test_a_fabric_that_it_was_not_taught_is_refused_unless_it_is_asked_to_extrapolate(evaluate, folder):
    code, _, complaint, table = evaluate("--model", folder, fabric="gauze")
    assert code == 2 and "roughness = 0.6: the model woven was trained on" in complaint and table is None
    code, _, _, table = evaluate("--model", folder, "--extrapolate", fabric="gauze")
    assert code == 0 and table.num_rows == ROWS


def test_rows_it_was_not_taught_are_named_before_anything_is_computed_and_can_be_skipped(evaluate, folder, tmp_path):
    """Row 3,000 of 3,001 lies beyond the first run of rows that a thread answers."""
    queries = drawn(3001)
    queries.wi[3000] *= np.float32([1, 1, -1])
    code, _, complaint, table = evaluate("--model", folder, queries=queries)
    assert code == 2 and "row 3000" in complaint and table is None
    assert "the model woven was trained for light from the viewer's side only" in complaint
    code, text, complaint, table = evaluate("--model", folder, "--skip-bad", queries=queries)
    assert (code, complaint) == (0, "") and "1 bad row has no answer; see result.bad.csv" in text
    assert table["diffuse_warp"].null_count == 1 and "3000" in (tmp_path / "result.bad.csv").read_text()
