import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError
from scipy import stats

from pipeline.shards.queries import QueryOptions, draw_queries

LEVEL = 1e-4
SHAPED = QueryOptions(behind=0.3, stretch=8.0, curvature=(0.01, 0.5))


@settings(max_examples=40)
@given(start=st.integers(0, 10**9), count=st.integers(1, 50), seed=st.integers(0, 2**64 - 1))
def test_a_row_does_not_depend_on_its_neighbours(start, count, seed):
    for options in (QueryOptions(), SHAPED):
        together = draw_queries(options, (4, 3), seed, start, count)
        alone = draw_queries(options, (4, 3), seed, start + count - 1, 1)
        for whole, row in zip(together, alone, strict=True):
            np.testing.assert_array_equal(whole[-1], row[0])


def test_shapes_are_drawn_as_stated_and_leave_the_rest_as_it_was():
    """Kolmogorov-Smirnov for stretch, angle and curvature, a binomial test for the side; Sidak over four at LEVEL."""
    queries, plain = (draw_queries(options, (4, 3), 5, 0, 40_000) for options in (SHAPED, QueryOptions()))
    np.testing.assert_array_equal(np.abs(queries.wi), np.abs(plain.wi))
    np.testing.assert_allclose(np.sqrt(queries.sigma * queries.sigma_minor), plain.sigma, rtol=1e-6)
    uniforms = [
        np.log(queries.sigma / queries.sigma_minor) / math.log(8.0),
        queries.angle / math.pi,
        np.log(queries.curvature / 0.01) / math.log(50.0),
    ]
    values = [stats.kstest(values, "uniform").pvalue for values in uniforms]
    values.append(stats.binomtest(int((queries.wi[:, 2] < 0).sum()), 40_000, 0.3).pvalue)
    assert min(values) > 1 - (1 - LEVEL) ** (1 / len(values)), values


@pytest.mark.parametrize("directions", ["projected_disc", "hemisphere"])
def test_distributions(directions):
    options = QueryOptions(sigma=(0.1, 10.0), directions=directions, max_angle=80.0)
    queries = draw_queries(options, (4, 3), 5, 0, 40_000)
    sine = math.sin(math.radians(80.0))
    uniforms = [queries.u / 4, queries.v / 3, np.log(queries.sigma / 0.1) / math.log(100)]
    for w in (queries.wi, queries.wo):
        z = w[:, 2].astype(float)
        share = (1 - z * z) / sine**2 if directions == "projected_disc" else (1 - z) / (1 - math.sqrt(1 - sine**2))
        uniforms += [np.arctan2(w[:, 1], w[:, 0]) / (2 * math.pi) + 0.5, share]
        np.testing.assert_allclose(np.linalg.norm(w, axis=1), 1.0, atol=1e-6)
    worst = min(stats.kstest(values, "uniform").pvalue for values in uniforms)
    assert worst > 1 - (1 - LEVEL) ** (1 / len(uniforms))


@pytest.mark.parametrize(
    "bad",
    [{"sigma": (0, 1)}, {"sigma": (2, 1)}, {"max_angle": 90}, {"directions": "up"}, {"x": 1}, {"curvature": (0, 0.1)}],
)
def test_impossible_options_are_refused(bad):
    with pytest.raises(ValidationError):
        QueryOptions(**bad)
