import io

import matplotlib.image
import pytest

from reports import figures, summary
from reports.style import DARK, LIGHT, display, render

PLOTS = ["errors", "error_against_time", "aliasing", "spectra", "timing"]


@pytest.fixture(scope="module")
def data(made_up):
    errors, timing = summary.error_table(made_up), summary.timing_table(made_up)
    return {
        "errors": (errors, summary.fabric_table(made_up)),
        "error_against_time": (errors, timing),
        "aliasing": (summary.aliasing_table(made_up),),
        "spectra": (summary.spectra(made_up),),
        "timing": (timing,),
    }


@pytest.mark.parametrize("name", PLOTS)
@pytest.mark.parametrize("scheme", [LIGHT, DARK], ids=lambda scheme: scheme.name)
def test_plots_have_a_clear_ground_and_ink_on_it(name, scheme, data):
    picture = matplotlib.image.imread(io.BytesIO(render(getattr(figures, name), scheme, *data[name])), format="png")
    assert picture.shape[1] > 1500
    assert picture[0, 0, 3] == 0
    assert (picture[..., 3] == 1).mean() > 0.002


def test_equal_data_give_equal_bytes(data):
    drawn = [render(figures.timing, LIGHT, *data["timing"]) for _ in range(2)]
    assert drawn[0] == drawn[1]
    assert b"Software" not in drawn[0]


def test_front_holds_what_nothing_beats_on_both(data):
    """Made up: points of k cost 400 k and err 1/k, woven and NeuMIP lie at k = 9 like points: all are on the front
    but NeuMIP, which costs more than woven at the same error."""
    errors, timing = data["error_against_time"]
    figure = figures.error_against_time(LIGHT, errors, timing)
    line = figure.axes[0].lines[0]
    assert sorted(line.get_xdata()) == list(line.get_xdata())
    costs = timing.set_index(["method", "setting"])["median_ns"]
    assert costs["neumip", ""] not in line.get_xdata()
    assert costs["woven", ""] in line.get_xdata()
    assert len(line.get_xdata()) == 6


@pytest.mark.parametrize("scheme", [LIGHT, DARK], ids=lambda scheme: scheme.name)
def test_every_method_has_a_colour_of_its_own(scheme):
    names = ["truth", "woven", "neumip", "point_sampled", "woven_wide", "another"]
    colours = scheme.colours(names)
    assert len(set(colours.values())) == len(names)
    assert scheme.colours(["woven", "woven"]) == {"woven": colours["woven"]}


def test_display_keeps_settings_on_one_line():
    assert display("point_sampled", "k = 2") == "points, k\u00a0=\u00a02"
    assert display("woven_wide") == "woven wide"
