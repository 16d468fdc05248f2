"""Sampling with a horizon map: its horizons against exact ones, its error against the number of points."""

import numpy as np
import pytest

from pipeline.analytic.exact_points import sample_points
from pipeline.analytic.horizon_points.horizon_map import SLOTS, horizon_map
from pipeline.analytic.horizon_points.sampler import sample_horizons, tabulate
from pipeline.shards.queries import QueryOptions, draw_queries
from pipeline.truth.cloth import cloth_side
from pipeline.truth.estimator import estimate
from pipeline.truth.geometry.horizon import horizons
from pipeline.truth.geometry.pieces import different_cells
from pipeline.truth.options import TruthOptions
from weaves.fabric import load_fabric

COLOUR = np.array([0.3, 0.3, 0.5, 0.5])
COUNTS = np.array([4, 16, 64, 256])


@pytest.fixture(scope="module")
def denim():
    """The cloth, 200 queries of middle size, and the truth."""
    fabric = load_fabric("denim")
    queries = draw_queries(QueryOptions(sigma=(0.3, 1.0), max_angle=60.0), fabric.weave.repeat, 11, 0, 200)
    return fabric, queries, estimate(fabric, queries, TruthOptions(relative_error=0.005), 1).mean @ COLOUR


def test_exact_points_err_by_their_order(denim):
    """Independent points by n^-1/2, within three standard errors of the fit; the R2 sequence errs less throughout."""
    fabric, queries, truth = denim
    cloth = cloth_side(fabric, TruthOptions())
    independent, r2 = (
        [np.sqrt(np.mean((sample_points(cloth, queries, n, 3, sequence) @ COLOUR - truth) ** 2)) for n in COUNTS]
        for sequence in (False, True)
    )
    assert -0.6 < np.polyfit(np.log(COUNTS), np.log(independent), 1)[0] < -0.4, independent
    assert (np.array(r2) < independent).all(), (r2, independent)


def test_a_map_adds_a_bias_that_a_finer_map_lacks(denim):
    """At 1,024 points of the R2 sequence the map's half node is what is left."""
    fabric, queries, truth = denim
    errors = []
    for grid in (4, 16):
        answers = sample_horizons(tabulate(fabric, grid, 32), queries, 1024, True, 3) @ COLOUR
        errors.append(np.sqrt(np.mean((answers - truth) ** 2)) / truth.mean())
    assert errors[1] < 0.5 * errors[0] and errors[1] < 0.03, errors


@pytest.mark.parametrize("name", ["polyester_lining", "satin_8", "voile"])
def test_nodes_have_the_exact_horizon(name):
    """The first piece of the first cell: its nodes lie on the yarn on top, evenly in v and along it."""
    model = cloth_side(load_fabric(name), TruthOptions())
    field, grid, azimuths = model.front, 8, 16
    table = horizon_map(field, model.back, grid, azimuths)
    assert len(table.horizon) % (azimuths * grid * grid) == 0
    assert table.blocks.reshape(-1, SLOTS)[:, 0].size == field.top.size
    assert len(set(table.blocks.reshape(-1, SLOTS)[:, 0].tolist())) == different_cells(field)
    radius = field.yarn[field.top[0, 0], 0]
    middles = (np.arange(grid) + 0.5) / grid
    across, along = np.tile(0.5 + radius * np.sin(np.pi * (middles - 0.5)), grid), np.repeat(middles, grid)
    x, y = (across, along) if field.top[0, 0] == 0 else (along, across)
    slopes = horizons(field, x, y, azimuths, False).astype(np.float64)
    first = table.blocks[0]
    own = table.horizon[first : first + azimuths * grid * grid].reshape(azimuths, -1)
    np.testing.assert_allclose(own, slopes / np.sqrt(1.0 + slopes**2), atol=1e-6)
