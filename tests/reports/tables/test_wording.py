import math

import pandas as pd
import pytest

from pipeline.scenes.options import ViewOptions
from reports.options import BenchOptions
from reports.record import Record
from reports.tables.wording import (
    beaten,
    caveats,
    cheapest_sentences,
    headline,
    learnt,
    least_flicker_sentences,
    scene_sentences,
    unseen_by_eye,
)


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


def test_the_cheapest_within_a_flicker_is_said():
    table = pd.DataFrame(
        {
            "role": ["seen", "seen", "unseen"],
            "method": ["prefiltered", "woven", "woven"],
            "setting": "",
            "ns": [240.0, 4000.0, 4000.0],
            "flicker": [0.03, 0.002, math.nan],
        }
    )
    (seen,) = (text.replace("\u00a0", " ") for text in least_flicker_sentences(table))
    assert seen == (
        "Seen fabrics, flicker: within .1 of the truth’s the cheapest is prefiltered (240 ns); within .01 of the "
        "truth’s the cheapest is woven (4,000 ns); .001 is reached by none."
    )


SCENES = pd.DataFrame(
    [
        ("attic", "point_sampled", "k = 2", 0.3, 0.4, -0.4, 3.0),
        ("attic", "quadrature", "k = 4", 0.0, 0.06, 0.2, 10.0),
        ("attic", "quadrature", "k = 8", 0.0, 0.019, 0.0005, 45.6),
        ("attic", "woven", "", 0.04, 0.06, -0.008, 20.0),
        ("cellar", "woven", "", 0.04, 0.06, 0.008, math.nan),
    ],
    columns=["scene", "method", "setting", "colour_rrmse", "colour_rrmse_high", "flicker", "frame_time"],
)


def test_scenes_name_the_cheapest_and_what_is_in_the_noise():
    """An error lost in the noise counts as the end of its interval; a flicker below the truth's is as far as above."""
    found = {scene: [t.replace("\u00a0", " ") for t in texts] for scene, texts in scene_sentences(SCENES).items()}
    assert found["attic"] == [
        "Error of the colour: for 10 % the cheapest is quadrature, k = 4 (10.0 ms); for 5 % the cheapest is woven "
        "(20.0 ms); for 2 % the cheapest is quadrature, k = 8 (45.6 ms).",
        "Flicker: within .1 and .01 of the truth’s the cheapest is woven (20.0 ms); within .001 of the truth’s the "
        "cheapest is quadrature, k = 8 (45.6 ms).",
        "The error of quadrature, k = 4 and quadrature, k = 8 is in the noise: the truth’s own explains it all.",
    ]
    assert found["cellar"] == []  # nobody was timed there
    assert scene_sentences(SCENES[:0]) == {}


def test_a_measure_that_was_not_installed_is_said_where_scenes_were_measured():
    frame = Record(method="woven", scene="attic", metric="frame_time", value=20.0)
    (text,) = unseen_by_eye([frame])
    assert "pyfvvdp was not installed" in text
    assert unseen_by_eye([]) == []
    assert unseen_by_eye([frame, frame.of("fovvideovdp", 9.0, 4, unit="JOD")]) == []
