import numpy as np
import pytest
from scipy.stats import norm

from pipeline.analytic.gauss_rules import gauss_rule, grid_edges, grid_middles, overlap, taps


@pytest.mark.parametrize(("low", "high", "radius"), [(0.0, 1.0, 0.5), (0.2, 0.8, 0.3), (0.0, 0.25, 0.0)])
def test_rules_integrate_and_their_boxes_tile(low, high, radius):
    """The integral of (x - 1/2)^2, with a circle's substitution to the error of eight nodes."""
    found = gauss_rule(low, high, 8, radius)
    exact = ((high - 0.5) ** 3 - (low - 0.5) ** 3) / 3.0
    assert found.weights.sum() == pytest.approx(high - low)
    assert (found.weights * (found.places - 0.5) ** 2).sum() == pytest.approx(exact, rel=1e-6)
    assert found.borders[0] == low and found.borders[-1] == pytest.approx(high)
    assert found.shares[0] == 0.0 and found.shares[-1] == pytest.approx(1.0)
    shares = np.arcsin((found.places - 0.5) / radius) / np.pi + 0.5 if radius else (found.places - low) / (high - low)
    assert ((shares > found.shares[:-1]) & (shares < found.shares[1:])).all()
    assert ((found.places > found.borders[:-1]) & (found.places < found.borders[1:])).all()


@pytest.mark.parametrize("radius", [0.3, 0.0])
def test_overlaps_are_shares(radius):
    borders = gauss_rule(0.2, 0.8, 5, radius).borders
    edges = grid_edges(0.2, 0.8, 12, radius)
    share = overlap(borders, edges)
    np.testing.assert_allclose(share.sum(axis=1), 1.0)
    # Shares times boxes give back the cells of the grid.
    np.testing.assert_allclose(np.diff(borders) @ share, np.diff(edges), rtol=1e-9)
    middles = grid_middles(0.2, 0.8, 12, radius)
    assert ((middles > edges[:-1]) & (middles < edges[1:])).all()


def test_readings_have_the_moments_of_a_gaussian():
    table = taps(16)
    assert not table[1].any()
    for count in range(2, 17):
        places = table[count, :count]
        assert places.mean() == pytest.approx(0.0, abs=1e-12) and (places**2).mean() == pytest.approx(1.0)


def test_many_readings_damp_a_wave_as_a_gaussian_does():
    places = taps(256)[256]
    for wave in (0.5, 1.0, 2.0):
        expected = norm.expect(lambda z, wave=wave: np.cos(wave * z))
        assert np.cos(wave * places).mean() == pytest.approx(expected, abs=0.01)
