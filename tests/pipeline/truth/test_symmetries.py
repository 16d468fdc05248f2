from typing import get_args

import numpy as np
import pytest

from pipeline.shards.queries import QueryOptions, draw_queries
from pipeline.truth.estimator import estimate
from pipeline.truth.options import EstimatorName, TruthOptions
from tests.pipeline.truth.cloths import LOPSIDED, OVER, exchanged_axes, redrawn, reversed_axes, woven

REPEAT = LOPSIDED.weave.repeat
ALL = get_args(EstimatorName)


def asked(rows=24, repeat=REPEAT, **options):
    """Return queries whose ellipses lie along the yarns: all estimators know them, `node_table` by the coarse table."""
    found = draw_queries(QueryOptions(sigma=(0.4, 4.0), max_angle=75.0, **options), repeat, 3, 0, rows)
    return found._replace(angle=np.zeros_like(found.angle))


QUERIES = asked(stretch=1.7, behind=0.3)


def answers(fabric, queries, estimator, **options):
    """Return components and transparency, float64 (N, 5)."""
    error, most = (0.003, 1 << 14) if estimator == "quadrature" else (0.01, 1 << 11)
    chosen = TruthOptions(estimator=estimator, relative_error=error, max_count=most, **options)
    found = estimate(fabric, queries, chosen, 4)
    return np.concatenate([found.mean, found.transparency[:, None]], axis=1).astype(np.float64)


RULES = {"quadrature": 0.03, "node_table": 0.01}
"""Estimators without random numbers, and the difference that is allowed between two answers, over the largest one.

Rules and nodes are mirrored with the cloth, but edges are found from one side, and borders are counted from one side.
Quadrature refines the parts that are worst, which may be others after a mirror, until it has spent its points.
"""


def assert_equal(one, other, worst):
    difference = np.abs(one - other) / one.max(axis=0)
    assert one.max(axis=0).min() > 0.01 and difference.max() < worst, difference.max(axis=0)
    assert difference.mean() < 0.1 * worst


@pytest.mark.parametrize("estimator", RULES)
def test_a_cloth_turned_by_half_a_turn_and_a_mirrored_one(estimator):
    """A mirror reverses the sense of the twists, half a turn does not."""
    own = answers(LOPSIDED, QUERIES, estimator)
    half_turn = answers(redrawn(OVER[::-1, ::-1]), reversed_axes(QUERIES, -1, -1), estimator)
    assert_equal(own, half_turn, RULES[estimator])
    mirrored = reversed_axes(QUERIES, -1, 1)
    assert_equal(own, answers(redrawn(OVER[:, ::-1], mirrored=True), mirrored, estimator), RULES[estimator])
    assert np.abs(own - answers(redrawn(OVER[:, ::-1]), mirrored, estimator)).max() > 0.01 * own.max()


@pytest.mark.parametrize("estimator", RULES)
def test_warp_and_weft_change_places(estimator):
    """The transposed draft, yarns exchanged: a mirror in the diagonal, and a quarter turn after a mirror."""
    there = answers(redrawn(~OVER.T, swap=True, mirrored=True), exchanged_axes(QUERIES), estimator)
    assert_equal(answers(LOPSIDED, QUERIES, estimator), there[:, [1, 0, 3, 2, 4]], RULES[estimator])


@pytest.mark.parametrize("estimator", RULES)
def test_a_repeat_may_begin_anywhere_and_be_drawn_twice(estimator):
    """Centres are on a lattice of 1/64, so that single precision moves them exactly."""
    queries = QUERIES._replace(u=np.round(QUERIES.u * 64) / 64, v=np.round(QUERIES.v * 64) / 64)
    own = answers(LOPSIDED, queries, estimator)
    moved = queries._replace(u=queries.u - np.float32(1), v=queries.v - np.float32(2))
    assert_equal(own, answers(redrawn(np.roll(OVER, (-2, -1), axis=(0, 1))), moved, estimator), RULES[estimator])
    assert_equal(own, answers(redrawn(np.tile(OVER, (1, 2))), queries, estimator), RULES[estimator])


@pytest.mark.parametrize("estimator", ALL)
def test_translation_by_repeats_changes_nothing(estimator):
    near = QUERIES._replace(u=np.round(QUERIES.u * 64) / 64, v=np.round(QUERIES.v * 64) / 64)
    ends, picks = np.float32(REPEAT)
    far = near._replace(u=near.u + np.float32(1024) * ends, v=near.v - np.float32(2048) * picks)
    own = answers(LOPSIDED, near, estimator)
    np.testing.assert_allclose(answers(LOPSIDED, far, estimator), own, rtol=1e-5, atol=1e-6 * own.max())


@pytest.mark.parametrize("estimator", ALL)
def test_a_viewer_behind_sees_the_back(estimator):
    """Whatever side the light is on: the back is a cloth of its own."""
    own = answers(LOPSIDED.back(), QUERIES, estimator)
    np.testing.assert_allclose(answers(LOPSIDED, QUERIES.turned(), estimator), own, rtol=1e-5, atol=1e-6)
    assert np.abs(own - answers(LOPSIDED, QUERIES, estimator)).max() > 0.1 * own.max()


@pytest.mark.parametrize("estimator", RULES)
def test_the_back_of_a_plain_weave_turned_over_is_its_front(estimator):
    """Turned about y, each float beneath lies on top; light from behind meets the same horizons on its way."""
    plain = woven("voile", twist=25.0)
    queries = asked(repeat=plain.weave.repeat, behind=0.5)
    over = reversed_axes(queries, -1, 1, plain.weave.repeat)
    assert_equal(answers(plain, queries, estimator), answers(plain.back(), over, estimator), RULES[estimator])


@pytest.mark.parametrize("estimator", ["owen", *RULES])
def test_light_and_viewer_change_places_under_the_projected_normaliser(estimator):
    """f_P |wo.n_s| = f_P' |wi.n_s|, specular parts, which contain the incident cosine; the visible one breaks it."""
    queries = asked()
    back = queries._replace(wi=queries.wo, wo=queries.wi)
    for normaliser, reciprocal in (("projected", True), ("visible", False)):
        there, other = (
            answers(LOPSIDED, q, estimator, normaliser=normaliser)[:, :2] / q.wi[:, 2:] for q in (queries, back)
        )
        apart = np.abs(there - other).max() / there.max()
        assert (apart < (1e-5 if estimator == "owen" else 0.02)) == reciprocal, apart
