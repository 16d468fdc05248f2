"""Weights of fixed nodes: the Gaussian over all images where the viewer sees each of them."""

import math

import numpy as np
import pytest

from pipeline.analytic.soft_nodes.nodes import LINES, START
from pipeline.analytic.soft_nodes.scratch import SoftQuery, scratch_for
from pipeline.analytic.soft_nodes.wide import displaced_weights
from pipeline.truth.footprint.mixture import narrow_axis
from tests.pipeline.analytic.methods import soft_table
from tests.presets import slow
from weaves.fabric import load_fabric


def weights(table, x, y, deviations, correlation, wo, bend):
    scratch = scratch_for(table)
    numbers = (*deviations, correlation, narrow_axis(*deviations, correlation), 0.0, 0.0, 1.0, *wo)
    turn = np.float32(0)
    look = SoftQuery(x, y, *(np.float32(n) for n in numbers), 0, 1, turn, 0, 1, turn, turn, np.float32(bend))
    displaced_weights(table, scratch, look)
    return scratch.lines


@pytest.mark.parametrize("name", ["denim", slow("satin_8")])
@pytest.mark.parametrize("correlation", [0.0, -0.4])
@pytest.mark.parametrize(("theta", "bend"), [(0.0, 0.0), (1.2, 0.0), (1.2, 0.05)])
def test_they_are_the_gaussian_over_all_images(name, correlation, theta, bend):
    """Cut off where it is 3.4 % of its peak; summed in double precision over every cell of nine repeats each way."""
    table = soft_table(load_fabric(name))
    ends, picks = (int(n) for n in table.repeat)
    x, y, deviations = 0.3, 1.7, (0.5, 0.8)
    wo = math.sin(theta) * math.cos(0.7), math.sin(theta) * math.sin(0.7), math.cos(theta)
    found, run = weights(table, x, y, deviations, correlation, wo, bend), math.tan(theta)
    within = np.linalg.inv(np.outer(deviations, deviations) * [[1.0, correlation], [correlation, 1.0]])
    expected = np.zeros(found.shape)
    for cell in range(ends * picks):
        for group in table.cell_groups[table.group_starts[cell] : table.group_starts[cell + 1]]:
            start, lines = int(table.groups[group, START]) // 8, int(table.groups[group, LINES])
            spots = table.spots[start : start + lines].astype(np.float64)
            over = spots[:, 3] - table.plane
            distance = 2.0 * over * run / (1.0 + np.sqrt(1.0 + 2.0 * bend * run**2 * over))
            for repeat in np.ndindex(9, 9):
                dx = spots[:, 0] - distance * math.cos(0.7) + cell % ends + ends * (repeat[0] - 4) - x
                dy = spots[:, 1] - distance * math.sin(0.7) + cell // ends + picks * (repeat[1] - 4) - y
                square = within[0, 0] * dx**2 + 2.0 * within[0, 1] * dx * dy + within[1, 1] * dy**2
                expected[start : start + lines] += spots[:, 2] * np.exp(-0.5 * square)
    assert expected.max() > 4.0 * expected.mean()
    np.testing.assert_allclose(found, expected, rtol=1e-4, atol=0.04 * expected.max())
    assert np.abs(found - expected).mean() < 2e-3 * expected.max()
    # A footprint that is not slanted takes sums along both axes, a slightly slanted one sums over cells.
    for wide in ((0.15, 0.2), deviations, (3.0, 4.0)):
        level, slanted = (weights(table, x, y, wide, rho, wo, bend) for rho in (0.0, 1e-6))
        np.testing.assert_allclose(level, slanted, rtol=1e-4, atol=1e-6 * level.max())
