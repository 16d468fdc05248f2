from itertools import pairwise

import pytest

from pipeline.models.catalogue import CLASSES
from reports.page import figures
from reports.page.colours import DARK, LIGHT, MARKS, METHODS
from reports.tables import summary
from reports.tables.number_format import NAMES

SCHEMES = pytest.mark.parametrize("scheme", [LIGHT, DARK], ids=lambda scheme: scheme.name)


def test_rows_of_a_method_stand_together_and_of_its_spectra_the_last_is_drawn(made_up):
    mixed = summary.error_table(made_up).iloc[::-1].reset_index(drop=True)
    figure = figures.errors(LIGHT, mixed, summary.fabric_table(made_up))
    labels = [label.get_text().replace("\u00a0", " ") for label in figure.axes[0].get_yticklabels()]
    assert labels == ["points, k = 64", "k = 16", "k = 4", "k = 2", "k = 1", "NeuMIP", "woven"]
    assert [b - a for a, b in pairwise(figure.axes[0].get_yticks())] == [1, 1, 1, 1, 1.5, 1]
    (axes,) = figures.spectra(LIGHT, summary.spectra(made_up)).axes
    labels = {text.get_text().replace("\u00a0", " ") for text in axes.texts}
    assert {"points, k = 2", "points, k = 64", "woven", "NeuMIP", "truth"} <= labels
    assert "points, k = 16" not in labels and "points, k = 1" not in labels


def test_ticks_are_few_powers_of_ten_and_names_keep_their_colours_for_good():
    assert figures._signed_decades([0.02, -0.0005], 1e-3) == pytest.approx([0, 1e-3, 1e-2])
    ticks = figures._signed_decades([-0.3, 2.0, 1e-5], 1e-5)
    assert len(ticks) <= 7 and 0.0 in ticks and 1.0 in ticks and -0.1 in ticks
    assert figures._signed_decades([], 1e-5) == [0.0]
    # Two models of one kind differ, and a plot of the second alone shows it as the plot of both does.
    page = LIGHT.naming(["truth", "woven", "wide", "deep"])
    assert page.colours(["deep"])["deep"] == page.colours(["wide", "deep"])["deep"]
    assert page.colours(["deep"])["deep"] not in (page.colours(["wide"])["wide"], page.methods["woven"])
    assert LIGHT.colours(["deep"])["deep"] != page.colours(["deep"])["deep"]
    assert len({page.marker(name) for name in ("deep", "wide", "woven", "point_sampled")}) == 4
    # Two dozen unknown names are told apart by colour and mark.
    names = [f"variant_{index}" for index in range(24)]
    page = LIGHT.naming(["truth", "woven", *names])
    assert len({(page.methods[name], page.marker(name)) for name in names}) == len(names)


@pytest.mark.parametrize("count", [1, 5, 40])
def test_labels_keep_apart(count):
    places = figures._apart([0.1 * (index // 3) for index in range(count)], 0.2, 3.0)
    assert all(b - a >= 0.2 - 1e-9 for a, b in pairwise(places)) and places[-1] <= 3.0


@SCHEMES
def test_every_method_has_a_colour_and_a_mark_of_its_own(scheme):
    assert len({*(mark for mark, _, _ in METHODS.values()), *MARKS}) == len(METHODS) + len(MARKS)
    names = ["truth", "woven", "neumip", "point_sampled", "woven_wide", "another"]
    colours = scheme.colours(names)
    assert len(set(colours.values())) == len(names)
    assert scheme.colours(["woven", "woven"]) == {"woven": colours["woven"]}
    assert {*CLASSES, *NAMES} <= set(scheme.methods)
    assert len(set(scheme.methods.values()) | set(scheme.others)) == len(scheme.methods) + len(scheme.others)
