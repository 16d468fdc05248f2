"""Where a view ray meets a height map: on slopes of known heights, and first of all places."""

import numpy as np
import pytest

from pipeline.analytic.mip_levels import mip_levels
from pipeline.analytic.parallax_mapping import HeightMaps, displaced, height_maps
from tests.directions import unit
from tests.pipeline.truth.cloths import woven
from weaves.surface import surface_at

TEXELS, EXTENT = 512, 16


def _maps(heights):
    return HeightMaps(mip_levels([heights[..., None]], (EXTENT, EXTENT)), heights.min(), heights.max())


@pytest.mark.parametrize(("theta", "phi"), [(20.0, 30.0), (50.0, 210.0), (70.0, 80.0)])
def test_on_a_slope_the_place_is_known(theta, phi):
    """With h = a x + b y + c over the plane, x = u + h t_x and y = v + h t_y: two linear equations."""
    a, b, c = 0.05, -0.03, -0.2
    at = (np.arange(TEXELS) + 0.5) * EXTENT / TEXELS
    maps = _maps(a * at[None, :] + b * at[:, None] + c)
    wo = np.array(unit(theta, phi), np.float32)
    t = wo[:2].astype(float) / wo[2]
    for u, v in ((8.0, 8.0), (7.3, 9.1), (9.2, 6.6)):
        matrix = np.eye(2) - np.outer(t, (a, b))
        expected = np.linalg.solve(matrix, np.array([u, v]) + c * t)
        np.testing.assert_allclose(displaced(maps, u, v, 0.1, wo), expected, atol=1e-4)


def test_what_is_nearer_hides_what_is_behind_it_and_rays_from_above_stay():
    """A ridge .5 high: a ray that comes down behind it ends on it; one that clears it ends on the ground."""
    heights = np.zeros((TEXELS, TEXELS))
    heights[:, 256:288] = 0.5  # x from 8 to 9
    maps = _maps(heights)
    wo = np.array(unit(45.0, 0.0), np.float32)
    on_top, _ = displaced(maps, 8.2, 3.0, 0.03, wo)
    assert abs(on_top - 8.7) < 0.01
    beside, _ = displaced(maps, 7.8, 3.0, 0.03, wo)
    assert 7.95 < beside < 8.35
    before, _ = displaced(maps, 9.1, 3.0, 0.03, wo)
    assert abs(before - 9.1) < 0.05
    clear, _ = displaced(maps, 7.0, 3.0, 0.03, wo)
    assert abs(clear - 7.0) < 0.01
    fabric = woven("denim")
    ends, picks = fabric.weave.repeat
    x, y = (np.arange(64) + 0.5) * ends / 64, (np.arange(64) + 0.5) * picks / 64
    heights = surface_at(fabric, x[None, :], y[:, None]).height
    grazing, above = (np.array(unit(theta, 10.0), np.float32) for theta in (80.0, 0.0))
    assert displaced(height_maps(fabric, heights, (ends, picks), False), 0.3, 1.7, 0.1, grazing) == (0.3, 1.7)
    maps = height_maps(fabric, heights, (ends, picks), True)
    assert displaced(maps, 0.3, 1.7, 0.1, above) == (0.3, 1.7)
    assert maps.lowest < 0.0 < maps.highest
    assert abs(maps.maps.texels[-1, 0]) < 0.01  # the reference plane is the mean height
