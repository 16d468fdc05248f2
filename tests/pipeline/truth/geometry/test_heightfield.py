import numpy as np
import pytest

from pipeline.truth.geometry.heightfield import UNDER, height_field, surface_at
from tests.pipeline.truth.cloths import woven
from weaves.fabric import load_fabric
from weaves.surface import GAP
from weaves.surface import surface_at as oracle

FABRICS = {
    "denim": load_fabric("denim"),
    "narrow charmeuse": woven("silk_charmeuse", width=0.7, twist=20.0),
    "flattened basket": woven("basket", relief=0.4, twist=-40.0, width=0.9),
    "straight": woven("polyester_lining", bend=0.0),
    "steep narrow": woven("polyester_lining", bend=70.0, width=0.8),
}


@pytest.mark.parametrize("name", FABRICS)
def test_surface_matches_the_oracle(name):
    fabric = FABRICS[name]
    field = height_field(fabric)
    ends, picks = fabric.weave.repeat
    x, y = np.random.default_rng(4).random((2, 2000)) * np.array([[ends], [picks]])
    expected = oracle(fabric, x, y)
    found = np.array([surface_at(field, a, b, int(a), int(b)) for a, b in zip(x, y, strict=True)])
    np.testing.assert_array_equal(found[:, 0], expected.yarn)
    solid = expected.yarn != GAP
    np.testing.assert_array_equal(found[solid, 1] == UNDER, expected.under[solid])
    np.testing.assert_allclose(found[solid, 2], expected.height[solid], atol=1e-12)
    np.testing.assert_allclose(found[solid, 3:6], expected.normal[solid], atol=1e-11)
    np.testing.assert_allclose(found[solid, 6:9], expected.tangent[solid], atol=1e-11)
    crown = field.crown[y.astype(int), x.astype(int)]
    assert field.crown.min() > 0 and (expected.height[solid] <= crown[solid] + 1e-12).all()
