"""Errors that `auto` reports against true ones, over ten thousand queries of random fabrics."""

import json

import numpy as np
import pytest

from pipeline.shards.queries import QueryOptions, draw_queries
from pipeline.truth.estimator import estimate
from pipeline.truth.options import TruthOptions
from weaves.fabric import load_fabric, preset_names
from weaves.population import Population, Ranges, population_fabrics

WILD = Ranges(
    roughness_warp=(0.01, 0.8),
    roughness_weft=(0.01, 0.8),
    relief=(0.3, 2.0),
    bend=(5.0, 60.0),
    twist=(-35.0, 35.0),
    width=(0.7, 1.0),
)
# Not the fabrics and queries that the table's doubts were fitted to (seeds 77 and 78).
RANDOM = population_fabrics(Population(count=10, seed=2031, plain=WILD, twill=WILD, satin=WILD))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kinds", "relative_error"),
    [(QueryOptions(), 0.02), (QueryOptions(), 0.01), (QueryOptions(stretch=10.0, behind=0.3), 0.03)],
)
def test_ten_thousand_true_errors_lie_within_three_stated_ones(kinds, relative_error, tmp_path):
    """Ten random fabrics, most with gaps, and the presets, 500 queries each, against 32,768 points or more.

    The error of a query is the norm over its four components; 99 % must lie within three stated ones, the reference's
    own included.
    """
    beyond, reached, asked, worst = 0, 0, 0, []
    for number, fabric in enumerate([*RANDOM, *(load_fabric(name) for name in preset_names())]):
        queries = draw_queries(kinds, fabric.weave.repeat, 900 + number, 0, 500)
        converged = TruthOptions(
            estimator="owen", relative_error=1e-9, absolute_error=0.0, min_count=1 << 15, max_count=1 << 15
        )
        exact = estimate(fabric, queries, converged, 4)
        answers = estimate(fabric, queries, TruthOptions(relative_error=relative_error), 5)
        error, stated, reference = (
            np.linalg.norm(v.astype(np.float64), axis=1)
            for v in (answers.mean - exact.mean, answers.standard_error, exact.standard_error)
        )
        z = error / np.maximum(np.hypot(stated, reference), 1e-7)
        size = np.linalg.norm(answers.mean, axis=1)
        beyond += int((z > 3).sum())
        reached += int((stated <= np.maximum(relative_error * size, 1e-5) * 1.0001).sum())
        asked += len(z)
        worst += [(float(z[k]), fabric.name, int(k), float(error[k]), float(size[k])) for k in np.argsort(-z)[:3]]
    worst.sort(reverse=True)
    (tmp_path / "worst.json").write_text(json.dumps(worst[:30]))
    assert asked >= 10_000
    assert beyond / asked <= 0.01, (beyond, worst[:10])
    assert reached / asked >= 0.95, reached


@pytest.mark.parametrize(("name", "behind"), [("cotton_twill", 0.0), ("gauze", 0.5)])
def test_rotated_ellipses_are_tabulated_with_the_reported_error(name, behind):
    """96 % lie within three reported errors of 8,192 points; 64 to 128 points have four times the error."""
    fabric = load_fabric(name)
    kinds = QueryOptions(sigma=(0.3, 3.0), stretch=6.0, behind=behind, max_angle=75.0)
    queries = draw_queries(kinds, fabric.weave.repeat, 12, 0, 100)
    converged = TruthOptions(estimator="owen", relative_error=1e-9, absolute_error=0.0, min_count=8192, max_count=8192)
    exact = estimate(fabric, queries, converged, 4)
    found = {}
    for estimator in ("auto", "owen"):
        options = TruthOptions(estimator=estimator, relative_error=0.1, min_count=64, max_count=128)
        answers = estimate(fabric, queries, options, 5)
        wrong, stated, reference = (
            np.linalg.norm(v.astype(np.float64), axis=1)
            for v in (answers.mean - exact.mean, answers.standard_error, exact.standard_error)
        )
        assert (wrong <= 3 * np.hypot(stated, reference) + 1e-6).mean() >= 0.96
        found[estimator] = np.sqrt(np.mean(wrong**2))
    assert found["auto"] < 0.25 * found["owen"]
