import itertools
import math

import numpy as np
import pytest
from scipy.stats import norm

from pipeline.analytic.horizon_points.horizon_map import horizon_map
from pipeline.analytic.soft_nodes.diamond import AZIMUTHS
from pipeline.analytic.summed_area.clusters import blocks_of, sources
from pipeline.analytic.summed_area.levels import Sums, plan
from pipeline.truth.cloth import cloth_side
from pipeline.truth.geometry.heightfield import WARP
from pipeline.truth.options import TruthOptions
from weaves.fabric import load_fabric


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
