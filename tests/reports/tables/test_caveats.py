import pandas as pd
import pytest

from pipeline.scenes.options import ViewOptions
from reports.options import BenchOptions
from reports.record import Record
from reports.tables.caveats import caveats, unseen_by_eye


@pytest.mark.parametrize("footprint", ["major", "geometric_mean"])
def test_caveats_name_the_footprint(footprint):
    options = BenchOptions(view=ViewOptions(footprint=footprint))
    errors = pd.DataFrame({"method": ["woven"], "setting": "", "zero_answers": 0.0, "seeds": 0, "role": "seen"})
    text = " ".join(caveats(options, [], errors))
    assert ("longer axis" in text) == (footprint == "major")
    assert "NeuMIP" not in text


def test_caveats_name_the_number_of_trainings():
    errors = pd.DataFrame({"method": ["woven", "selvage", "soft_nodes"], "setting": "", "zero_answers": 0.0})
    errors["role"] = "seen"
    text = " ".join(caveats(BenchOptions(), [], errors.assign(seeds=[1, 3, 0])))
    assert "One training of woven, with one seed" in text and "soft nodes" not in text
    assert "Numbers of selvage are means over 3 trainings" in text
    assert "trainings" not in " ".join(caveats(BenchOptions(), [], errors.assign(seeds=0)))


@pytest.mark.parametrize(("count", "words"), [(1, "One fabric is unseen"), (9, "The 9 unseen fabrics are a sample")])
def test_caveats_name_the_number_of_unseen_fabrics(count, words):
    errors = pd.DataFrame({"method": ["woven", "neumip"], "setting": "", "zero_answers": 0.0, "seeds": 0})
    found = caveats(BenchOptions(), [], errors.assign(role="unseen", fabrics=[count, 1]))
    assert [text.startswith(words) for text in found].count(True) == 1


def test_caveats_explain_the_energy_bound_where_networks_were_measured_under_it():
    errors = pd.DataFrame({"method": "woven", "setting": ["", "bounded"], "zero_answers": 0.0, "seeds": 0})
    errors["role"] = "seen"
    assert "Bounded: no component exceeds" in " ".join(caveats(BenchOptions(), [], errors))
    assert "Bounded" not in " ".join(caveats(BenchOptions(), [], errors[:1]))


def test_a_measure_that_was_not_installed_is_said_where_scenes_were_measured():
    frame = Record(method="woven", scene="attic", metric="frame_time", value=20.0)
    (text,) = unseen_by_eye([frame])
    assert "pyfvvdp was not installed" in text
    assert unseen_by_eye([]) == []
    assert unseen_by_eye([frame, frame.of("fovvideovdp", 9.0, 4)]) == []
