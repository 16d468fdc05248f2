import math

import pandas as pd
import pytest

from pipeline.models.analytic.soft_nodes import SoftNodes
from pipeline.models.bounded import Bounded
from reports.record import Record
from reports.tables import sentences as told


def test_the_cheapest_within_each_limit_is_said():
    rows = [
        ("seen", "prefiltered", "", 240.0, 0.1, 0.03),
        ("seen", "soft_nodes", "k = 4", 1500.0, 0.04, 0.02),
        ("seen", "woven", "", 4000.0, 0.05, 0.002),
        ("unseen", "woven", "", 4000.0, 0.011, math.nan),
    ]
    table = pd.DataFrame(rows, columns=["role", "method", "setting", "ns", "error", "flicker"])
    seen, unseen = (text.replace("\u00a0", " ") for text in told.cheapest_sentences(table))
    assert seen == (
        "Seen fabrics, error of the colour: cheapest within 10 %: prefiltered (240 ns); cheapest within 5 %: soft "
        "nodes, k = 4 (1,500 ns); no method reaches 2 % or 1 %."
    )
    assert unseen.endswith("cheapest within 10 %, 5 % and 2 %: woven (4,000 ns); no method reaches 1 %.")
    (flicker,) = (text.replace("\u00a0", " ") for text in told.cheapest_sentences(table, "flicker"))
    assert flicker == (
        "Seen fabrics, flicker: cheapest within .1 of the truth: prefiltered (240 ns); cheapest within .01 of the "
        "truth: woven (4,000 ns); no method reaches .001 of the truth."
    )
    assert told.cheapest_sentences(table[:0]) == []


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


def test_the_trade_and_scenes_name_the_cheapest_and_what_is_in_the_noise():
    """An error lost in the noise counts as the end of its interval; a flicker below the truth's is as far as above."""
    found = {name: [t.replace("\u00a0", " ") for t in texts] for name, texts in told.scene_sentences(SCENES).items()}
    assert found["attic"] == [
        "Error of the colour: cheapest within 10 %: soft nodes, k = 4 (10.0 ms); cheapest within 5 %: woven (20.0 "
        "ms); cheapest within 2 %: soft nodes, k = 8 (45.6 ms).",
        "Flicker: cheapest within .1 and .01 of the truth: woven (20.0 ms); cheapest within .001 of the truth: soft "
        "nodes, k = 8 (45.6 ms).",
        "In the noise of the truth: the error of soft nodes, k = 4 and soft nodes, k = 8.",
    ]
    assert found["cellar"] == []  # nobody was timed there
    assert told.scene_sentences(SCENES[:0]) == {}
    rows = [("point_sampled", "k = 2", 500.0, 0.4), ("soft_nodes", "k = 1", 1000.0, 0.045), ("woven", "", 4000.0, 0.03)]
    table = pd.DataFrame(rows, columns=["method", "setting", "ns", "error"]).assign(role="seen", fabrics=8)
    lead, figures = told.trade(table)
    assert lead.replace("\u00a0", " ") == (
        "A pixel of two random points has an error of 40 % on the 8 seen fabrics. Cheapest within 10 % and 5 % error: "
        "soft nodes, k = 1 at 2× the time of two points; within 2 % error: no method."
    )
    assert [figure["value"] for figure in figures] == ["2×", "2×", "–", "40 %"]
    assert told.trade(table[1:]) == told.trade(table[:0]) == ("", [])


def tables(ratio, time_ratio=math.nan, role="seen", fabrics=8, seeds=0, least=math.nan, most=math.nan):
    errors = {"method": "woven", "setting": "", "role": role, "fabrics": fabrics, "ratio": ratio}
    errors |= {"seeds": seeds, "ratio_least": least, "ratio_most": most}
    errors |= dict.fromkeys(("ratio_fabrics", "ratio_fabrics_low", "ratio_fabrics_high"), math.nan)
    timing = {"method": "woven", "setting": "", "time_ratio": time_ratio}
    return pd.DataFrame([errors]), pd.DataFrame([timing])


