import math

import pytest

from reports.record import Provenance, Record
from reports.tables.scene_rows import scene_columns, scene_rows
from reports.tables.summary import scene_table


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


def test_a_scene_has_the_range_over_trainings_beside_its_interval():
    several = [
        one.model_copy(update={"value": factor * one.value, "provenance": Provenance(model="net", seed=factor)})
        for one in RECORDS[:4]
        for factor in (1, 2, 3)
        if one.metric in ("mse", "psnr", "colour_rrmse", "flicker")
    ]
    table = scene_table([*several, *RECORDS[4:]])
    woven, points = table.to_dict("records")
    assert (woven["seeds"], woven["mse"], woven["ratio"], woven["frame_time"]) == pytest.approx((3, 4e-3, 2.0, 12.5))
    titles = [column.title for column in scene_columns(table)]
    (shown, points) = (group["rows"][0]["cells"] for group in scene_rows(table)["attic"]["groups"])
    ranges = {title: cell["range"] for title, cell in zip(titles, shown, strict=True)}
    assert ranges["MSE"] == "[2.00 … 6.00]e−3" and ranges["PSNR, dB"] == "[31.2 … 93.8]"
    assert ranges["colour"] == "[0 … 0]" and ranges["ms a frame"] == "" and ranges["flicker"] == "[−6.00 … −2.00]e−3"
    assert not any(cell["range"] for cell in points)


@pytest.fixture
def table():
    return scene_table(RECORDS)


def test_the_table_keeps_intervals_and_floors(table):
    woven, points = table.to_dict("records")
    assert (woven["mse_low"], woven["mse"], woven["mse_high"]) == (1.8e-3, 2e-3, 2.3e-3)
    assert (woven["psnr_floor"], woven["truth_noise"], woven["ratio"]) == pytest.approx((40.0, 1e-5, 4.0))
    assert math.isnan(points["psnr_low"]) and math.isnan(points["fovvideovdp"])
    assert scene_table([]).columns.tolist() == table.columns.tolist()


def test_numbers_have_their_intervals_beneath(table):
    titles = [column.title for column in scene_columns(table)]
    woven, points = (group["rows"][0]["cells"] for group in scene_rows(table)["attic"]["groups"])
    shown = {title: (cell["text"], cell["interval"]) for title, cell in zip(titles, woven, strict=True)}
    assert shown["MSE"] == ("2.00e−3", "(1.80 … 2.30)e−3")
    assert shown["PSNR, dB"] == ("31.2", "30.1 … 32.9")
    assert shown["colour"] == ("in the noise", "0 … 3.1")
    assert shown["flicker"] == ("−2.00e−3", "(−2.10 … 0.35)e−3")
    assert shown["ms a frame"] == ("12.5", "") and shown["SSIM"] == ("–", "")
    # Both are on the front: points cost less and err more.
    assert woven[-1]["best"] and points[-1]["best"] and not woven[0]["best"]


def test_the_last_row_is_the_truths_noise(table):
    titles = [column.title for column in scene_columns(table)]
    noise = dict(zip(titles, scene_rows(table)["attic"]["noise"], strict=True))
    assert noise["MSE"] == "1.00e−5" and noise["PSNR, dB"] == "40.0"
    assert noise["flicker"] == noise["ms a frame"] == noise["SSIM"] == "–"


def test_what_an_eye_sees_of_the_frames_has_a_column_where_it_was_measured(table):
    assert "FovVideoVDP, JOD" not in [column.title for column in scene_columns(table)]
    more = scene_table([*RECORDS, *measured("woven", fovvideovdp=9.12)])
    titles = [column.title for column in scene_columns(more)]
    woven, points = (group["rows"][0]["cells"] for group in scene_rows(more)["attic"]["groups"])
    place = titles.index("FovVideoVDP, JOD")
    assert (woven[place]["text"], points[place]["text"]) == ("9.12", "–")


def test_nothing_measured_gives_no_rows():
    assert scene_rows(scene_table([])) == {}


def test_an_error_in_the_noise_has_no_ratio_and_is_on_no_front():
    lost = measured("sums", mse=(-3e-6, -7e-6, 1e-6), frame_time=1.0)
    table = scene_table([*RECORDS, *lost])
    assert math.isnan(table["ratio"].iloc[-1]) and table["front"].tolist() == [True, True, False]
    cells = scene_rows(table)["attic"]["groups"][-1]["rows"][0]["cells"]
    assert [cell["text"] for cell in cells[1:3]] == ["in the noise", "–"]
    assert cells[1]["interval"] == "(−7.00 … 1.00)e−6"
