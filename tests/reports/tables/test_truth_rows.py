"""Rows about the ground truth itself."""

from reports.tables.truth_rows import calibration_rows
from reports.truth.calibration import RECORDS, Calibration

ROW = Calibration("auto", "solid", 0.9, 0.002, 0.8, 1.0, 1.0, 0.0, 100)


def test_records_of_before_intervals_are_shown_without_one():
    records = RECORDS.to_records([ROW])
    old = [record.model_copy(update={"low": None, "high": None}) for record in records]
    (without,), (cells,) = (calibration_rows(RECORDS.from_records(found)) for found in (old, records))
    assert without[2].startswith("0.90 · ") and cells[2].startswith("0.90 (0.80 to 1.00) · ")
