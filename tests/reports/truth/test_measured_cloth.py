import math

from pipeline.fitting.predicted import Errors
from reports.truth import measured_cloth
from reports.truth.measured_cloth import LABORATORY, RECORDS, measure


def test_predictions_come_back_from_their_records(monkeypatch):
    """Stated numbers have errors, those kept back only predictions; what a formula does not say has no row."""
    monkeypatch.setattr(measured_cloth, "held_out_rings", lambda *_: {"cosine": Errors(0.5, math.nan, math.nan)})
    found = list(measure())
    assert {row.quantity for row in found if row.method == "cosine"} == {"light straight through"}
    assert len([row for row in found if row.method == LABORATORY]) == 3
    sheets = [row for row in found if row.quantity.startswith("transmittance")]
    assert {"transmittance, visible", "transmittance, solar"} == {row.quantity for row in sheets}
    assert 0 < sum(math.isnan(row.error) for row in sheets) < len(sheets)
    assert all(row.low <= row.predicted <= row.high for row in sheets)
    back = RECORDS.from_records(RECORDS.to_records(found))
    assert [repr(row) for row in back] == [repr(row) for row in found]
