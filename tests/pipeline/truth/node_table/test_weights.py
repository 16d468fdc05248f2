import numpy as np
import pytest

from pipeline.truth.footprint.place import BOX, GAUSSIAN, Axis, place
from pipeline.truth.node_table.weights import interval_masses


@pytest.mark.parametrize("shape", [GAUSSIAN, BOX])
@pytest.mark.parametrize("sigma", [0.03, 0.3, 1.0, 1.6, 7.0])
def test_masses_of_a_repeat_sum_to_one_and_match_sampled_places(shape, sigma):
    """Chi-square of 40,000 stratified places against the masses of 24 unequal intervals of a repeat of 3."""
    axis = Axis(shape, 2.8, sigma, 3.0)
    edges = np.sort(np.concatenate([[0.0, 1.0], np.random.default_rng(1).random(7)])).astype(np.float32)
    parts = []
    for cell in range(3):
        masses = np.zeros(8, np.float32)
        interval_masses(axis, edges, float(cell), masses)
        parts.append(masses.astype(np.float64))
    masses = np.concatenate(parts)
    assert masses.sum() == pytest.approx(1.0, abs=2e-6)
    borders = np.concatenate([edges[:-1].astype(np.float64) + cell for cell in range(3)] + [[3.0]])
    places = [place(axis, (k + 0.5) / 40_000) for k in range(40_000)]
    found, _ = np.histogram([x for x, _ in places], borders, weights=[w for _, w in places])
    # Stratified places: every interval is right to a place or two at each of its ends.
    np.testing.assert_allclose(found / 40_000, masses, atol=2e-4)
