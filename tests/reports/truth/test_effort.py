import pytest

from reports.truth.effort import CLASSES, RECORDS, measure


def test_shares_add_up_and_records_bring_them_back():
    found = list(measure(rows=100, fabrics=["polyester_lining"]))
    assert [row.kind for row in found] == list(CLASSES) and sum(row.share for row in found) == pytest.approx(1.0)
    assert RECORDS.from_records(RECORDS.to_records(found)) == found
