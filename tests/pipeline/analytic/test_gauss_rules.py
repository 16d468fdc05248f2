import math

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


def test_rules_are_exact_to_their_degree_and_readings_converge_to_a_gaussian():
    for count in range(1, 7):
        rule = gauss_rule(0.2, 0.9, count, 0.0)
        errors = [
            rule.weights @ rule.places**p - (0.9 ** (p + 1) - 0.2 ** (p + 1)) / (p + 1) for p in range(2 * count + 1)
        ]
        assert np.abs(errors[:-1]).max() < 1e-14 and abs(errors[-1]) > 1e-12
    table = taps(16)
    assert not table[1].any()
    for count in range(2, 17):
        places = table[count, :count]
        assert places.mean() == pytest.approx(0.0, abs=1e-12) and (places**2).mean() == pytest.approx(1.0)
    # The error of a wave of length 2 pi deviations falls with their number, by order 1 nearly: tails are missing.
    counts, table = 2 ** np.arange(3, 9), taps(256)
    errors = {
        wave: [abs(np.cos(wave * table[n, :n]).mean() - math.exp(-0.5 * wave**2)) for n in counts]
        for wave in (0.5, 1.0, 2.0)
    }
    assert max(own[-1] for own in errors.values()) < 0.01
    assert -1.5 < np.polyfit(np.log(counts[:-1]), np.log(errors[1.0][:-1]), 1)[0] < -0.7, errors
    np.testing.assert_allclose(table[:, :1] + [[table[n, n - 1]] for n in range(257)], 0.0, atol=1e-12)


@pytest.mark.parametrize("radius", [0.0, 0.4])
def test_rules_converge_faster_than_any_power(radius):
    """On a Gaussian: each node more divides the error by two at least, however small it is already."""
    counts = np.arange(2, 9)
    rules = [gauss_rule(0.1, 0.9, int(n), radius) for n in counts]
    exact = norm.cdf(0.9, 0.3, 0.25) - norm.cdf(0.1, 0.3, 0.25)
    errors = [abs(rule.weights @ norm.pdf(rule.places, 0.3, 0.25) - exact) for rule in rules]
    by_node = np.polyfit(counts, np.log(errors), 1)[0]
    by_order = np.polyfit(np.log(counts), np.log(errors), 1)[0]
    assert by_node < -math.log(2.0) and by_order < -4.0, errors
