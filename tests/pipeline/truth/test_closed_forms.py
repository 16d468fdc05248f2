import math
from typing import get_args

import numpy as np
import pytest
from scipy import stats

from pipeline.truth.cloth import cloth_side, columns_of
from pipeline.truth.estimator import estimate
from pipeline.truth.footprint.mixture import FINE_LINE
from pipeline.truth.geometry.pieces import first_cells
from pipeline.truth.node_table.tables import NOT_REFINED, NodeTable
from pipeline.truth.options import EstimatorName, Limits, TruthOptions
from pipeline.truth.quadrature.adaptive import integrate_rows
from tests.pipeline.truth.cloths import along_cylinders, answering, cylinder_answers, cylinders, drawn, fixed, woven

ROUND = cylinders(twist=20.0, roughness=0.4, blend=0.6).model_copy(update={"optical_thickness": 0.8})
ASKED = along_cylinders(viewer=1.2)
EXACT = cylinder_answers(ROUND, ASKED)
ESTIMATORS = get_args(EstimatorName)


def of_warp(components, transparency):
    """Return specular, diffuse and transparency, (N, 3); no weft is seen."""
    assert not components[:, [1, 3]].any()
    return np.concatenate([components[:, [0, 2]], np.reshape(transparency, (-1, 1))], axis=1).astype(np.float64)


def test_the_exact_answers_are_what_is_known_without_an_integral():
    """Diffuse light in closed form; a thick layer is opaque, a thin one clear and without highlights."""
    t = np.arctan2(np.abs(ASKED.wi[:, 0]), ASKED.wi[:, 2]).astype(np.float64)
    ends = t - math.pi / 2, np.minimum(t + np.arcsin(2.0 * np.cos(t) - 1.0), math.pi / 2)
    for blend, across, integral in (
        (0.0, ASKED.wi[:, 2], np.sin),
        (1.0, np.hypot(ASKED.wi[:, 0], ASKED.wi[:, 2]), lambda v: 0.5 * v * np.cos(t) + 0.25 * np.sin(2.0 * v - t)),
    ):
        found = cylinder_answers(cylinders(twist=20.0, blend=blend), ASKED)[:, 1]
        np.testing.assert_allclose(found, across * (integral(ends[1]) - integral(ends[0])) / (2.0 * math.pi), rtol=1e-6)
    for depth, through in ((1e-9, 1.0), (100.0, 0.0)):
        found = cylinder_answers(ROUND.model_copy(update={"optical_thickness": depth}), ASKED)
        np.testing.assert_allclose(found[:, 2], through, atol=1e-6)
        assert found[:, 0].max() < 1e-6 or depth > 1.0


@pytest.mark.parametrize("estimator", ESTIMATORS)
def test_answers_are_exact_within_the_errors_they_state_also_under_a_lamp_at_the_eye(estimator):
    """3 of 1,000 lie beyond their bounds; the rms error is at most about that of the standard errors, and 1 %. For a
    table without refinement cylinders are the worst cloth: all borders of shadows lie alike, across nodes. Without the
    neighbour's shadow diffuse light would be 17 % off."""
    options = answering(estimator, relative_error=0.005, max_count=1 << 14)
    answers = estimate(ROUND, ASKED, options, 1)
    dark = answers.mean == 0.0
    found = of_warp(answers.mean, answers.transparency)
    bound = of_warp(np.where(dark, 0.0, answers.bound), answers.transparency_bound)
    stated = of_warp(np.where(dark, 0.0, answers.standard_error), answers.transparency_standard_error)
    wrong = np.abs(found - EXACT)
    assert (wrong > bound + 1e-6).mean() < 0.02
    size = np.linalg.norm(EXACT[:, :2], axis=1)
    rms = np.sqrt(np.mean(np.square(wrong[:, :2] / size[:, None]).sum(axis=1)))
    assert rms < (0.02 if estimator == "node_table" else 0.01)
    assert np.sqrt(np.mean(wrong**2)) < 1.5 * np.sqrt(np.mean(stated**2)) + 1e-6
    # Diffuse parts with cosines to the cloth alone: cos / pi, whatever the weave, the footprint and the direction.
    fabric, least = woven("cotton_twill", blend=0.0), 1.5 if estimator == "node_table" else 0.3
    queries = drawn(fabric, 3, 40, sigma=(least, 4.0), max_angle=70.0, stretch=3.0)
    options = answering(estimator, max_count=256)
    found = estimate(fabric, queries._replace(wi=queries.wo), options, 1).mean[:, 2:].sum(axis=1)
    # Tables interpolate the horizon of light and viewer alike: a node is seen and lit, or neither.
    np.testing.assert_allclose(found * math.pi, queries.wo[:, 2], rtol=2e-3)


def order(counts, errors):
    return -stats.linregress(np.log(counts), np.log(errors)).slope


def rms(found):
    return math.sqrt(np.mean((found - EXACT) ** 2))


@pytest.mark.parametrize(("estimator", "low", "high"), [("mc", 0.4, 0.6), ("r2", 0.8, 1.4), ("owen", 0.85, 1.7)])
def test_points_converge_by_their_order(estimator, low, high):
    """Independent ones by 1/2; a line across the yarns is cut at a few places: R2 by 1, scrambled nets by 1 to 3/2."""
    counts, errors = [64, 256, 1024, 4096], []
    for count in counts:
        answers = estimate(ROUND, ASKED, fixed(count, estimator), 1)
        errors.append(rms(of_warp(answers.mean, answers.transparency)))
    assert low < order(counts, errors) < high, errors


def test_cut_rules_converge_faster_than_uncut_ones_and_tables_with_their_nodes():
    """Nodes an axis 4, 8, 16, 32: a shadow's edge on a line that is not cut there errs by a node, of order 1."""
    model, columns = cloth_side(ROUND, TruthOptions()), columns_of(ASKED)
    levels, errors = np.arange(1, 5), {}
    for split in (2, 9):
        errors[split] = []
        for level in levels:
            limits = Limits(1e-15, 0.0, 32, 1 << 30)
            mean, *_ = integrate_rows(model, columns, first_cells(model.front), limits, split, level - 1, level)
            errors[split].append(rms(of_warp(mean[:, :4], mean[:, 4])))
    nodes = 2.0 ** (levels + 1)
    assert 0.5 < order(nodes, errors[9]) < 1.6, errors
    assert order(nodes, errors[2]) > 1.7 and errors[2][-1] < 0.2 * errors[9][-1], errors
    # A border of a shadow is placed between two nodes by their margins: of order 1 at least, 2 at best.
    cloth, columns, index = cloth_side(ROUND, TruthOptions()), columns_of(ASKED), np.arange(len(ASKED.u))
    counts, errors = [8, 16, 32, 64], []
    for count in counts:
        table = NodeTable(lambda cells, count=count: count, 128, FINE_LINE)
        found = table.answer(cloth, columns, index, *NOT_REFINED, 0)
        errors.append(rms(of_warp(found.mean[:, :4], found.mean[:, 4])))
    assert order(counts, errors) > 1.0 and errors[2] < 2e-3, errors
