import itertools
import math

import numpy as np
import pytest
from scipy.stats import norm

from pipeline.analytic.soft_horizons import AZIMUTHS
from pipeline.analytic.summed_area.clusters import LANES, blocks_of, sources
from pipeline.analytic.summed_area.horizon_map import horizon_map
from pipeline.analytic.summed_area.tables import AREA, SPREAD_U, SPREAD_V, TEXEL_AZIMUTHS, Sums, U, V, plan, tabulate
from pipeline.truth.cloth import cloth_side
from pipeline.truth.geometry.heightfield import WARP
from pipeline.truth.options import TruthOptions
from weaves.fabric import load_fabric


@pytest.fixture(scope="module", params=["denim", "gauze"])
def tables(request):
    return tabulate(load_fabric(request.param), 32)


def test_arrays_fit_together(tables):
    texels, blocks = tables.slots.shape
    assert blocks == 32 // LANES + 1 == tables.starts[2] + 1
    assert tables.levels[-1].tolist() == [texels - 1, 0, 0]
    assert tables.slots.max() == len(tables.surface) - 1 == len(tables.horizon) - 1
    assert tables.horizon.shape[1:] == (TEXEL_AZIMUTHS, 2, LANES)
    assert not tables.surface[0].any()
    assert (tables.levels[:-1, 1] == 1 << tables.levels[:-1, 2]).all()


def test_from_above_the_surface_covers_the_cloth(tables):
    """The area of the surface times its n_z is that of the plane: the mean texel, and all others roughly."""
    area = tables.surface[tables.slots, AREA]
    v, u = tables.surface[tables.slots, V], tables.surface[tables.slots, U]
    beta = tables.yarn[:, 5]
    of_family = np.concatenate([np.repeat(beta, np.diff(tables.starts)), [1.0]])[:, None]
    x, y, z = of_family * np.sin(v), of_family * np.sin(u) * np.cos(v), np.cos(u) * np.cos(v)
    plane = (area * z / np.sqrt(x**2 + y**2 + z**2)).sum(axis=(1, 2))
    assert plane[-1] == pytest.approx(1.0, abs=0.02)
    np.testing.assert_allclose(plane, 1.0, atol=0.08)


def test_lanes_keep_to_their_part_of_a_yarn(tables):
    """Means of v lie in the lane's eighth, spreads are at most those of its ends."""
    of_yarn = np.unique(tables.slots[:, : tables.starts[2]])
    own = tables.surface[of_yarn[of_yarn > 0]]
    full = own[:, AREA] > 1e-4
    edges = np.pi * (np.arange(LANES + 1) / LANES - 0.5)
    assert ((own[:, V] > edges[:-1] - 1e-3) & (own[:, V] < edges[1:] + 1e-3))[full].all()
    assert (own[:, SPREAD_V][full] <= np.pi / LANES / 2).all()
    assert (own[:, SPREAD_U][full] < 0.7).all() and (np.abs(own[:, U][full]) < np.pi / 2).all()


def sums_of(name, finest):
    model = cloth_side(load_fabric(name), TruthOptions())
    found, patches = sources(model.front, horizon_map(model.front, model.back, 16, 2 * AZIMUTHS))
    blocks, starts = blocks_of(found, patches, 4)
    levels = plan(finest, 1.5)
    return Sums(model.front.top.shape, found, patches, blocks, starts[2], levels), levels, patches, model.front.top


def test_levels_are_a_quarter_of_an_octave_apart():
    levels = plan(16, 2.0)
    assert levels[0].texels == 16 and levels[0].sigma == 1 / 16 and levels[-1].texels == 0
    for before, after in itertools.pairwise(levels[:-1]):
        assert after.sigma / before.sigma == pytest.approx(2**0.25)
        assert after.texels in (before.texels, before.texels // 2) and after.stored > before.stored
        assert after.texels * after.sigma >= 0.999
    assert levels[-2].sigma >= 2.0 > levels[-3].sigma


@pytest.mark.parametrize("name", ["cotton_twill", "gauze"])
def test_all_of_the_cloth_is_somewhere(name):
    """The sums of 1 over all clusters and gaps are 1 everywhere."""
    sums, levels, patches, _ = sums_of(name, 8)
    images = sums.of({key: np.ones_like(patch.u) for key, patch in patches.items()})
    assert len(images) == len(levels)
    for image in images:
        np.testing.assert_allclose(image.sum(axis=(0, 1)), 1.0, atol=1e-3)


def test_the_share_of_warps_is_that_of_a_gaussian():
    """A solid cloth, every level: products of normal distributions over the cells where the warp is on top."""
    sums, levels, patches, top = sums_of("cotton_twill", 8)
    warps = {key: np.full_like(patch.u, patch.piece.family == WARP) for key, patch in patches.items()}
    picks, ends = top.shape

    def shares(level, size):
        centres = (np.arange(size * level.texels) + 0.5) / level.texels
        cells = np.arange(-8 * size, 9 * size)
        inside = norm.cdf((cells[:, None] + 1 - centres) / level.stored)
        inside -= norm.cdf((cells[:, None] - centres) / level.stored)
        return np.stack([inside[cells % size == cell].sum(axis=0) for cell in range(size)])

    for level, image in zip(levels[:-1], sums.of(warps)[:-1], strict=True):
        expected = shares(level, picks).T @ (top == WARP) @ shares(level, ends)
        np.testing.assert_allclose(image.sum(axis=(0, 1)), expected, atol=3e-3)
    assert sums.of(warps)[-1].sum() == pytest.approx((top == WARP).mean(), abs=1e-4)
    assert math.isinf(levels[-1].sigma)
