import io
from pathlib import Path

import matplotlib.image
import numpy as np
import pandas as pd

from pipeline.models.added.added_code import ADDED_MODEL
from reports.images import tiles
from reports.page.content import ModelNote, PictureFile
from reports.page.pictures import FRAME_GAP, MOST_FILMS, SHOWN, films, filmstrip, liveliest, strips
from weaves.colour import EXPOSURE


def file(method, setting="", scene="attic", fabric=""):
    return PictureFile(fabric, scene, method, setting, Path("x.exr"))


def test_a_film_shows_the_truth_and_every_method_once_or_of_many_the_first():
    shown = [file("truth"), file("woven"), file("point_sampled", "k = 2"), file("quadrature", "k = 16")]
    truth, woven, points, quadrature = shown
    of_fabric = file("woven", scene="plane", fabric="denim")
    pictures = [of_fabric, woven, points, file("point_sampled", "k = 16"), truth, quadrature]
    assert films(pictures) == {"attic": shown}
    many = [file("truth"), *(file(f"variant_{index}") for index in range(20)), file("point_sampled", "k = 2")]
    assert films(many) == {"attic": [*many[: MOST_FILMS - 1], many[-1]]}


def test_strips_say_their_errors_in_order_with_the_first_of_each_kind_in_front():
    sphere, plane = ({"scene": scene, "fabric": "denim"} for scene in ("sphere", "plane"))
    pictures = [file("woven"), file("woven", **plane), file("truth"), file("woven", **sphere), file("truth", **sphere)]
    pictures.append(file("truth", scene="plane", fabric="basket"))
    errors = [
        pd.DataFrame([("denim", "sphere", "woven", "", 2e-3)], columns=["fabric", "scene", "method", "setting", "mse"]),
        pd.DataFrame([("attic", "woven", "", 5e-4)], columns=["scene", "method", "setting", "mse"]),
    ]
    found = strips(pictures, ["basket", "denim"], ["sphere", "plane", "attic"], errors)
    assert [(strip.fabric, strip.scene) for strip in found] == [
        ("basket", "plane"), ("denim", "sphere"), ("denim", "plane"), ("", "attic"),
    ]  # fmt: skip
    assert [cell["method"] for cell in found[1].cells] == ["truth", "woven"]
    assert [strip.cells[-1]["mse"] for strip in found[1:]] == ["2.00e−3", "–", "5.00e−4"]
    names = ["truth", "wide", "wider", "point_sampled", "own"]
    kinds = {"wide": "woven", "wider": "woven", "own": ADDED_MODEL}
    notes = [ModelNote(name, "", kind=kinds.get(name, name)) for name in names[1:]]
    pictures = [file(name) for name in names] + [file("point_sampled", "k = 16")]
    (strip,) = strips(pictures, [], ["attic"], [], notes)
    order = ["truth", "own", "wide", "points", "wider", "points, k\u00a0=\u00a016"]
    assert [cell["label"] for cell in strip.cells] == order


def test_every_row_shows_its_frames_and_a_slice_over_time():
    frames = np.linspace(0.0, 0.6, 8 * 12 * 20 * 3).reshape(8, 12, 20, 3)
    picture = matplotlib.image.imread(io.BytesIO(filmstrip({"truth": frames, "points": frames[::-1]})), format="png")
    shown = np.rint(255 * picture).astype(int)[:: tiles.SCALE, :: tiles.SCALE]
    assert shown.shape == (2 * 12 + FRAME_GAP, (SHOWN + 1) * 20 + (SHOWN + 2) * FRAME_GAP, 4)
    codes = tiles.encoded(EXPOSURE * frames)
    for row, order in enumerate((range(SHOWN), range(7, 7 - SHOWN, -1))):
        line = shown[row * (12 + FRAME_GAP) :][:12]
        for place, frame in enumerate(order):
            assert (line[:, place * (20 + FRAME_GAP) :][:, :20, :3] == codes[frame]).all()
        assert (line[:, -20:, :3] == codes[list(order)][np.arange(12) // 2, 6]).all()
    assert (shown[12 : 12 + FRAME_GAP, :, 3] == 0).all()


def test_the_liveliest_crop_holds_what_moves():
    """Films stand still but for one patch: the crop contains it, whichever film it is in; small films are whole."""
    still = np.zeros((3, 64, 120, 3))
    moving = still.copy()
    moving[1, 40:52, 70:90] = 0.5
    rows, columns = liveliest({"truth": still, "points": moving}, (16, 32))
    assert rows.stop - rows.start == 16 and columns.stop - columns.start == 32
    assert rows.start <= 40 and rows.stop >= 52 and columns.start <= 70 and columns.stop >= 90
    assert liveliest({"truth": still}, (16, 32)) == (slice(0, 16), slice(0, 32))
    assert liveliest({"truth": moving}, (100, 200)) == (slice(0, 64), slice(0, 120))
