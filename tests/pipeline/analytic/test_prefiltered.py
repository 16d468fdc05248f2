import numpy as np
import pytest

from pipeline.analytic.prefiltered import CHANNELS, TEXELS_PER_YARN, answer, tabulate
from pipeline.truth.geometry.heightfield import height_field
from pipeline.truth.query import Queries
from pipeline.truth.scattering.point import Choices, directions_of, point_share
from tests.directions import above
from tests.pipeline.truth.cloths import woven
from weaves.fabric import load_fabric

RTOL = 1e-4  # forty roundings of 6e-8, and ten times that where a narrow denominator is a small difference


@pytest.mark.parametrize(("wi", "wo"), [((0.3, -0.4), (0.1, 0.6)), ((-0.7, 0.3), (-0.6, 0.5))], ids=["apart", "near"])
def test_a_texel_is_a_point(wi, wo):
    """A tiny footprint at a texel's centre reads that texel alone: the point model without shadows."""
    fabric = woven("denim", relief=1.2, twist=30.0).model_copy(update={"optical_thickness": 0.4})
    ends, picks = fabric.weave.repeat
    columns, rows = (1 << int(np.ceil(np.log2(extent * TEXELS_PER_YARN))) for extent in (ends, picks))
    x, y = np.meshgrid((np.arange(columns) + 0.5) * ends / columns, (np.arange(rows) + 0.5) * picks / rows)
    x, y = (axis.ravel()[::29].astype(np.float32) for axis in (x, y))
    wi, wo = (np.tile(np.float32(above(*w)), (len(x), 1)) for w in (wi, wo))
    queries = Queries.round(x, y, np.full(len(x), 1e-4, np.float32), wi, wo)
    tables = tabulate(fabric, parallax=False)
    found = answer(tables, queries)  # one tangent has no variance

    front, towards = height_field(fabric), directions_of(*wi[0].astype(float), *wo[0].astype(float), 0.0)
    shares = np.zeros((3, len(x), 3))
    for k, place in enumerate(np.stack([x, y], axis=1).astype(float)):
        family, *own, _ = point_share(front, front, *place, towards, Choices(macro=False, shadows=False))
        shares[:, k, family] = own
    area, specular, diffuse = shares
    whole = area.sum(axis=1, keepdims=True)
    expected = np.concatenate([specular[:, :2], diffuse[:, :2]], axis=1)
    expected = np.divide(expected, whole, out=np.zeros_like(expected), where=whole > 0)
    assert (expected.sum(axis=1) > 0).mean() > 0.3
    np.testing.assert_allclose(found, expected, rtol=RTOL, atol=1e-6 * expected.max())


def test_each_level_is_the_mean_of_the_one_before_and_widening_lowers_highlights_alone():
    maps = tabulate(load_fabric("denim"))
    texels, levels = maps.maps.texels.astype(np.float64), maps.maps.levels
    means = [texels[first : first + width * height].mean(axis=0) for first, width, height in levels]
    np.testing.assert_allclose(means, means[:1] * len(means), atol=1e-6)
    shares = texels[-1, [0, CHANNELS]]
    assert shares.sum() == pytest.approx(1.0, abs=1e-6) and shares.min() > 0.1  # denim has no gaps
    # A texel of many tangents has a broader lobe: lower in its middle; diffuse light knows no roughness.
    middle = Queries.round([0.0], [0.0], [50.0], [above(0.0, 0.3)], [above(0.0, -0.3)])
    equal = maps.maps.texels.copy()
    for first in (0, CHANNELS):  # tangents that are all the mean one
        share, t = equal[:, first, None], equal[:, first + 4 : first + 7]
        pairs = np.stack([t[:, a] * t[:, b] for a, b in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))], axis=1)
        equal[:, first + 7 : first + CHANNELS] = pairs / np.maximum(share, 1e-9)
    none, lean = (answer(table, middle)[0] for table in (maps._replace(maps=maps.maps._replace(texels=equal)), maps))
    np.testing.assert_allclose(lean[2:], none[2:], rtol=1e-6)
    assert lean[:2].max() < none[:2].max()
