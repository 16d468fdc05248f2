import math

import pytest

from reports.record import Provenance, Record
from reports.tables.page_tables import page_frames, ranged_frames, result_tables
from reports.tables.sentences import facts
from reports.tables.summary import scene_table
from reports.tables.table import ResultTable, TableCell, TableRow, markdown_table, paragraphs
from reports.truth.calibration import RECORDS as CALIBRATIONS
from reports.truth.calibration import Calibration


def sections_of(records):
    """Return the tables of every section, from Records."""
    frames = ranged_frames(page_frames(records))
    return result_tables(records, frames, facts(records, frames["errors"]))


def cells_of(table, label):
    """Return the cells of a row by the titles of their columns."""
    (row,) = [row for row in table.rows if row.label.replace("\u00a0", " ") == label]
    titles = [title.replace("\u00a0", " ") for title in table.columns[1:]]
    return dict(zip(titles, row.cells, strict=True))


def test_a_table_groups_settings_of_a_method_and_a_paragraph_without_its_value_is_left_out():
    table = markdown_table(("method", "ns"), [("points", "12"), ("woven", "3")])
    assert table.splitlines() == ["| method | ns |", "| :-- | --: |", "| points | 12 |", "| woven | 3 |"]
    settings = ("a", "1"), ("a", "2"), ("b", "")
    rows = [TableRow(f"{name}", (TableCell("1"),), name, setting) for name, setting in settings]
    groups = ResultTable("t", ("method", "x"), tuple(rows)).groups
    assert [(head, len(part)) for head, part in groups] == [("a", 2), ("", 1)]
    assert paragraphs(["a {b}", "c"], {"b": 1}) == ["a 1", "c"] and paragraphs(["a {b}", "c"], {}) == ["c"]


def test_unseen_fabrics_have_geometric_means_and_a_single_one_no_network_trained_once(three_trainings, two_unseen):
    """Neumip was trained once: its errors on the unseen fabric have no range; woven's have."""
    sections = sections_of(three_trainings)
    labels = {table.key: [row.label for row in table.rows] for table in sections["aliasing"]}
    assert "NeuMIP" in labels["seen"] and "NeuMIP" not in labels["unseen"] and "woven" in labels["unseen"]
    for section in ("trade", "error"):
        unseen = [table for table in sections[section] if table.key == "unseen"]
        assert unseen and not any(row.label.startswith("NeuMIP") for table in unseen for row in table.rows)
    errors = page_frames(three_trainings)["errors"]
    assert len(errors[(errors["method"] == "neumip") & (errors["role"] == "unseen")]) == 1
    (over,) = [table for table in sections_of(two_unseen)["error"] if table.title.startswith("Means over unseen")]
    assert [row.label for row in over.rows][:1] == ["woven"] and "NeuMIP" not in [row.label for row in over.rows]
    ratio = cells_of(over, "woven")["× lower"]
    assert ratio.text == "2.2×" and ratio.interval.startswith("(")
    assert cells_of(over, "points, k = 2")["× lower"].text == "1"


def test_times_on_one_thread_and_on_most_stand_in_one_row():
    subject = Record(method="woven")
    records = [
        subject.model_copy(update={"threads": threads}).of("time", time, 25, low=0.9 * time, high=1.1 * time)
        for threads, time in ((4, 120.0), (1, 400.0), (2, 210.0))
    ]
    records += [one.of("processor_time", one.value / 1000.0, 25) for one in records]
    records += [subject.of("prepare_time", 12.5, 9), subject.of("peak_memory", 3e7, 3)]
    (timing,) = sections_of(records)["time"]
    shown = {title: cell.text for title, cell in cells_of(timing, "woven").items()}
    assert shown["ns a query"] == "400" and shown["ns a query, 4 threads"] == "120"
    assert shown["ms a frame"] == "829" and shown["ms a frame, 4 threads"] == "249"
    assert shown["ms to add a fabric"] == "12.5" and shown["memory of a call"] == "30.00 MB"
    assert shown["processor s a million"] == ".400" and "J a million" not in shown


def measured(method, setting="", **numbers):
    """Records of a method in the attic: numbers, or (number, low, high)."""
    subject = Record(method=method, setting=setting, scene="attic")
    found = []
    for metric, value in numbers.items():
        value, low, high = value if isinstance(value, tuple) else (value, None, None)
        found.append(subject.of(metric, value, 100, low=low, high=high))
    return found


