import math

import pandas as pd
import pytest

from pipeline.models.bounded import Bounded
from pipeline.models.soft_nodes.model import SoftNodes
from reports.tables.headline import BOUNDED, headline, learnt


def tables(ratio, time_ratio=math.nan, role="seen", fabrics=8, seeds=0, least=math.nan, most=math.nan):
    errors = {"method": "woven", "setting": "", "role": role, "fabrics": fabrics, "ratio": ratio}
    errors |= {"seeds": seeds, "ratio_least": least, "ratio_most": most}
    errors |= dict.fromkeys(("ratio_fabrics", "ratio_fabrics_low", "ratio_fabrics_high"), math.nan)
    timing = {"method": "woven", "setting": "", "time_ratio": time_ratio}
    return pd.DataFrame([errors]), pd.DataFrame([timing])


def test_headline_admits_a_defeat():
    text = headline("woven", "", *tables(0.5, 1.66), paper=False)
    assert text == (
        "Woven reaches 2.0× higher MSE than point sampling at 2 points on the 8 seen fabrics, at 1.7× its time."
    )


def test_one_training_is_called_one():
    text = headline("woven", "", *tables(9.13, 0.8, seeds=1), paper=False)
    assert text == (
        "Woven reaches 9.1× lower MSE than point sampling at 2 points on the 8 seen fabrics, at 0.8× its time "
        "(one training)."
    )
    text = headline("woven", "", *tables(9.13, seeds=1))
    assert "8 seen fabrics (one training); the paper" in text


def test_several_trainings_have_a_range():
    text = headline("woven", "", *tables(9.13, seeds=3, least=5.7, most=13.21), paper=False)
    assert "reaches 9.1× lower MSE (5.7× to 13.2× over 3 trainings) than" in text and "one training" not in text
    worse = headline("woven", "", *tables(0.5, seeds=3, least=0.25, most=0.8), paper=False)
    assert "2.0× higher MSE (1.2× to 4.0× over 3 trainings)" in worse
    # All but one are lost in the noise of the truth.
    assert "trainings" not in headline("woven", "", *tables(0.5, seeds=3))


@pytest.mark.parametrize(
    ("mean", "low", "high", "words"),
    [
        (6.2, 3.1, 12.4, "reaches 6.2× lower MSE (5.5× to 7.0× over 3 trainings) than"),
        (0.5, 0.25, 1.0, "reaches 2.0× higher MSE (0.14× to 0.18× over 3 trainings) than"),
    ],
)
def test_several_unseen_fabrics_have_a_geometric_mean_and_an_interval(mean, low, high, words):
    errors, timing = tables(100.0, role="unseen", fabrics=9, seeds=3, least=1.0, most=2.0)
    errors = errors.assign(ratio_fabrics=mean, ratio_fabrics_low=low, ratio_fabrics_high=high)
    text = headline("woven", "", errors.assign(ratio_fabrics_least=5.5, ratio_fabrics_most=7.0), timing, paper=False)
    assert words in text
    ends = "3.1× to 12.4×" if mean > 1 else "1.0× to 4.0×"
    assert text.endswith(f"on the 9 unseen fabrics (geometric mean, 95 % interval over fabrics {ends}).")


def test_headline_says_only_what_was_measured():
    assert headline("woven", "", *tables(math.nan, 1.0)) == ""
    assert "its time" not in headline("woven", "", *tables(3.0), paper=False)
    assert "on one unseen fabric" in headline("woven", "", *tables(3.0, role="unseen", fabrics=1))


def test_learnt_leaves_points_out():
    errors = pd.DataFrame(
        {"method": ["point_sampled", "point_sampled", "woven"], "setting": ["k = 1", "k = 2", ""], "role": "seen"}
    )
    assert learnt(errors) == [("woven", "")]
    assert learnt(errors, {"woven"}) == [("point_sampled", "k = 1")]


def test_the_headline_names_the_bounded_form_where_it_was_measured():
    errors = pd.DataFrame(
        {
            "method": ["woven", "neumip", "woven", "selvage", "selvage"],
            "setting": ["", "", "bounded", "", "unbounded"],
            "role": "seen",
        }
    )
    assert learnt(errors) == [("woven", "bounded"), ("neumip", ""), ("selvage", "")]
    assert Bounded(SoftNodes()).setting == f"k = 2 {BOUNDED}"
