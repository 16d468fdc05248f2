import sys

import numpy as np
import pytest

from reports.measure.scene.scene_errors import fovvideovdp
from reports.record import Record

SUBJECT = Record(method="woven")
TRUTH = 0.3 + 0.1 * np.sin((np.arange(80) + 0.4 * np.arange(6)[:, None, None]) / 4) + np.zeros((6, 60, 1))
NOISE = np.random.default_rng(7).standard_normal(TRUTH.shape)


def test_its_absence_fails_nothing(monkeypatch):
    monkeypatch.setitem(sys.modules, "pyfvvdp", None)
    assert fovvideovdp(SUBJECT, TRUTH, TRUTH) == []


@pytest.mark.filterwarnings("ignore")  # pyfvvdp uses names that SciPy and PyTorch call old
def test_score_falls_with_noise_from_10_and_flicker_is_worse_than_the_same_error_standing_still():
    """Slow spatial noise that changes in every frame, against its first frame in all of them."""
    pytest.importorskip("pyfvvdp", reason="it is not a dependency")
    from scipy import ndimage

    smooth = 0.3 * ndimage.gaussian_filter(NOISE, (0, 6, 6))
    errors = [*(size * NOISE for size in (0.0, 0.01, 0.03, 0.1)), smooth[:1], smooth]
    records = [record for error in errors for record in fovvideovdp(SUBJECT, TRUTH + error, TRUTH)]
    assert {(record.metric, record.unit, record.count) for record in records} == {("fovvideovdp", "JOD", 6)}
    *scores, still, flickering = [record.value for record in records]
    assert scores[0] == pytest.approx(10, abs=1e-3)
    assert scores == sorted(set(scores), reverse=True) and flickering < still