RECORDS = [
    *measured("woven", mse=(2e-3, 1.8e-3, 2.3e-3), psnr=(31.25, 30.1, 32.9), colour_rrmse=(0.0, 0.0, 0.031)),
    *measured("woven", flicker=(-0.002, -0.0021, 0.00035), frame_time=12.5, truth_noise=1e-5, psnr_floor=40.0),
    *measured("point_sampled", "k = 2", mse=(8e-3, 7e-3, 1.2e-2), frame_time=5.0, truth_noise=1e-5, psnr_floor=40.0),
]


def attic(records):
    (table,) = sections_of(records)["scenes"]
    return table


def test_numbers_of_a_scene_have_intervals_and_ranges_and_the_last_row_is_the_truths_noise():
    several = [
        one.model_copy(update={"value": factor * one.value, "provenance": Provenance(model="net", seed=factor)})
        for one in RECORDS[:4]
        for factor in (1, 2, 3)
        if one.metric in ("mse", "psnr", "colour_rrmse", "flicker")
    ]
    records = [*several, *RECORDS[4:]]
    woven, _ = scene_table(records).to_dict("records")
    assert (woven["seeds"], woven["mse"], woven["ratio"], woven["frame_time"]) == pytest.approx((3, 4e-3, 2.0, 12.5))
    ranges = {title: cell.range for title, cell in cells_of(attic(records), "woven").items()}
    assert ranges["MSE"] == "[2.00 … 6.00]e−3" and ranges["PSNR, dB"] == "[31.2 … 93.8]"
    assert ranges["colour"] == "[0 … 0]" and ranges["ms a frame"] == "" and ranges["flicker"] == "[−6.00 … −2.00]e−3"
    assert not any(cell.range for cell in cells_of(attic(records), "points, k = 2").values())
    table = attic(RECORDS)
    shown = {title: (cell.text, cell.interval) for title, cell in cells_of(table, "woven").items()}
    assert shown["MSE"] == ("2.00e−3", "(1.80 … 2.30)e−3") and shown["PSNR, dB"] == ("31.2", "(30.1 … 32.9)")
    assert shown["colour"] == ("in the noise", "(0 … 3.1 %)")
    assert shown["flicker"] == ("−2.00e−3", "(−2.10 … 0.35)e−3")
    assert shown["ms a frame"] == ("12.5", "") and shown["SSIM"] == ("–", "")
    # Both are on the front: points cost less and err more.
    assert [cells_of(table, name)["ms a frame"].strong for name in ("woven", "points, k = 2")] == [True, True]
    noise = {title: cell.text for title, cell in cells_of(table, "noise of the truth").items()}
    assert noise["MSE"] == "1.00e−5" and noise["PSNR, dB"] == "40.0" and table.rows[-1].kind == "noise"
    assert noise["flicker"] == noise["ms a frame"] == noise["SSIM"] == "–"


def test_an_error_in_the_noise_has_no_ratio_and_records_of_before_intervals_none():
    records = [*RECORDS, *measured("sums", mse=(-3e-6, -7e-6, 1e-6), frame_time=1.0)]
    frame = scene_table(records)
    assert math.isnan(frame["ratio"].iloc[-1]) and frame["front"].tolist() == [True, True, False]
    sums = cells_of(attic(records), "sums")
    assert (sums["MSE"].text, sums["× lower"].text) == ("in the noise", "–")
    assert sums["MSE"].interval == "(−7.00 … 1.00)e−6"
    records = CALIBRATIONS.to_records([Calibration("auto", "solid", 0.9, 0.002, 0.8, 1.0, 1.0, 0.0, 100)])
    old = [record.model_copy(update={"low": None, "high": None}) for record in records]
    shown = [str(sections_of(found)["accuracy"][0].rows[0].cells[1]) for found in (old, records)]
    assert shown == ["0.90", "0.90 (0.80 … 1.00)"]
    assert "FovVideoVDP, JOD" not in cells_of(attic(RECORDS), "woven")
    more = attic([*RECORDS, *measured("woven", fovvideovdp=9.12)])
    assert [cells_of(more, name)["FovVideoVDP, JOD"].text for name in ("woven", "points, k = 2")] == ["9.12", "–"]
