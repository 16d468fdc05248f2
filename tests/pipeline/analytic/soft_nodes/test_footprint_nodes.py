"""Nodes placed in a footprint: their weights and moments against integrals of the Gaussian over a rectangle."""

import numpy as np
import pytest
from scipy.stats import norm

from pipeline.analytic.soft_nodes.footprint_nodes import REACH, CoveredPart, Footprint, gap_area, place_nodes
from pipeline.analytic.soft_nodes.nodes import BLOCK_NODES, CURVE, FAMILY, SHIFT, X_HIGH, X_LOW, Y_HIGH, Y_LOW
from pipeline.analytic.soft_nodes.scratch import scratch_for
from pipeline.analytic.soft_nodes.shade import ALONG, COS, HALF_ALONG, SIN, WEIGHT, GridHorizons
from pipeline.truth.geometry.heightfield import GAP, RADIUS, WARP, WEFT
from tests.pipeline.analytic.methods import soft_table
from tests.pipeline.truth.cloths import woven

TABLE = soft_table(woven("denim", ("##.", ".##", "#.#"), width=0.8))
OPEN = GridHorizons(TABLE.grid.ravel() * np.uint8(0), np.uint32(0), np.uint32(0), np.float32(0.0))


def piece_of(family):
    """Return the first piece of a family on top, or the first gap; both begin at the corner of a cell."""
    of_family = TABLE.pieces[:, FAMILY] == family
    return int(np.flatnonzero(of_family & ((TABLE.bounds[:, CURVE] > 0.0) | (family == GAP)))[0])


def covered(bounds, shape):
    """Return a footprint, what it covers of a piece, and mass and mean of the Gaussian there along x and y."""
    u, v, dx, dy = shape
    x = max(bounds[X_LOW], u - REACH * dx), min(bounds[X_HIGH], u + REACH * dx)
    y = max(bounds[Y_LOW], v - REACH * dy), min(bounds[Y_HIGH], v + REACH * dy)
    assert x[0] < x[1] and y[0] < y[1]
    numbers = (Footprint(*(np.float32(n) for n in shape)), CoveredPart(*(np.float32(n) for n in (*x, *y))))
    return *numbers, moments(*x, u, dx), moments(*y, v, dy)


def moments(low, high, centre, deviation):
    a, b = (low - centre) / deviation, (high - centre) / deviation
    mass = norm.cdf(b) - norm.cdf(a)
    return mass, centre + deviation * (norm.pdf(a) - norm.pdf(b)) / mass


SHAPES = [
    (0.5, 0.5, 0.05, 0.04), (0.5, 0.5, 0.12, 0.2), (0.2, 0.9, 0.08, 0.25), (0.8, 0.1, 0.2, 0.06), (0.1, 0.4, 0.24, 0.5),
]  # fmt: skip


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("family", [WARP, WEFT])
def test_weights_are_shares_of_the_footprint(family, shape):
    """Mass to 3 %, as three nodes on the half circle across a yarn are; its centre to 3 % of a deviation."""
    p = piece_of(family)
    bounds, radius = TABLE.bounds[p].astype(float), float(TABLE.yarn[family, RADIUS])
    shape = shape if family == WARP else (shape[1], shape[0], shape[3], shape[2])
    at, part, (mass_x, mean_x), (mass_y, mean_y) = covered(bounds, shape)
    scratch = scratch_for(TABLE, 4 * BLOCK_NODES)
    place_nodes(TABLE, scratch, p, 0, at, part, family)
    nodes = scratch.nodes[family][:, : scratch.stops[family]].astype(np.float64)
    np.testing.assert_allclose(nodes[SIN] ** 2 + nodes[COS] ** 2, 1.0, atol=1e-6)
    across, sign = 0.5 + radius * nodes[SIN], 1.0 if family == WARP else -1.0
    along = 0.5 - bounds[SHIFT] + sign * nodes[ALONG]
    x, y = (across, along) if family == WARP else (along, across)
    # Where a piece covers all of a footprint along an axis, weights add up to 1: the tail is not cut off.
    mass_x, mass_y = (1.0 if mass > 0.9906 else mass for mass in (mass_x, mass_y))
    weight = nodes[WEIGHT]
    assert weight.sum() == pytest.approx(mass_x * mass_y, rel=0.03)
    assert weight @ x / weight.sum() == pytest.approx(mean_x, abs=0.03 * shape[2])
    assert weight @ y / weight.sum() == pytest.approx(mean_y, abs=0.03 * shape[3])
    # The boxes of a Gauss rule tile what it covers along the yarn.
    _, lines = np.unique(np.round(along, 5), return_index=True)
    length = part.y_high - part.y_low if family == WARP else part.x_high - part.x_low
    if (mass_y if family == WARP else mass_x) < 1.0:
        assert 2.0 * nodes[HALF_ALONG][lines].sum() == pytest.approx(float(length), rel=1e-5)


@pytest.mark.parametrize("centre", [(0.05, 0.05), (0.15, 0.0)])
@pytest.mark.parametrize("deviations", [(0.04, 0.05), (0.2, 0.1)])
def test_a_gap_has_its_share_times_the_cosine_and_none_under_a_high_horizon(centre, deviations):
    p = piece_of(GAP)
    at, part, (mass_x, _), (mass_y, _) = covered(TABLE.bounds[p].astype(float), (*centre, *deviations))
    for level, share in ((0, 1.0), (204, 0.5), (255, 0.0)):
        walls = OPEN._replace(grid=np.full_like(OPEN.grid, level))
        area = gap_area(
            TABLE.bounds[p], 0, TABLE.grid.shape[2], walls, np.float32(20.0), np.float32(0.8), at, part, TABLE.legendre
        )
        assert area == pytest.approx(share * 0.8 * mass_x * mass_y, rel=5e-3, abs=1e-6)