def test_the_headline_admits_a_defeat_and_says_only_what_was_measured():
    defeat = told.headline("woven", "", *tables(0.5, 1.66), paper=False)
    once = told.headline("woven", "", *tables(9.13, 0.8, seeds=1), paper=False)
    where = "than point sampling at 2 points on the 8 seen fabrics"
    assert defeat == f"Woven reaches 2.0× higher MSE {where}, at 1.7× its time."
    assert once == f"Woven reaches 9.1× lower MSE {where}, at 0.8× its time (one training)."
    assert "8 seen fabrics (one training); the paper" in told.headline("woven", "", *tables(9.13, seeds=1))
    assert told.headline("woven", "", *tables(math.nan, 1.0)) == ""
    # Of three trainings all but one are lost in the noise of the truth.
    assert "trainings" not in told.headline("woven", "", *tables(0.5, seeds=3))
    assert "its time" not in told.headline("woven", "", *tables(3.0), paper=False)
    assert "on one unseen fabric" in told.headline("woven", "", *tables(3.0, role="unseen", fabrics=1))
    methods = [("point_sampled", "k = 1"), ("point_sampled", "k = 2"), ("woven", ""), ("neumip", "")]
    methods += [("woven", "bounded"), ("curved", ""), ("curved", "eager-bf16")]
    errors = pd.DataFrame(methods, columns=["method", "setting"])
    assert told.learnt(errors) == [("woven", "bounded"), ("neumip", ""), ("curved", "")]
    assert told.learnt(errors, {"woven", "neumip", "curved"}) == [("point_sampled", "k = 1")]
    assert Bounded(SoftNodes()).setting == f"k = 2 {told.BOUNDED}"


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
    errors = errors.assign(ratio_fabrics_least=5.5, ratio_fabrics_most=7.0)
    text = told.headline("woven", "", errors, timing, paper=False)
    assert words in text
    ends = "3.1× to 12.4×" if mean > 1 else "1.0× to 4.0×"
    assert text.endswith(f"on the 9 unseen fabrics (geometric mean, 95 % interval over fabrics {ends}).")


def of(*shares):
    return [Record(method=f"m{k}").of("waited", share, 20) for k, share in enumerate(shares)]


@pytest.mark.parametrize(
    ("a", "b", "words"), [(0.0, 0.0, ""), (0.0, 0.3, "B waited 30 %"), (0.4, 0.3, "A waited 40 %")]
)
def test_a_comparison_warns_of_busy_machines_alone(a, b, words):
    sentences = told.busy(of(a), of(b))
    assert len(sentences) == bool(words) and all(words in sentence for sentence in sentences)
    assert told.busy(of(told.QUIET), []) and told.busy([], []) == []


def test_facts_name_trainings_unseen_fabrics_the_energy_bound_and_the_median_over_methods():
    errors = pd.DataFrame({"method": ["woven", "neumip", "soft_nodes"], "setting": "", "zero_answers": 0.0})
    errors = errors.assign(role="unseen", fabrics=[9, 1, 1])
    values = told.facts([], errors.assign(seeds=[1, 3, 0]))
    assert (values["once"], values["several"], values["training_counts"]) == ("woven", "NeuMIP", "3")
    assert values["unseen_fabrics"] == 9 and "one_unseen" not in values and "bounded" not in values
    values = told.facts([], errors.assign(seeds=0, fabrics=1, setting=told.BOUNDED))
    assert values["one_unseen"] == "One" and values["bounded"] and "once" not in values and "several" not in values
    assert told.waited(of(0.0, 0.25, 0.9)) == 0.25
    none = pd.DataFrame()
    assert {"waited": "25.0 %", "busy": "25.0 %"}.items() <= told.facts(of(0.0, 0.25, 0.9), none).items()
    quiet = told.facts(of(0.001), none)
    assert quiet["waited"] == "0.1 %" and "busy" not in quiet
    assert told.facts([], none) == {} and math.isnan(told.waited([]))


def test_a_measure_that_was_not_installed_is_known_where_scenes_were_measured():
    frame = Record(method="woven", scene="attic", metric="frame_time", value=20.0)
    assert "not_by_eye" in told.facts([frame], pd.DataFrame())
    assert "not_by_eye" not in told.facts([frame, frame.of("fovvideovdp", 9.0, 4)], pd.DataFrame())
