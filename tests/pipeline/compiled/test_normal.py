"""The normal distribution against scipy."""

import numpy as np
from scipy import special

from pipeline.compiled.normal import normal_distribution, normal_quantile


def test_normal_quantile_matches_scipy():
    p = np.concatenate([np.logspace(-16, -1, 300), np.linspace(0.01, 0.99, 500), 1 - np.logspace(-10, -2, 100)])
    ours = np.array([normal_quantile(x) for x in p])
    np.testing.assert_allclose(ours, special.ndtri(p), rtol=2e-9, atol=1e-12)


def test_normal_distribution():
    x = np.linspace(-6, 6, 2001).astype(np.float32)
    ours = np.array([normal_distribution(value) for value in x])
    assert np.max(np.abs(ours - special.ndtr(x.astype(np.float64)))) < 4e-7
