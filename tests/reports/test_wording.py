import math

import pandas as pd
import pytest

from pipeline.scenes.options import ViewOptions
from reports.options import BenchOptions
from reports.wording import beaten, caveats, cheapest_sentences, headline, learnt


def tables(ratio, time_ratio=math.nan, role="seen", fabrics=8):
    errors = {"method": "woven", "setting": "", "role": role, "fabrics": fabrics, "ratio": ratio, "zero_answers": 0.0}
    timing = {"method": "woven", "setting": "", "time_ratio": time_ratio}
    return pd.DataFrame([errors]), pd.DataFrame([timing])


def test_headline_admits_a_defeat():
    text = headline("woven", "", *tables(0.5, 1.66), paper=False)
    assert text == (
        "Woven reaches 2.0× higher MSE than point sampling at 2 points on the 8 seen fabrics, at 1.7× its time."
    )


def test_headline_says_only_what_was_measured():
    assert headline("woven", "", *tables(math.nan, 1.0)) == ""
    assert "its time" not in headline("woven", "", *tables(3.0), paper=False)
    assert "on the unseen fabric" in headline("woven", "", *tables(3.0, role="unseen", fabrics=1))


def test_learnt_leaves_points_out():
    errors = pd.DataFrame(
        {"method": ["point_sampled", "point_sampled", "woven"], "setting": ["k = 1", "k = 2", ""], "role": "seen"}
    )
    assert learnt(errors) == [("woven", "")]
    assert learnt(errors, {"woven"}) == [("point_sampled", "k = 1")]


def test_the_cheapest_is_said_of_what_was_measured():
    table = pd.DataFrame(
        {
            "role": ["seen", "seen", "seen", "unseen"],
            "method": ["point_sampled", "quadrature", "woven", "woven"],
            "setting": ["k = 2", "k = 4", "", ""],
            "ns": [500.0, 1500.0, 4000.0, 4000.0],
            "error": [0.3, 0.04, 0.05, 0.011],
            "front": [True, True, False, True],
        }
    )
    seen, unseen = (text.replace("\u00a0", " ") for text in cheapest_sentences(table, (0.5, 0.1, 0.05, 0.02, 0.01)))
    assert seen == (
        "Seen fabrics, error of the colour: for 50 % the cheapest is points, k = 2 (500 ns); for 10 % and 5 % the "
        "cheapest is quadrature, k = 4 (1,500 ns); 2 % and 1 % are reached by none."
    )
    assert unseen.endswith("for 50 %, 10 %, 5 % and 2 % the cheapest is woven (4,000 ns); 1 % is reached by none.")
    assert beaten(table) == {"seen": ["woven"], "unseen": []}
    assert cheapest_sentences(table[:0]) == []


@pytest.mark.parametrize("footprint", ["major", "geometric_mean"])
def test_caveats_name_the_footprint(footprint):
    options = BenchOptions(view=ViewOptions(footprint=footprint))
    text = " ".join(caveats(options, [], tables(1.0)[0]))
    assert ("longer axis" in text) == (footprint == "major")
    assert "NeuMIP" not in text
