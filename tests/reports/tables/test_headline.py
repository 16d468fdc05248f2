import math

import pandas as pd

from reports.tables.headline import headline, learnt


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
