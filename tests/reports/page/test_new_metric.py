"""A new metric is a measuring function and a row of the catalogue, and is on the page."""

import pandas as pd
import pytest

from reports import catalogue
from reports.catalogue import MetricRow
from reports.options import BenchOptions
from reports.page.content import ModelNote, PageInput
from reports.page.page import write_page
from reports.record import Record, read_records, this_machine


def measure_largest_error(method, answers, truth):
    """Measure a throw-away metric, as a file of `reports.measure` would."""
    error = max(abs(a - t) for a, t in zip(answers, truth, strict=True))
    return [Record(method=method).of("largest_error", error, len(truth))]


@pytest.fixture
def page():
    """Return a page of Records alone."""

    def of(records):
        options, machine = BenchOptions(), this_machine(1)
        return PageInput("tiny", "", "", "tiny", [], [ModelNote("woven", "a network")], options, records, machine, [])

    return of


@pytest.fixture
def largest_error(monkeypatch):
    """Add the metric's row."""
    row = MetricRow("largest_error", "largest error", "Largest error of all queries.", unit="1/sr", format="percent")
    monkeypatch.setitem(catalogue.METRICS, row.name, row)


def test_a_new_metric_reaches_records_tables_and_the_page(tmp_path, page, largest_error):
    found = measure_largest_error("woven", [0.5, 1.25], [0.5, 1.0])
    assert (found[0].value, found[0].unit, found[0].count) == (0.25, "1/sr", 2)
    text = write_page(tmp_path, page(found)).read_text(encoding="utf-8")
    assert "largest error, 1/sr (lower is better)" in text and "25.0 %" in text
    assert "Largest error of all queries." in text
    assert found[0] in read_records([tmp_path / "records.json"])
    table = pd.read_csv(tmp_path / "tables" / "other_metrics.csv")
    assert table[["method", "largest_error"]].values.tolist() == [["woven", 0.25]]


def test_without_such_metrics_the_page_has_no_such_section(tmp_path, page):
    text = write_page(tmp_path, page([])).read_text(encoding="utf-8")
    assert 'id="other"' not in text and not (tmp_path / "tables" / "other_metrics.csv").exists()
