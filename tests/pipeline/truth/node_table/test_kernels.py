import math

import numpy as np
import pytest

from pipeline.truth.geometry.heightfield import ALPHA, BLEND, GAP, height_field
from pipeline.truth.node_table import kernels
from pipeline.truth.node_table.build import FIRST_FINE, FIRST_NODE, NODES_X, NODES_Y, PIECE_FAMILY, tabulate
from pipeline.truth.scattering import slab
from tests.directions import above
from tests.pipeline.truth.cloths import woven

WI = [(0.3, -0.4), (-0.7, 0.3), (0.05, 0.02)]
WO = [(0.1, 0.6), (-0.6, 0.5), (-0.1, 0.3)]
CASES = list(zip(WI, WO, strict=True))

RTOL = 1e-4
"""Some thirty roundings of 6e-8, and ten times that where a highlight's narrow denominator is a small difference."""


def direction(w):
    """Return a direction that rises by 1, half-way between two azimuths."""
    return kernels.Direction(*w, slope=np.float32(1.0), first=0, second=1, turn=np.float32(0.5))


def layer(field, family):
    alpha = float(field.yarn[family, ALPHA])
    return kernels.FlakeLayer(*(np.float32(x) for x in (alpha**2, field.thickness, alpha**3 / (4 * math.pi))))


@pytest.fixture(scope="module")
def cloth():
    field = height_field(woven("denim", relief=1.2, twist=30.0).model_copy(update={"optical_thickness": 0.4}))
    return field, tabulate(field, field, True, 16, 8)


def pieces(table):
    """Yield family, and the nodes' and the first fine nodes' slices, of every piece of yarn."""
    for piece in table.pieces:
        count = piece[NODES_X] * piece[NODES_Y]
        if piece[PIECE_FAMILY] != GAP:
            yield piece[PIECE_FAMILY], *(slice(piece[k], piece[k] + count) for k in (FIRST_NODE, FIRST_FINE))


def scattered(field, family, wi, wo, normal, tangent, inverse):
    """Return f cos_i cos_o / n_z of every node in double precision; wi from behind is transmitted."""
    alpha = float(field.yarn[family, ALPHA])
    function = slab.transmission if wi[2] < 0 else slab.reflection
    found = np.zeros(len(inverse))
    for k in range(len(found)):
        cos_i, cos_o = float(wi @ normal[:, k]), float(wo @ normal[:, k])
        if wi[2] < 0:
            cos_i = -cos_i
        if cos_i > 0 and cos_o > 0:
            t = tangent[:, k]
            flakes = slab.density(*(wi + wo), *t, alpha)
            sigma_i, sigma_o = (slab.sigma(*w, *t, alpha) for w in (wi, wo))
            value = function(flakes, sigma_i, sigma_o, cos_i, cos_o, field.thickness)
            found[k] = value * cos_i * cos_o * inverse[k]
    return found


@pytest.mark.parametrize("behind", [False, True], ids=["reflected", "transmitted"])
@pytest.mark.parametrize("case", CASES)
def test_specular(cloth, case, behind):
    field, table = cloth
    wi, wo = (above(*w).astype(np.float32) for w in case)
    given = wi.astype(np.float64) * (-1 if behind else 1)
    size = np.float32(1.0 / ((given + wo) ** 2).sum())
    for family, _, fine in pieces(table):
        parts = [np.ascontiguousarray(row[fine]) for row in table.fine]
        lit, shares = np.ones_like(parts[0]), np.zeros_like(parts[0])
        surface, towards = (kernels.Normals(*parts[:4]), kernels.Tangents(*parts[4:])), (direction(wi), direction(wo))
        total = kernels.scattered(*surface, *towards, size, layer(field, family), lit, shares, behind or None)
        wide = np.stack(parts).astype(np.float64)
        expected = scattered(field, family, given, wo.astype(np.float64), wide[:3], wide[4:], wide[3])
        assert (expected > 0).mean() > 0.2
        np.testing.assert_allclose(shares, expected, rtol=RTOL, atol=1e-7 * expected.max())
        assert total == pytest.approx(expected.sum(), rel=RTOL)


@pytest.mark.parametrize("case", CASES)
def test_area_diffuse_and_unscattered(cloth, case):
    """The horizon lies below every direction, so that only cosines decide."""
    field, table = cloth
    wi, wo = (above(*w).astype(np.float32) for w in case)
    for family, nodes, fine in pieces(table):
        normal = kernels.Normals(*(np.ascontiguousarray(row[nodes]) for row in table.normal))
        count = len(normal.x)
        shares, low = kernels.no_shares(count), np.full(count, -1e3, np.float32)
        shares.weight[:] = 1.0
        flat, blend = kernels.HorizonSlopes(low, low), np.float32(field.yarn[family, BLEND])
        found = kernels.weigh(normal, direction(wi), flat, direction(wo), flat, blend, shares)
        n, i, o = np.stack(normal[:3]).astype(np.float64), wi.astype(np.float64), wo.astype(np.float64)
        cos_i, area = i @ n, np.maximum(o @ n, 0.0) / n[2]
        own = float(field.yarn[family, BLEND])
        expected = np.where(cos_i > 0, area * (own * cos_i + (1.0 - own) * i[2]), 0.0)
        np.testing.assert_allclose(shares.areas, area, rtol=RTOL, atol=1e-6)
        np.testing.assert_allclose(shares.diffuses, expected, rtol=RTOL, atol=1e-6)
        assert found == pytest.approx((area.sum(), expected.sum()), rel=RTOL)

        tangent = kernels.Tangents(*(np.ascontiguousarray(row[fine]) for row in table.fine[4:]))
        alpha = float(field.yarn[family, ALPHA])
        crossed = kernels.crossing(normal, tangent, direction(wo), layer(field, family), shares.areas)
        t = np.stack(tangent).astype(np.float64)
        seen = np.flatnonzero(area > 0)
        sizes = [(slab.sigma(*o, *t[:, k], alpha), float(o @ n[:, k])) for k in seen]
        through = [slab.unscattered(*size, field.thickness) for size in sizes]
        assert crossed == pytest.approx(area[seen] @ through, rel=RTOL)
