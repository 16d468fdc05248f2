import math
from dataclasses import dataclass
from typing import Annotated

import pytest

from reports.record import Record
from reports.truth.row_records import RowRecords


@dataclass(frozen=True)
class Row:
    light: str
    part: str
    fabric: str
    value: Annotated[float, "worst_error"]
    at: str
    failures: Annotated[int, "not_finite"]
    count: int
    rival: Annotated[float, "naive_error"] = math.inf


ROWS = RowRecords(Row, setting=("light", "part"), once={"note": "at"})
FOUND = [
    Row("front", "warp", "denim", 0.5, "x = 3", 2, 7, 0.25),
    Row("front", "weft", "denim", 0.1, "x = 4", 0, 7, 0.5),
]


def test_rows_are_one_record_a_number_and_come_back_equal_also_with_nan_and_methods():
    records = ROWS.to_records(FOUND)
    subject = Record(method="truth", setting="front | warp", fabric="denim", count=7)
    assert records[:3] == [
        subject.model_copy(update={"metric": metric, "value": value, "note": note})
        for metric, value, note in (("worst_error", 0.5, "x = 3"), ("naive_error", 0.25, ""), ("not_finite", 2.0, ""))
    ]
    assert ROWS.from_records(records) == FOUND and type(ROWS.from_records(records)[0].failures) is int
    records = ROWS.to_records([Row("front", "warp", "denim", 0.5, "", 2, 7, math.nan)])
    assert [record.metric for record in records] == ["worst_error", "not_finite"]
    assert ROWS.from_records(records)[0].rival == math.inf
    by_part = RowRecords(Row, setting=("light",), method_field="part")
    assert {(record.method, record.setting) for record in by_part.to_records(FOUND[:1])} == {("warp", "front")}


@pytest.mark.parametrize("about", [("front | warp", "mse"), ("front", "worst_error"), ("back | weft", "worst_error")])
def test_records_that_are_no_row_are_left_out(about):
    """Of another metric, of another setting, and of a row of which the rest is missing."""
    stray = Record(method="truth", setting=about[0], fabric="denim", metric=about[1], value=1.0)
    assert ROWS.from_records([stray, *ROWS.to_records(FOUND[:1])]) == FOUND[:1]
