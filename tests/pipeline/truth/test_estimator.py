import math
from typing import get_args

import numpy as np
import pytest

from pipeline.truth.calibration import COARSE_TABLE, FINE_TABLE, REFINED, SAMPLED, calibrate
from pipeline.truth.estimator import estimate, uncalibrated
from pipeline.truth.options import EstimatorName, TruthOptions
from tests.pipeline.truth.cloths import answering, drawn, equal_queries, fixed
from weaves.errors import BadInput
from weaves.fabric import load_fabric


def test_the_stopping_rule_reaches_the_error_or_spends_its_points_also_on_hidden_patches():
    fabric = load_fabric("satin_8")
    queries = drawn(fabric, 3, 300)
    options = TruthOptions(estimator="owen", absolute_error=0.0, relative_error=0.03, min_count=64, max_count=1024)
    answers = estimate(fabric, queries, options, 7)
    relative = np.linalg.norm(answers.standard_error, axis=1) / np.maximum(np.linalg.norm(answers.mean, axis=1), 1e-9)
    assert ((relative <= 0.03 * (1 + 1e-6)) | (answers.count >= 1024)).all()
    # Only patches that are all but hidden may take more than max_count, and those are few.
    assert set(answers.count) <= {64 << k for k in range(9)}
    assert (answers.count > 1024).mean() < 0.05
    # Two runs differ by no more than their stated errors say, hidden patches at grazing angles included. Before
    # every randomisation had to see the patch, the measured variance was 24 times the reported one here.
    fabric = load_fabric("twill_4_4")
    queries = drawn(fabric, 3, 600)
    first, second = (estimate(fabric, queries, TruthOptions(estimator="owen", max_count=1024), seed) for seed in (1, 2))
    measured = np.sum((first.mean - second.mean) ** 2)
    stated = np.sum(first.standard_error**2 + second.standard_error**2)
    assert 0.5 < measured / stated < 2.0


@pytest.mark.parametrize(
    ("field", "value", "words"),
    [
        ("sigma", 0.0, "sigma[1] = 0.0: must be greater than 0"),
        ("u", math.nan, "u[1] = nan: must be finite"),
        ("wi", (0.0, 0.0, 2.0), "wi[1]"),
        ("wo", (0.0, 1.0, 0.0), "wo[1] = [0.0, 1.0, 0.0]: must not lie in the fabric plane"),
        ("sigma_minor", -1.0, "sigma_minor[1] = -1.0: must be greater than 0"),
        ("curvature", 1.5, "curvature[1] = 1.5: must be from 0 to 1"),
    ],
)
def test_bad_queries_are_named(field, value, words):
    queries = equal_queries((0, 0, 1), (0, 0.6, 0.8), rows=3)
    queries = queries._replace(sigma_minor=queries.sigma.copy())
    getattr(queries, field)[1] = value
    with pytest.raises(BadInput) as caught:
        estimate(load_fabric("denim"), queries, TruthOptions(estimator="owen"), 0)
    assert words in str(caught.value)


@pytest.mark.parametrize("estimator", get_args(EstimatorName))
def test_a_row_depends_on_its_index_alone(estimator):
    """Whatever the other rows are; quadrature knows no seed, unless hardly anything of a patch is seen."""
    fabric, options = load_fabric("basket"), answering(estimator, max_count=1024)
    least = 0.6 if estimator == "node_table" else 0.05
    queries = drawn(fabric, 3, 30, sigma=(least, 8.0), max_angle=60.0)
    whole = estimate(fabric, queries, options, 7)
    part = estimate(fabric, queries.take(slice(10, 20)), options, 8 if estimator == "quadrature" else 7, start=10)
    for column, own in zip(whole, part, strict=True):
        np.testing.assert_array_equal(own, column[10:20])


FABRIC = load_fabric("denim")
OPTIONS = TruthOptions(relative_error=0.005, max_count=1 << 14)


