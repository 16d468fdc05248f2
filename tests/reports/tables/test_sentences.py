import math

import pandas as pd

from reports.tables.sentences import beaten, cheapest_sentences, least_flicker_sentences, scene_sentences


def test_the_cheapest_is_said_of_what_was_measured():
    table = pd.DataFrame(
        {
            "role": ["seen", "seen", "seen", "unseen"],
            "method": ["point_sampled", "soft_nodes", "woven", "woven"],
            "setting": ["k = 2", "k = 4", "", ""],
            "ns": [500.0, 1500.0, 4000.0, 4000.0],
            "error": [0.3, 0.04, 0.05, 0.011],
            "front": [True, True, False, True],
        }
    )
    seen, unseen = (text.replace("\u00a0", " ") for text in cheapest_sentences(table, (0.5, 0.1, 0.05, 0.02, 0.01)))
    assert seen == (
        "Seen fabrics, error of the colour: cheapest within 50 %: points, k = 2 (500 ns); cheapest within 10 % and 5 "
        "%: soft nodes, k = 4 (1,500 ns); no method reaches 2 % or 1 %."
    )
    assert unseen.endswith("cheapest within 50 %, 10 %, 5 % and 2 %: woven (4,000 ns); no method reaches 1 %.")
    assert beaten(table) == {"seen": ["woven"], "unseen": []}
    assert cheapest_sentences(table[:0]) == []


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
        "Seen fabrics, flicker: cheapest within .1 of the truth: prefiltered (240 ns); cheapest within .01 of the "
        "truth: woven (4,000 ns); no method reaches .001 of the truth."
    )


SCENES = pd.DataFrame(
    [
        ("attic", "point_sampled", "k = 2", 0.3, 0.4, -0.4, 3.0),
        ("attic", "soft_nodes", "k = 4", 0.0, 0.06, 0.2, 10.0),
        ("attic", "soft_nodes", "k = 8", 0.0, 0.019, 0.0005, 45.6),
        ("attic", "woven", "", 0.04, 0.06, -0.008, 20.0),
        ("cellar", "woven", "", 0.04, 0.06, 0.008, math.nan),
    ],
    columns=["scene", "method", "setting", "colour_rrmse", "colour_rrmse_high", "flicker", "frame_time"],
)


def test_scenes_name_the_cheapest_and_what_is_in_the_noise():
    """An error lost in the noise counts as the end of its interval; a flicker below the truth's is as far as above."""
    found = {scene: [t.replace("\u00a0", " ") for t in texts] for scene, texts in scene_sentences(SCENES).items()}
    assert found["attic"] == [
        "Error of the colour: cheapest within 10 %: soft nodes, k = 4 (10.0 ms); cheapest within 5 %: woven (20.0 "
        "ms); cheapest within 2 %: soft nodes, k = 8 (45.6 ms).",
        "Flicker: cheapest within .1 and .01 of the truth: woven (20.0 ms); cheapest within .001 of the truth: soft "
        "nodes, k = 8 (45.6 ms).",
        "In the noise of the truth: the error of soft nodes, k = 4 and soft nodes, k = 8.",
    ]
    assert found["cellar"] == []  # nobody was timed there
    assert scene_sentences(SCENES[:0]) == {}
