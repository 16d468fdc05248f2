import itertools
import math

import pandas as pd
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg

from reports.page import front_figures
from reports.page.colours import LIGHT
from reports.page.figures import render
from reports.tables import summary
from reports.tables.tradeoff import tradeoff_table

SCENES = ["scene", "method", "setting", "mse", "flip_hdr", "flicker", "frame_time"]


@pytest.fixture(scope="module")
def table(made_up):
    timing = summary.timing_table(made_up)
    return tradeoff_table(summary.error_table(made_up), timing, summary.aliasing_table(made_up))


@pytest.fixture(scope="module")
def costs(table):
    return table[table["role"] == "seen"].set_index(["method", "setting"])["ns"]


def test_settings_are_curves_flicker_a_distance_and_bytes_have_a_front_of_their_own(table, costs):
    """Made up: points of k cost 400 k and err 1/k, woven and NeuMIP lie at k = 9 like points: all are on the front
    but NeuMIP, which costs more than woven at the same error."""
    figure = front_figures.error_against_time(LIGHT, table)
    line = figure.axes[0].lines[0]
    assert sorted(line.get_xdata()) == list(line.get_xdata()) and len(line.get_xdata()) == 6
    assert costs["woven", ""] in line.get_xdata() and costs["neumip", ""] not in line.get_xdata()
    curves = {len(line.get_xdata()) for line in figure.axes[0].lines[1:]}
    assert curves == {1, 5}  # woven and NeuMIP; points of 1, 2, 4, 16, 64
    assert {text.get_text() for text in figure.axes[0].texts} == {"1", "2", "64", ""}  # 2 is the baseline, "" the arrow
    names = [text.get_text() for text in figure.legends[0].get_texts()]
    assert names == ["woven", "NeuMIP", "points", "woven in its paper: 2.0× lower at 0.83× the time"]
    # Made up: points flicker by .3 / k at 400 k ns; woven, whose flicker is -.001, is on the front at k = 9's time.
    figure = front_figures.aliasing_against_time(LIGHT, table)
    band = dict(zip(*(figure.axes[0].lines[0].get_xydata().T), strict=True))
    assert band[costs["woven", ""]] == pytest.approx(1e-3)
    assert band[costs["point_sampled", "k = 2"]] == pytest.approx(0.15)
    # Beyond woven nothing flickers less: 64 points flicker by .3 / 64.
    assert costs["point_sampled", "k = 64"] not in band and costs["neumip", ""] not in band
    assert not any("paper" in text.get_text() for text in figure.legends[0].get_texts())
    # Made up: methods store 2,000 bytes and their index: woven the fewest; points err less than it from 16 on.
    figure = front_figures.error_against_bytes(LIGHT, table)
    band = figure.axes[0].lines[0].get_xydata()
    assert list(band[:, 0]) == [2000.0, 2005.0, 2006.0]  # woven, then 16 and 64 points


def test_no_label_covers_another_or_a_mark_or_leaves_its_panel():
    """Five methods of nearly one time and error, each with two labelled ends, a few pixels apart."""
    rows = [(f"m{k}", 1000.0 * (1 + 0.02 * k), 0.03 * (1 + 0.01 * k), setting) for k in range(5) for setting in "ab"]
    table = pd.DataFrame(rows, columns=["method", "ns", "flicker", "setting"])
    table.loc[table["setting"] == "b", "ns"] *= 1.2
    table = pd.concat([table, pd.DataFrame([("far", 9e3, 0.3, "a"), ("near", 1e2, 0.01, "a")], columns=table.columns)])
    figure = front_figures.aliasing_against_time(LIGHT, table.assign(role="seen", front_flicker=False))
    (axes,), canvas = figure.axes, FigureCanvasAgg(figure)
    canvas.draw()
    boxes = [text.get_window_extent(canvas.get_renderer()) for text in axes.texts]
    assert len(boxes) == 12 and not any(a.overlaps(b) for a, b in itertools.combinations(boxes, 2))
    marks = axes.transData.transform(table[["ns", "flicker"]].to_numpy())
    assert not any(box.contains(*mark) for box in boxes for mark in marks)
    assert all(axes.bbox.contains(*box.p0) and axes.bbox.contains(*box.p1) for box in boxes)


def test_scenes_mark_their_fronts_and_what_cannot_be_drawn_has_no_panel():
    attic = [
        ("attic", "point_sampled", "k = 2", 0.2, 0.4, -0.1, 10.0),
        ("attic", "point_sampled", "k = 16", 0.02, 0.2, 0.01, 80.0),
        ("attic", "woven", "", 0.03, 0.3, 0.0, 90.0),
    ]
    table = pd.DataFrame(attic, columns=SCENES)
    figure = front_figures.scenes(LIGHT, table)
    above, _, below = figure.axes
    assert above.lines[0].get_xydata().tolist() == [[10.0, 0.2], [80.0, 0.02]]  # woven is beaten
    # A flicker of 0 is the truth's and cannot be drawn; one below 0 is drawn by its size.
    assert below.lines[0].get_xydata().tolist() == [[10.0, 0.1], [80.0, 0.01]]
    (arrow,) = [text for text in above.texts if text.arrow_patch]
    assert arrow.xy == pytest.approx((8.3, 0.2 / 4.1)) and not below.texts
    assert figure.legends[0].get_texts()[-1].get_text() == "woven in its paper: 4.1× lower at 0.83× the time"
    # One scene was not timed; in the other nothing flickers.
    scenes = [("attic", "woven", "", 0.2, 0.4, -0.1, math.nan), ("cellar", "woven", "", 0.2, 0.4, 0.0, 5.0)]
    table = pd.DataFrame(scenes, columns=SCENES)
    figure = front_figures.scenes(LIGHT, table)
    assert [axes.get_title() for axes in figure.axes] == ["cellar", ""]
    assert [axes.get_ylabel() for axes in figure.axes] == ["MSE", "HDR-FLIP"]
    assert render(front_figures.scenes, LIGHT, table)
