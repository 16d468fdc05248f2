import pandas as pd
import pytest

from pipeline.scenes.options import ViewOptions
from reports.options import BenchOptions
from reports.record import Record
from reports.tables.caveats import caveats, unseen_by_eye


@pytest.mark.parametrize("footprint", ["major", "geometric_mean"])
def test_caveats_name_the_footprint(footprint):
    options = BenchOptions(view=ViewOptions(footprint=footprint))
    text = " ".join(caveats(options, [], pd.DataFrame({"method": ["woven"], "setting": "", "zero_answers": 0.0})))
    assert ("longer axis" in text) == (footprint == "major")
    assert "NeuMIP" not in text


def test_a_measure_that_was_not_installed_is_said_where_scenes_were_measured():
    frame = Record(method="woven", scene="attic", metric="frame_time", value=20.0)
    (text,) = unseen_by_eye([frame])
    assert "pyfvvdp was not installed" in text
    assert unseen_by_eye([]) == []
    assert unseen_by_eye([frame, frame.of("fovvideovdp", 9.0, 4)]) == []
