"""Single-precision arithmetic of the vector loops against double precision."""

import math

import numpy as np
import pytest
from scipy import special, stats

from pipeline.compiled.float32 import absorbed, arcsine, remaining
from pipeline.truth.footprint.place import BOX, BOX_SIDE, GAUSSIAN, interval_masses, normal_distribution, place

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


def test_normal_distribution():
    x = np.linspace(-6, 6, 2001).astype(np.float32)
    ours = np.array([normal_distribution(value) for value in x])
    assert np.max(np.abs(ours - special.ndtr(x.astype(np.float64)))) < 4e-7


@pytest.mark.parametrize("shape", [GAUSSIAN, BOX])
@pytest.mark.parametrize("sigma", [0.03, 0.3, 1.0, 1.6, 7.0])
def test_masses_of_a_repeat_sum_to_one_and_match_sampled_places(shape, sigma):
    """Chi-square of 40,000 stratified places against the masses of 24 unequal intervals of a repeat of 3."""
    repeat, centre = 3.0, 2.8
    edges = np.sort(np.concatenate([[0.0, 1.0], np.random.default_rng(1).random(7)])).astype(np.float32)
    parts = []
    for cell in range(3):
        masses = np.zeros(8, np.float32)
        interval_masses(shape, centre, sigma, repeat, edges, float(cell), masses)
        parts.append(masses.astype(np.float64))
    masses = np.concatenate(parts)
    assert masses.sum() == pytest.approx(1.0, abs=2e-6)
    borders = np.concatenate([edges[:-1].astype(np.float64) + cell for cell in range(3)] + [[3.0]])
    places = [place(shape, centre, sigma, repeat, (k + 0.5) / 40_000) for k in range(40_000)]
    found, _ = np.histogram([x for x, _ in places], borders, weights=[w for _, w in places])
    # Stratified places: every interval is right to a place or two at each of its ends.
    np.testing.assert_allclose(found / 40_000, masses, atol=2e-4)


def test_a_box_side_is_what_the_standard_deviation_says():
    assert stats.uniform(0, BOX_SIDE).std() == pytest.approx(1.0) and math.isclose(BOX_SIDE, math.sqrt(12))
