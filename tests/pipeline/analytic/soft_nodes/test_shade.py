"""Sums over soft nodes in single precision against the point model in double precision on the same nodes."""

import numpy as np
import pytest

from pipeline.analytic.soft_nodes.answer import query_sums
from pipeline.analytic.soft_nodes.nodes import tabulate
from pipeline.analytic.soft_nodes.shade import AREA, OPEN_DIFFUSE, OPEN_SPECULAR
from pipeline.truth.geometry.heightfield import ALPHA, BLEND, WARP
from pipeline.truth.query import Queries
from pipeline.truth.scattering import slab
from tests.directions import above
from tests.pipeline.truth.cloths import woven

DIRECTIONS = [((0.3, -0.4), (0.1, 0.6)), ((-0.7, 0.3), (-0.6, 0.5)), ((0.2, 0.5), (0.2, -0.3))]

RTOL = 1e-4
"""Some forty roundings of 6e-8, and ten times that where a highlight's narrow denominator is a small difference. A
term that is wrong by 1 % changes a sum by 0.2 % at least."""


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
    """Area, diffuse and specular of whole boxes, from the normals and tangents that the table holds."""
    wi, wo = (np.float32(above(*w)) for w in pair)
    nodes = table.nodes.transpose(1, 0, 2)
    towards = wo[:, None, None] * np.ones((1, *nodes.shape[1:]), np.float32)
    weft = slice(table.starts[1], table.starts[2])
    towards[0, weft], towards[1, weft] = wo[1], -wo[0]
    # A node that faces away has a small cosine to the viewer: a part of its box may not.
    cosines = np.maximum((towards * nodes[:3]).sum(axis=0), 0.05)
    whole = np.divide(cosines, nodes[2], out=np.zeros_like(cosines), where=nodes[2] > 0.0)
    table = table._replace(areas=np.broadcast_to(whole, table.areas.shape).copy())
    found, _ = query_sums(table, Queries.round([0.3], [0.7], [1e3], wi[None], wo[None]))
    for family in (0, 1):
        blocks = slice(table.starts[family], table.starts[family + 1])
        nodes = table.nodes[blocks].transpose(1, 0, 2).reshape(13, -1).astype(np.float64)
        weight, yarn = table.evenly[blocks].ravel().astype(np.float64), table.yarn[family].astype(np.float64)
        i, o = ((w if family == WARP else w[[1, 0, 2]] * [1, -1, 1]).astype(np.float64) for w in (wi, wo))
        sums = np.zeros(3)
        for k in range(len(weight)):
            n, t = nodes[:3, k], nodes[4:7, k]
            cos_i, cos_o = float(i @ n), max(float(o @ n), 0.05)
            area = weight[k] * cos_o / n[2]
            sums[0] += area
            if cos_i > 0:
                flakes = slab.density(*(i + o), *t, yarn[ALPHA])
                areas = (slab.sigma(*w, *t, yarn[ALPHA]) for w in (i, o))
                sums[1] += area * (yarn[BLEND] * cos_i + (1.0 - yarn[BLEND]) * i[2])
                sums[2] += area * cos_i * slab.reflection(flakes, *areas, cos_i, cos_o, float(table.thickness))
        np.testing.assert_allclose(found[0, family, [AREA, OPEN_DIFFUSE, OPEN_SPECULAR]], sums, rtol=RTOL)
