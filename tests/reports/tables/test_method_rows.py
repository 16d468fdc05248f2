"""Rows of the page's tables of methods."""

from reports.measure.extremes import extremes_table
from reports.measure.latents import SHARES
from reports.record import Record
from reports.tables.method_rows import EXTREMES, edit_rows, extreme_rows, path_rows
from reports.tables.summary import path_table


def test_a_path_has_a_row_for_each_way_to_encode():
    subject = Record(method="woven", fabric="denim", note="yarns of satin_8")
    curves = [tuple((share, factor * (0.1 + share)) for share in SHARES) for factor in (2.0, 1.0)]
    names = ("path_error", "reencode_error")
    table = path_table(
        [subject.of(name, curve[1][1], 64, curve=curve) for name, curve in zip(names, curves, strict=True)]
    )
    assert table["error"].tolist() == [error for curve in curves for _, error in curve]
    found = path_rows(table)
    assert [row[:3] for row in found] == [
        ["woven", "denim → yarns of satin 8", "latents blended"],
        ["woven", "denim → yarns of satin 8", "encoded anew"],
    ]
    assert all(len(row) == 3 + len(SHARES) for row in found)


def test_edits_have_a_row_each():
    subject = Record(method="woven", fabric="denim")
    edits = [
        subject.of("encode_time", ms, 3, low=ms, high=ms).model_copy(update={"note": note})
        for note, ms in (("a yarn", 3.0), ("a colour", 0.1))
    ]
    assert [row[1] for row in edit_rows(edits)] == ["a yarn", "a colour"]


def test_no_records_give_no_rows():
    assert path_rows(path_table([])) == edit_rows([]) == []


def test_answers_that_are_not_finite_are_counted():
    subject = Record(method="m", setting="s", fabric="a")
    records = [subject.of("extreme_error", 0.5, 9, curve=((1.0, 0.1),))]
    records += [subject.of("extreme_not_finite", value, 90) for value in (3.0, 1.0)]
    ((line,),) = [group["rows"] for group in extreme_rows(extremes_table(records))]
    assert dict(zip(EXTREMES, line["cells"], strict=True))["NaN, ∞"] == "4 of 180 ✗"
