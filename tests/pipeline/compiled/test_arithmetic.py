import numpy as np
from scipy import special

from pipeline.compiled.float32 import absorbed, arcsine, remaining
from pipeline.compiled.normal import normal_distribution, normal_quantile

DEPTHS = np.concatenate([np.logspace(-30, 1.9, 4000), [0.0]]).astype(np.float32)


def test_absorbed_keeps_its_digits_from_thin_to_thick():
    exact = -special.expm1(-DEPTHS[:-1].astype(np.float64))
    ours = np.array([absorbed(x) for x in DEPTHS[:-1]])
    assert np.max(np.abs(ours / exact - 1)) < 6e-7
    assert absorbed(np.float32(0.0)) == 0.0


def test_remaining_decays_to_nothing():
    exact = np.exp(-DEPTHS.astype(np.float64))
    ours = np.array([remaining(x) for x in DEPTHS], np.float64)
    assert np.max(np.abs(ours / exact - 1)[DEPTHS < 60]) < 3e-5
    assert np.all(ours >= 0) and remaining(np.float32(1e30)) < 1e-30


def test_arcsine():
    x = np.linspace(-1, 1, 2001).astype(np.float32)
    ours = np.array([arcsine(value) for value in x])
    assert np.max(np.abs(ours - np.arcsin(x.astype(np.float64)))) < 7e-5


def test_normal_quantile_matches_scipy():
    p = np.concatenate([np.logspace(-16, -1, 300), np.linspace(0.01, 0.99, 500), 1 - np.logspace(-10, -2, 100)])
    ours = np.array([normal_quantile(x) for x in p])
    np.testing.assert_allclose(ours, special.ndtri(p), rtol=2e-9, atol=1e-12)


def test_normal_distribution():
    x = np.linspace(-6, 6, 2001).astype(np.float32)
    ours = np.array([normal_distribution(value) for value in x])
    assert np.max(np.abs(ours - special.ndtr(x.astype(np.float64)))) < 4e-7
