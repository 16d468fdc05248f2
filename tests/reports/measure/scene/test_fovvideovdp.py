import importlib.util
import sys

import numpy as np
import pytest

from reports.measure.scene.scene_errors import absence, fovvideovdp, fovvideovdp_records
from reports.record import Record
from weaves.errors import BadInput

T = np.arange(6)[:, None, None]
TRUTH = 0.3 + 0.1 * np.sin((np.arange(80) + 0.4 * T) / 4) + np.zeros((6, 60, 1))
NOISE = np.random.default_rng(7).standard_normal(TRUTH.shape)

installed = [
    pytest.mark.skipif(importlib.util.find_spec("pyfvvdp") is None, reason="pyfvvdp is not a dependency"),
    pytest.mark.filterwarnings("ignore"),  # it uses names that SciPy and PyTorch call old
]


def test_absence_is_said_and_fails_nothing(monkeypatch):
    monkeypatch.setitem(sys.modules, "pyfvvdp", None)
    assert "pip install pyfvvdp" in absence()
    assert "\n" not in absence()
    assert fovvideovdp(TRUTH, TRUTH) is None
    assert fovvideovdp_records(Record(method="woven"), TRUTH, TRUTH) == []


@pytest.mark.parametrize("frames", [TRUTH[:-1], TRUTH[0], np.where(NOISE > 3, np.nan, TRUTH)])
def test_what_cannot_be_compared_is_bad_input(frames):
    with pytest.raises(BadInput, match="FovVideoVDP"):
        fovvideovdp(frames, TRUTH)


class TestInstalled:
    pytestmark = installed

    def test_score_falls_with_noise_from_10(self):
        scores = [fovvideovdp(TRUTH + size * NOISE, TRUTH) for size in (0.0, 0.01, 0.03, 0.1)]
        assert absence() == ""
        assert scores[0] == pytest.approx(10, abs=1e-3)
        assert scores == sorted(scores, reverse=True)
        assert len(set(scores)) == 4

    def test_flicker_is_worse_than_the_same_error_standing_still(self):
        """Slow spatial noise that changes in every frame, against its first frame in all of them."""
        from scipy import ndimage

        smooth = 0.3 * ndimage.gaussian_filter(NOISE, (0, 6, 6))
        assert fovvideovdp(TRUTH + smooth, TRUTH) < fovvideovdp(TRUTH + smooth[:1], TRUTH)

    def test_record_is_in_jod(self):
        (record,) = fovvideovdp_records(Record(method="woven"), TRUTH + 0.03 * NOISE, TRUTH)
        assert (record.metric, record.unit, record.count) == ("fovvideovdp", "JOD", 6)
