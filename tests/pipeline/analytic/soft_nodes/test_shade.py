"""Sums over soft nodes in single precision against the point model in double precision on the same nodes."""

import math

import numpy as np
import pytest

from pipeline.analytic.soft_nodes.answer import sum_queries
from pipeline.analytic.soft_nodes.footprint_nodes import CoveredPart, Footprint, fill_block, place_nodes
from pipeline.analytic.soft_nodes.nodes import BLOCK_NODES, CURVE, X_HIGH, X_LOW, Y_HIGH, Y_LOW, tabulate
from pipeline.analytic.soft_nodes.scratch import scratch_for
from pipeline.analytic.soft_nodes.shade import (
    ALONG,
    BARE_AREA,
    BARE_DIFFUSE,
    BARE_SPECULAR,
    HALF_ALONG,
    HALF_V,
    NODE_SUMS,
    SIN,
    WEIGHT,
    GridHorizons,
    directions,
    shade_footprint,
)
from pipeline.truth.geometry.heightfield import ALPHA, BLEND, RADIUS, WARP
from pipeline.truth.scattering import slab
from tests.pipeline.truth.cloths import woven

DIRECTIONS = [((0.3, -0.4), (0.1, 0.6)), ((-0.7, 0.3), (-0.6, 0.5)), ((0.2, 0.5), (0.2, -0.3))]

RTOL = 1e-4
"""Some forty roundings of 6e-8, and ten times that where a highlight's narrow denominator is a small difference. A
term that is wrong by 1 % changes a sum by 0.2 % at least."""


def unit(x, y):
    return np.float32([x, y, np.sqrt(1.0 - x * x - y * y)])


@pytest.fixture(scope="module")
def fabric():
    return woven("denim", relief=1.2, twist=30.0).model_copy(update={"optical_thickness": 0.4})


@pytest.fixture(scope="module")
def table(fabric):
    """Fixed nodes without boxes: a highlight has one place at each."""
    table = tabulate(fabric)
    nodes = table.nodes.copy()
    nodes[:, 7:] = 0.0
    return table._replace(nodes=nodes)


@pytest.mark.parametrize("pair", DIRECTIONS)
def test_fixed_nodes(table, pair):
    """Area, diffuse and specular with nothing hidden, from the normals and tangents that the table holds."""
    wi, wo = (unit(*w) for w in pair)
    wide = tuple(np.array([x], np.float32) for x in (0.3, 0.7, 1e3, 1e3, 0.0))
    found, _ = sum_queries(table, wide, wi[None], wo[None], np.zeros(1, np.float32))
    for family in (0, 1):
        blocks = slice(table.starts[family], table.starts[family + 1])
        nodes = table.nodes[blocks].transpose(1, 0, 2).reshape(13, -1).astype(np.float64)
        weight, yarn = table.evenly[blocks].ravel().astype(np.float64), table.yarn[family].astype(np.float64)
        i, o = ((w if family == WARP else w[[1, 0, 2]] * [1, -1, 1]).astype(np.float64) for w in (wi, wo))
        sums = np.zeros(3)
        for k in range(len(weight)):
            n, t = nodes[:3, k], nodes[4:7, k]
            cos_i, cos_o = float(i @ n), float(o @ n)
            if cos_o <= 0:
                continue
            area = weight[k] * cos_o / n[2]
            sums[0] += area
            if cos_i > 0:
                flakes = slab.density(*(i + o), *t, yarn[ALPHA])
                areas = (slab.sigma(*w, *t, yarn[ALPHA]) for w in (i, o))
                sums[1] += area * (yarn[BLEND] * cos_i + (1.0 - yarn[BLEND]) * i[2])
                sums[2] += area * cos_i * slab.reflection(flakes, *areas, cos_i, cos_o, float(table.thickness))
        np.testing.assert_allclose(found[0, family, [BARE_AREA, BARE_DIFFUSE, BARE_SPECULAR]], sums, rtol=RTOL)


@pytest.mark.parametrize("deviations", [(0.3, 0.35), (0.04, 0.35), (0.05, 0.04)], ids=["part", "across", "whole"])
@pytest.mark.parametrize("pair", DIRECTIONS)
def test_nodes_placed_in_the_footprint(point_shares, fabric, table, pair, deviations):
    """A footprint over the middle of the piece of each family's first cell; the grid of horizons is not read."""
    wi, wo = (unit(*w) for w in pair)
    ends = fabric.weave.repeat[0]
    for family in (0, 1):
        piece = next(p for p in range(len(table.pieces)) if table.pieces[p, 0] == family)
        cell = int(np.searchsorted(table.piece_starts, piece, side="right")) - 1
        bounds, yarn = table.bounds[piece], table.yarn[family]
        assert bounds[CURVE] > 0
        scratch = scratch_for(table, 4 * BLOCK_NODES)
        nodes, cells = scratch.nodes[family], scratch.cells[family]
        corners = [bounds[column] for column in (X_LOW, X_HIGH, Y_LOW, Y_HIGH)]
        # Away from the edges of the yarn, where a point's own rounding turns the normal.
        part = CoveredPart(*(np.float32(0.5 + 0.9 * (x - 0.5)) for x in corners))
        footprint = Footprint(*(np.float32(x) for x in (0.55, 0.4, *deviations)))
        place_nodes(table, scratch, piece, 0, footprint, part, family)
        stop = scratch.stops[family]
        count = fill_block(nodes, cells, stop)
        nodes[HALF_V], nodes[HALF_ALONG] = 0.0, 0.0
        open_sky = GridHorizons(np.zeros(1, np.uint8), np.uint32(0), np.uint32(0), np.float32(0.0))
        given = directions(*wi, *wo, family)
        found = shade_footprint(
            nodes, np.zeros(count, np.uint32), open_sky, open_sky, np.float32(1.0), given, yarn, table.thickness
        )
        assert len(found) == NODE_SUMS

        rows = nodes[:, :stop].astype(np.float64)
        across = 0.5 + float(yarn[RADIUS]) * rows[SIN]
        along = 0.5 + (rows[ALONG] if family == WARP else -rows[ALONG]) - float(bounds[4])
        x, y = (across, along) if family == WARP else (along, across)
        area, specular, diffuse = point_shares(fabric, cell % ends + x, cell // ends + y, wi, wo)
        expected = [rows[WEIGHT] @ part[:, family] for part in (area, math.pi * diffuse, specular)]
        np.testing.assert_allclose([found[k] for k in (BARE_AREA, BARE_DIFFUSE, BARE_SPECULAR)], expected, rtol=RTOL)
