import numpy as np
import pytest

from pipeline.materials.lobes import Reflectance
from pipeline.materials.planes import Layout, layout, planes, yarn_ids
from weaves.fabric import load_fabric

HALF = np.full(2, 0.5)
SHARE = Reflectance(HALF, HALF, HALF / 4, HALF / 2, HALF, HALF / 4)


@pytest.mark.parametrize("name", ["denim", "gauze", "gingham"])
def test_maps_tile_without_a_seam(name):
    fabric = load_fabric(name)
    once = layout(fabric, 128)
    twice = Layout(2 * once.ends, 2 * once.picks, 2 * once.width, 2 * once.height)
    for one, two in zip(planes(fabric, once, SHARE), planes(fabric, twice, SHARE), strict=True):
        np.testing.assert_allclose(two, np.tile(one, (2, 2, *[1] * (one.ndim - 2))), atol=1e-5)


def test_means_are_kept_by_every_level_coverage_is_an_area_and_yarns_numbered_ends_first():
    level = planes(load_fabric("gauze"), layout(load_fabric("gauze"), 64), SHARE)
    means = [plane.mean(axis=(0, 1)) for plane in level]
    while level.coverage.size > 1:
        level = level.halved()
        for plane, mean in zip(level, means, strict=True):
            np.testing.assert_allclose(plane.mean(axis=(0, 1)), mean, rtol=1e-4, atol=1e-6)
    fabric = load_fabric("gauze")
    level = planes(fabric, layout(fabric, 256), SHARE)
    open_area = (1.0 - fabric.warp.width) * (1.0 - fabric.weft.width)
    assert level.coverage.mean() == pytest.approx(1.0 - open_area, abs=0.02)
    assert np.isfinite(level.height).all()
    fabric = load_fabric("denim")
    found = layout(fabric, 64)
    numbers = yarn_ids(fabric, found)
    assert sorted(np.unique(numbers)) == list(range(1, 9))
    picks, ends = np.mgrid[0:4, 0:4]
    np.testing.assert_array_equal(numbers[8::16, 8::16], np.where(fabric.weave.warp_over, 1 + ends, 5 + picks))
    assert set(np.unique(yarn_ids(load_fabric("gauze"), layout(load_fabric("gauze"), 64)))) == {0, 1, 2, 3, 4}


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("denim", Layout(4, 4, 1024, 1024)),  # 4 x 4
        ("herringbone", Layout(8, 4, 1024, 512)),  # 8 x 4: half as high
        ("pinstripe", Layout(24, 12, 1024, 512)),  # 24 x 4: three repeats high
        ("tartan", Layout(204, 204, 1024, 1024)),
    ],
)
def test_a_map_shows_whole_repeats_in_square_texels(name, expected):
    found = layout(load_fabric(name), 1024)
    assert found == expected
    assert found.width / found.ends == found.height / found.picks