def test_stages_are_those_of_the_answers_and_tables_stop_at_the_standard_error():
    """Tables alone know no seed, and a least count of points concerns what is sampled only. A refined answer knows it
    too if its doubts turn out small enough without an integral."""
    queries = drawn(FABRIC, 4, 300)
    auto = uncalibrated(FABRIC, queries, OPTIONS, 4)
    assert set(auto.stage.tolist()) == {COARSE_TABLE, FINE_TABLE, REFINED, SAMPLED}
    alone = np.isin(auto.stage, (COARSE_TABLE, FINE_TABLE))
    other = uncalibrated(FABRIC, queries, OPTIONS, 99)
    same = (auto.mean == other.mean).all(axis=1)
    assert same[alone].all() and not same[auto.stage == SAMPLED].any()
    assert same[auto.stage == REFINED].mean() < 0.3
    more = uncalibrated(FABRIC, queries, OPTIONS.model_copy(update={"min_count": 1 << 14}), 4)
    np.testing.assert_array_equal(auto.mean[auto.stage != SAMPLED], more.mean[auto.stage != SAMPLED])
    assert (auto.count[auto.stage == SAMPLED] < more.count[auto.stage == SAMPLED]).any()
    rough = uncalibrated(FABRIC, queries.take(slice(50)), OPTIONS.model_copy(update={"relative_error": 1.0}), 4)
    assert np.isin(rough.stage, (COARSE_TABLE, FINE_TABLE)).mean() > 0.95
    # A table that reports 1.3 times the requested error states less than that error: it is not refined.
    queries = drawn(FABRIC, 34, 300)
    answers = uncalibrated(FABRIC, queries, TruthOptions(relative_error=0.01), 5)
    size, reported = (np.linalg.norm(values[:, :4], axis=1) for values in (answers.mean, answers.error))
    alone = np.isin(answers.stage, (COARSE_TABLE, FINE_TABLE))
    assert (reported[alone] > 0.0101 * size[alone]).any()
    stated, _ = calibrate(answers, queries.behind)
    doubt = np.linalg.norm(stated[:, :4], axis=1)
    assert (doubt[alone] <= np.maximum(0.01 * size[alone], 1e-5) * (1 + 1e-6)).all()


def test_auto_reaches_the_requested_error():
    fabric = load_fabric("gauze")
    queries = drawn(fabric, 33, 300)
    answers = uncalibrated(fabric, queries, TruthOptions(relative_error=0.02), 5)
    stated, _ = calibrate(answers, queries.behind)
    size, doubt = (np.linalg.norm(values[:, :4], axis=1) for values in (answers.mean, stated))
    assert (doubt <= np.maximum(0.02 * size, 1e-5) * (1 + 1e-6)).mean() > 0.98


@pytest.mark.parametrize(
    ("name", "behind", "parallax", "sigma"),
    [("cotton_twill", 0.0, True, (2.0, 6.0)), ("gauze", 0.5, False, (0.3, 3.0))],
)
def test_rotated_ellipses_are_tabulated_with_the_reported_error(name, behind, parallax, sigma):
    """97 % of the components lie within their bounds; 64 to 128 points have four times the error. In the fabric plane
    tables resolve mixtures of narrow footprints, too."""
    fabric = load_fabric(name)
    queries = drawn(fabric, 12, 100, sigma=sigma, stretch=6.0, behind=behind, max_angle=75.0)
    exact = estimate(fabric, queries, fixed(8192, parallax=parallax), 4)
    found = {}
    for estimator in ("auto", "owen"):
        limits = {"relative_error": 0.1, "min_count": 64, "max_count": 128}
        options = TruthOptions(estimator=estimator, parallax=parallax, **limits)
        answers = estimate(fabric, queries, options, 5)
        wrong = np.abs(answers.mean - exact.mean)
        assert (wrong <= answers.bound + exact.bound).mean() >= 0.97
        found[estimator] = np.sqrt(np.mean(wrong**2))
    assert found["auto"] < 0.25 * found["owen"]
