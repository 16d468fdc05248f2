from functools import partial
from typing import get_args

import numpy as np
import pytest

from pipeline.truth.estimator import estimate
from pipeline.truth.options import EstimatorName
from tests.pipeline.truth.cloths import LOPSIDED, agree, answering, drawn, images_agree, moved_far, reversed_axes, woven

ALL = get_args(EstimatorName)
pytestmark = pytest.mark.usefixtures("coarse_truth")


def asked(estimator, fabric=LOPSIDED, **options):
    """Return queries whose ellipses lie along the yarns, as wide as the estimator needs."""
    found = drawn(fabric, 3, 24, sigma=(0.8 if estimator == "node_table" else 0.4, 4.0), max_angle=75.0, **options)
    return found._replace(angle=np.zeros_like(found.angle))


def any_asked(estimator):
    """Return ellipses with light from either side."""
    return asked(estimator, stretch=1.7, behind=0.3)


def answers(fabric, queries, estimator, **options):
    """Return components and transparency, float64 (N, 5)."""
    error, most = (0.003, 1 << 15) if estimator == "quadrature" else (0.01, 1 << 11)
    chosen = answering(estimator, relative_error=error, max_count=most, **options)
    found = estimate(fabric, queries, chosen, 4)
    return np.concatenate([found.mean, found.transparency[:, None]], axis=1).astype(np.float64)


RULES = {"quadrature": 0.03, "node_table": 0.01}
"""Estimators without random numbers, and the difference that is allowed between two answers, over the largest one.

Rules and nodes are mirrored with the cloth, but edges are found from one side, and borders are counted from one side.
Quadrature refines the parts that are worst, which may be others after a mirror, until it has spent its points.
"""


@pytest.mark.slow
@pytest.mark.parametrize("estimator", ["quadrature", "node_table"])
def test_a_cloth_drawn_in_another_way_has_the_same_answers(estimator):
    worst = RULES[estimator]
    images_agree(partial(answers, estimator=estimator), any_asked(estimator), worst, 0.1 * worst)


@pytest.mark.parametrize("estimator", ALL)
def test_translation_by_repeats_changes_nothing_and_a_viewer_behind_sees_the_back(estimator):
    near, far = (answers(LOPSIDED, queries, estimator) for queries in moved_far(any_asked(estimator)))
    np.testing.assert_allclose(far, near, rtol=1e-5, atol=1e-6 * near.max())
    # Whatever side the light is on: the back is a cloth of its own.
    queries = any_asked(estimator)
    own = answers(LOPSIDED.back(), queries, estimator)
    np.testing.assert_allclose(answers(LOPSIDED, queries.turned(), estimator), own, rtol=1e-5, atol=1e-6)
    assert np.abs(own - answers(LOPSIDED, queries, estimator)).max() > 0.1 * own.max()


@pytest.mark.parametrize("estimator", RULES)
def test_the_back_of_a_plain_weave_turned_over_is_its_front(estimator):
    """Turned about y, each float beneath lies on top; light from behind meets the same horizons on its way."""
    plain = woven("voile", twist=25.0)
    queries = asked(estimator, plain, behind=0.5)
    over = reversed_axes(queries, -1, 1, plain.weave.repeat)
    own, turned, worst = answers(plain, queries, estimator), answers(plain.back(), over, estimator), RULES[estimator]
    agree(own, turned, worst, 0.1 * worst)


@pytest.mark.parametrize("estimator", ["owen", *RULES])
def test_light_and_viewer_change_places_under_the_projected_normaliser(estimator):
    """f_P |wo.n_s| = f_P' |wi.n_s|, specular parts, which contain the incident cosine; the visible one breaks it.

    In the fabric plane: other rays cross a footprint towards the light than towards the viewer."""
    queries = asked(estimator)
    back = queries._replace(wi=queries.wo, wo=queries.wi)
    for normaliser, reciprocal in (("projected", True), ("visible", False)):
        there, other = (
            answers(LOPSIDED, q, estimator, normaliser=normaliser, parallax=False)[:, :2] / q.wi[:, 2:]
            for q in (queries, back)
        )
        apart = np.abs(there - other).max() / there.max()
        assert (apart < (1e-5 if estimator == "owen" else 0.02)) == reciprocal, apart
