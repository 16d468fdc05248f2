from pathlib import Path

import pandas as pd
import pytest

from reports.page.picture_strips import MOST_FILMS, PictureFile, films, strips


def file(method, setting="", scene="attic", fabric=""):
    return PictureFile(fabric, scene, method, setting, Path("x.exr"))


def test_a_film_shows_the_truth_and_every_method_once():
    pictures = [
        file("woven", scene="plane", fabric="denim"),
        file("woven"),
        file("point_sampled", "k = 2"),
        file("point_sampled", "k = 16"),
        file("truth"),
        file("quadrature", "k = 16"),
    ]
    (rows,) = films(pictures).values()
    assert [(row.method, row.setting) for row in rows] == [
        ("truth", ""),
        ("woven", ""),
        ("point_sampled", "k = 2"),
        ("quadrature", "k = 16"),
    ]


def test_of_many_methods_the_first_and_the_baseline_stay():
    many = [file("truth"), *(file(f"variant_{index}") for index in range(20)), file("point_sampled", "k = 2")]
    (rows,) = films(many).values()
    assert len(rows) == MOST_FILMS
    assert rows[0].method == "truth" and rows[-1].method == "point_sampled"
    assert [row.method for row in rows[1:-1]] == [f"variant_{index}" for index in range(MOST_FILMS - 2)]


def test_strips_are_in_order_and_say_their_errors():
    pictures = [
        file("woven"),
        file("woven", scene="plane", fabric="denim"),
        file("truth"),
        file("woven", scene="sphere", fabric="denim"),
        file("truth", scene="sphere", fabric="denim"),
        file("truth", scene="plane", fabric="basket"),
    ]
    errors = [
        pd.DataFrame([("denim", "sphere", "woven", "", 2e-3)], columns=["fabric", "scene", "method", "setting", "mse"]),
        pd.DataFrame([("attic", "woven", "", 5e-4)], columns=["scene", "method", "setting", "mse"]),
    ]
    found = strips(pictures, {"basket": "seen", "denim": "unseen"}, ["sphere", "plane", "attic"], errors)
    assert [(strip.fabric, strip.scene) for strip in found] == [
        ("basket", "plane"), ("denim", "sphere"), ("denim", "plane"), ("", "attic"),
    ]  # fmt: skip
    assert found[1].role == "unseen"
    assert [cell["method"] for cell in found[1].cells] == ["truth", "woven"]
    assert [strip.cells[-1]["mse"] for strip in found[1:]] == ["2.00e−3", "–", "5.00e−4"]


@pytest.mark.parametrize(
    ("picture", "stem"),
    [
        (file("point_sampled", "k = 2"), "scene-attic-point_sampled-k-2"),
        (file("truth", fabric="denim"), "denim-attic-truth"),
    ],
)
def test_stems_hold_no_spaces(picture, stem):
    assert picture.stem == stem
