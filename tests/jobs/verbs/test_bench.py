"""Measurements without a recipe: what they refuse, what they leave, and that a page follows them."""

import json

import numpy as np
import pytest

from jobs.cli import main
from jobs.plan.plan import plan
from jobs.recipe.load import load_recipe, recipe_names
from jobs.run.ledger import Ledger
from jobs.run.receipt import measure
from jobs.verbs.bench import BENCHES, RECORDS, STABILITY, TRUTH, measured_alone
from reports.record import read_records
from reports.truth import (
    accuracy,
    bias,
    calibration,
    effort,
    footprint_colours,
    path_traced,
    sampling,
    stability,
    throughput,
)
from reports.truth.accuracy import Accuracy
from reports.truth.bias import Bias
from reports.truth.calibration import Calibration
from reports.truth.effort import Effort
from reports.truth.finding import RECORDS as FINDINGS
from reports.truth.finding import judge
from reports.truth.footprint_colours import ColourLoss
from reports.truth.path_traced import Traced
from reports.truth.sampling import Saving


@pytest.mark.parametrize("name", ["stability", "truth"])
@pytest.mark.parametrize("option", [("--scheduler", "tcp://nowhere:1"), ("--workers", "2")])
def test_a_scheduler_or_workers_are_refused(tmp_path, capsys, name, option):
    assert main(["bench", name, "--out", str(tmp_path), *option]) == 2
    complaint = capsys.readouterr().err
    assert complaint.count("\n") == 1
    assert f"bench {name}" in complaint and option[0] in complaint and "this process" in complaint
    assert not list(tmp_path.iterdir())


def test_the_truth_is_measured_shown_and_recorded(tmp_path, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "200")
    rates = [throughput.Rate("points", "denim", 1.0e6, 0.9e6, 1.1e6, "points/s", "a note")]
    accuracies = [Accuracy("owen, 64 points", "denim", 0.05, 0.04, 0.03, 64.0, 5000.0, 3.0, 1e-4, 10)]
    biases = [Bias("denim", "light behind", "diffuse_weft", -0.001, 0.0002, 10)]
    efforts = [Effort("table alone", "denim", 0.8, 4000.0, 2e-5, 10), Effort("sampled", "denim", 0.2, 9e3, 2e-3, 10)]
    calibrations = [Calibration("auto", "solid", 0.98, 0.002, 0.9, 1.06, 1.01, 0.003, 2000)]
    losses = [ColourLoss("denim", "1.0", 0.02, -0.001, 1e-6, 1e-3, 10)]
    measured = {
        throughput: rates,
        accuracy: accuracies,
        calibration: calibrations,
        bias: biases,
        effort: efforts,
        footprint_colours: losses,
    }
    for module, found in measured.items():
        monkeypatch.setattr(module, "measure", lambda found=found: iter(found))
    assert main(["bench", "truth", "--out", str(tmp_path)]) == 0
    text = " ".join(capsys.readouterr().out.split())
    for words in ("1e+06 points/s a note", "owen, 64 points 5.00 % 4.00 % 3.00 % 64 5,000 3×", "table alone 80.0 %"):
        assert words in text, text
    assert "−0.10 ± 0.02 % ✓" in text
    records = read_records([tmp_path / TRUTH])
    assert accuracy.RECORDS.from_records(records) == accuracies
    assert calibration.RECORDS.from_records(records) == calibrations
    assert bias.RECORDS.from_records(records) == biases
    assert effort.RECORDS.from_records(records) == efforts
    assert footprint_colours.RECORDS.from_records(records) == losses
    assert [record.value for record in records if record.metric == "rate"] == [1.0e6]


@pytest.mark.parametrize(
    ("name", "module", "row", "cell"),
    [
        ("sampler", sampling, Saving("lobes", "denim", 8.0, 5.0, 900.0, 2100.0, 100), "8× · 5× · 900 ns"),
        ("mitsuba", path_traced, Traced("soft_nodes:2", "drape", "4", 2.5e-3, 1.5, 4, 3.2), "2.5e-03"),
    ],
)
def test_one_table_is_shown_and_recorded(tmp_path, capsys, monkeypatch, name, module, row, cell):
    monkeypatch.setenv("COLUMNS", "200")
    monkeypatch.setattr(module, "measure", lambda: iter([row]))
    assert main(["bench", name, "--out", str(tmp_path)]) == 0
    text = capsys.readouterr().out
    assert row.fabric in text and cell in text, text
    assert module.RECORDS.from_records(read_records([tmp_path / "records" / f"{name}.json"])) == [row]


def test_what_was_measured_alone_is_known_by_its_content(tmp_path):
    assert measured_alone(tmp_path) == {}
    path = tmp_path / STABILITY
    path.parent.mkdir()
    path.write_text("[]")
    first = measured_alone(tmp_path)
    assert list(first) == [STABILITY]
    path.write_text("[ ]")
    assert measured_alone(tmp_path)[STABILITY] != first[STABILITY]
    path.unlink()
    assert measured_alone(tmp_path) == {}


@pytest.mark.parametrize("name", RECORDS)
def test_the_page_alone_is_made_again_when_they_change(files, tmp_path, name):
    recipe, out = load_recipe(files.write()), tmp_path / "out"
    ledger, records = Ledger(out), out / name
    tasks = plan(recipe, measured_alone(out))
    for task in tasks:
        for product in task.products:
            (out / product).parent.mkdir(parents=True, exist_ok=True)
            (out / product).write_text("made")
        ledger.finish(task, {(out / p).name: measure(out / p) for p in task.products}, 1.0)

    def missing():
        return [task.stage for task in plan(recipe, measured_alone(out)) if ledger.state(task) != "done"]

    assert missing() == []
    for value in (1.0, 2.0):
        records.write_text(json.dumps([{"method": "truth", "metric": "rate", "value": value}]))
        assert missing() == ["report"]
    records.unlink()
    assert missing() == []


def test_no_recipe_bears_the_name_of_a_measurement():
    assert not set(BENCHES) & set(recipe_names())


@pytest.mark.parametrize(("value", "code"), [(1.0, 0), (1.1, 1)])
def test_the_verb_writes_records_and_fails_if_an_expression_does(monkeypatch, tmp_path, capsys, value, code):
    finding = judge("x", "corner", "float32", {"x": np.arange(1)}, [value], [1.0], 1e-6)
    monkeypatch.setattr(stability, "stability", lambda progress: [finding])
    assert main(["bench", "stability", "--out", str(tmp_path)]) == code
    shown = capsys.readouterr()
    assert ("limit" if code else "ok") in shown.out
    assert ("x in float32, corner: worst error 1.0e-01" in shown.err) == bool(code)
    assert FINDINGS.from_records(read_records([tmp_path / STABILITY]))[0].worst == pytest.approx(value - 1)
