"""One texel in single precision against the point model in double precision at its centre."""

import numpy as np
import pytest

from pipeline.analytic.prefiltered import NONE, PrefilteredMaps
from pipeline.truth.query import Queries
from weaves.fabric import load_fabric

PER_YARN = 16

RTOL = 1e-4
"""Some forty roundings of 6e-8, and ten times that where a highlight's narrow denominator is a small difference."""


def unit(x, y):
    return np.float32([x, y, np.sqrt(1.0 - x * x - y * y)])


@pytest.mark.parametrize(("wi", "wo"), [((0.3, -0.4), (0.1, 0.6)), ((-0.7, 0.3), (-0.6, 0.5))], ids=["apart", "near"])
def test_a_texel_is_a_point(point_shares, wi, wo):
    """A tiny footprint at a texel's centre reads that texel alone."""
    fabric = load_fabric("denim")
    changes = {"relief": 1.2, "twist": 30.0}
    yarns = {key: getattr(fabric, key).model_copy(update=changes) for key in ("warp", "weft")}
    fabric = fabric.model_copy(update={**yarns, "optical_thickness": 0.4})
    ends, picks = fabric.weave.repeat
    columns, rows = (1 << int(np.ceil(np.log2(extent * PER_YARN))) for extent in (ends, picks))
    x, y = np.meshgrid((np.arange(columns) + 0.5) * ends / columns, (np.arange(rows) + 0.5) * picks / rows)
    x, y = (axis.ravel()[::7].astype(np.float32) for axis in (x, y))
    wi, wo = (np.tile(unit(*w), (len(x), 1)) for w in (wi, wo))
    queries = Queries.round(x, y, np.full(len(x), 1e-4, np.float32), wi, wo)
    found = PrefilteredMaps(fabric, PER_YARN).answer(queries, NONE)

    area, specular, diffuse = point_shares(fabric, x, y, wi[0], wo[0])
    whole = area.sum(axis=1, keepdims=True)
    expected = np.concatenate([specular[:, :2], diffuse[:, :2]], axis=1)
    expected = np.divide(expected, whole, out=np.zeros_like(expected), where=whole > 0)
    assert (expected.sum(axis=1) > 0).mean() > 0.3
    np.testing.assert_allclose(found, expected, rtol=RTOL, atol=1e-6 * expected.max())
