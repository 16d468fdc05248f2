"""Gauss nodes in single precision against the point model in double precision on the same nodes, shadows off."""

import numpy as np
import pytest

from pipeline.analytic.gauss_nodes.answer import GaussNodesTable
from pipeline.analytic.gauss_nodes.footprint_nodes import place_nodes
from pipeline.analytic.horizon_points.rows import ROWS, STEP_V, STEP_Y, WEIGHT, X, Y
from pipeline.truth.query import Queries
from weaves.fabric import load_fabric

DIRECTIONS = [((0.3, -0.4), (0.1, 0.6)), ((-0.7, 0.3), (-0.6, 0.5)), ((0.2, 0.5), (0.2, -0.3))]

RTOL = 1e-4
"""Some forty roundings of 6e-8, and ten times that where a highlight's narrow denominator is a small difference. A
term that is wrong by 1 % changes a component by 0.2 % at least."""


def unit(x, y):
    return np.float32([x, y, np.sqrt(1.0 - x * x - y * y)])


def queries(sigma):
    wi, wo = (np.stack([unit(*pair[k]) for pair in DIRECTIONS]) for k in range(2))
    count = len(DIRECTIONS)
    place = np.linspace(0.3, 2.6, count).astype(np.float32)
    return Queries.round(place, place[::-1].copy(), np.full(count, sigma, np.float32), wi, wo)


def expected(point_shares, fabric, x, y, weight, wi, wo):
    """Return the four components of a query whose footprint is these points."""
    area, specular, diffuse = point_shares(fabric, x, y, wi, wo)
    components = np.concatenate([weight @ specular[:, :2], weight @ diffuse[:, :2]])
    return components / (weight @ area).sum()


@pytest.fixture(scope="module")
def fabric():
    fabric = load_fabric("denim")
    changes = {"relief": 1.2, "twist": 30.0, "width": 0.9}
    yarns = {key: getattr(fabric, key).model_copy(update=changes) for key in ("warp", "weft")}
    return fabric.model_copy(update={**yarns, "optical_thickness": 0.4})


@pytest.fixture(scope="module")
def table(fabric):
    """Nodes without boxes: a highlight has one place at each."""
    table = GaussNodesTable(fabric, 6, 3, shadows=False, grid=4, azimuths=8)
    table.nodes.points[STEP_V], table.nodes.points[STEP_Y] = 0.0, 0.0
    return table


def test_fixed_nodes(point_shares, fabric, table):
    asked = queries(1e3)
    points, weight = table.nodes.points, table.nodes.evenly.astype(np.float64)
    for row, found in enumerate(table.answer(asked)):
        truth = expected(point_shares, fabric, points[X], points[Y], weight, asked.wi[row], asked.wo[row])
        np.testing.assert_allclose(found, truth, rtol=RTOL)


def test_nodes_placed_in_the_footprint(point_shares, fabric, table):
    """Boxes shrink with the footprint; in one of 0.01 yarns a highlight's two places are one to 2e-5."""
    asked = queries(0.01)
    ends, picks = fabric.weave.repeat
    for row, found in enumerate(table.answer(asked)):
        points, line = np.zeros((ROWS, 2000), np.float32), np.zeros((4, 6), np.float32)
        count = place_nodes(
            table.map, table.nodes, asked.u[row] % ends, asked.v[row] % picks, asked.sigma[row], 3, line, points
        )  # fmt: skip
        x, y, weight = (points[k, :count].astype(np.float64) for k in (X, Y, WEIGHT))
        truth = expected(point_shares, fabric, x, y, weight, asked.wi[row], asked.wo[row])
        np.testing.assert_allclose(found, truth, rtol=RTOL)
