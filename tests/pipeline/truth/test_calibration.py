import numpy as np
import pytest
from scipy import stats

from pipeline.truth.calibration import FRONT_FACTORS, SAMPLED, calibrate
from pipeline.truth.cloth import Raw
from pipeline.truth.estimator import ESTIMATORS, estimate, uncalibrated
from tests.pipeline.truth.cloths import answering, drawn, fixed
from tests.presets import slow
from weaves.fabric import load_fabric


def test_a_hidden_patch_has_no_error_and_components_or_gaps_that_few_points_show_have_one():
    nothing = np.zeros((5, 5))
    error, bound = calibrate(Raw(nothing, nothing, np.ones(5, np.int64), np.arange(5)), np.zeros(5, np.bool_))
    assert not error.any() and not bound.any()
    # One family of yarns fills a narrow footprint: the other one may still have been missed.
    fabric = load_fabric("denim")
    queries = drawn(fabric, 5, 60, sigma=(0.05, 0.08), max_angle=30.0)
    raw = uncalibrated(fabric, queries, fixed(64, "mc"), 1)
    size = np.linalg.norm(raw.mean[:, :4], axis=1, keepdims=True)
    assert (raw.stage == SAMPLED).all()
    unseen = (raw.mean[:, :4] == 0.0) & (size > 0.0)
    assert unseen.sum() > 20
    assert (raw.error[:, :4] >= size / 64 * (1 - 1e-12))[unseen].all()
    # Four stratified points in each randomisation often agree although a corner of a gap was met by none.
    fabric, options = load_fabric("gauze"), fixed(64, "owen")
    queries = drawn(fabric, 5, 400, sigma=(0.05, 0.3), max_angle=60.0)
    answers, exact = estimate(fabric, queries, options, 1), estimate(fabric, queries, fixed(4096, "owen"), 3)
    wrong = np.abs(answers.transparency - exact.transparency)
    beyond = wrong > answers.transparency_bound + 3.0 * exact.transparency_standard_error
    assert stats.binomtest(int(beyond.sum()), len(wrong), 0.003, alternative="greater").pvalue > 0.001


@pytest.mark.parametrize("estimator", [slow(name) if name == "r2" else name for name in ESTIMATORS])
def test_every_answer_has_a_stage_and_both_errors(estimator):
    fabric = load_fabric("denim")
    known = {"sigma": (1.0, 32.0), "max_angle": 75.0} if estimator == "node_table" else {}
    queries = drawn(fabric, 5, 40, **known)
    raw, answers = (call(fabric, queries, answering(estimator, max_count=1024), 1) for call in (uncalibrated, estimate))
    assert np.isin(raw.stage, list(FRONT_FACTORS)).all()
    np.testing.assert_array_equal(answers.mean, raw.mean[:, :4].astype(np.float32))
    assert (answers.bound >= answers.standard_error).all()
    assert (answers.transparency_bound >= answers.transparency_standard_error).all()
