"""Layers of height: what each has of a cluster adds up to the cluster, and heights are those of the surface."""

import numpy as np
import pytest

from pipeline.analytic.soft_horizons import AZIMUTHS
from pipeline.analytic.summed_area.clusters import sources
from pipeline.analytic.summed_area.horizon_map import horizon_map
from pipeline.analytic.summed_area.layers import MOST_LAYERS, HeightLayer, layer_share, layers_of
from pipeline.analytic.summed_area.tables import GRID, LANES, tabulate
from pipeline.truth.cloth import cloth_side
from pipeline.truth.geometry.heightfield import GAP
from pipeline.truth.options import TruthOptions
from tests.pipeline.truth.cloths import LOPSIDED, direction, woven
from tests.presets import slow
from weaves.surface import surface_at


def test_layers_have_all_of_a_cluster():
    """Shares are a partition of unity, and their mean height is the cluster's where it is thinner than a layer."""
    random, count = np.random.default_rng(1), 7
    lowest, highest = -0.4, 0.5
    middle, spread = random.uniform(lowest, highest, LANES), random.uniform(0.0, 0.3, LANES)
    spread = np.minimum(spread, np.minimum(middle - lowest, highest - middle))
    spread[: LANES // 2] *= 0.01
    height = np.stack([middle, spread]).astype(np.float32)
    apart = (highest - lowest) / (count - 1)
    middles = lowest + apart * np.arange(count)
    layers = [HeightLayer(np.float32(z), np.float32(0.5 * apart)) for z in middles]
    shares = np.array([[layer_share(height, k, layer) for layer in layers] for k in range(LANES)])
    np.testing.assert_allclose(shares.sum(axis=1), 1.0, atol=2e-6)
    np.testing.assert_allclose(shares[: LANES // 2] @ middles, middle[: LANES // 2], atol=2e-6)


@pytest.mark.parametrize("fabric", [woven("denim"), LOPSIDED, slow(woven("satin_8"))])
def test_nodes_lie_on_the_surface(fabric):
    """Heights of nodes, by the angles of the torus, are those that the fabric's surface has at their places."""
    model = cloth_side(fabric, TruthOptions())
    found, patches = sources(model.front, horizon_map(model.front, model.back, GRID, 2 * AZIMUTHS))
    inner = slice(1, GRID - 1)
    for source in found:
        patch = patches[source.block]
        if patch.piece.family == GAP:
            assert not patch.height.any()
            continue
        across = 0.5 + patch.piece.radius * np.sin(patch.v)
        low, high = patch.piece.along
        along = (low + (high - low) * (np.arange(GRID) + 0.5) / GRID)[:, None] + np.zeros_like(across)
        x, y = (across, along) if patch.piece.radii[0] else (along, across)
        surface = surface_at(fabric, source.end + x[inner, inner], source.pick + y[inner, inner])
        here = surface.yarn == patch.piece.family
        assert here.mean() > 0.9
        np.testing.assert_allclose(patch.height[inner, inner][here], surface.height[here], atol=1e-9)


def test_one_layer_for_what_is_not_displaced():
    tables = tabulate(woven("denim"), 16, True)

    def layers(sigma, degrees):
        wo = np.array([direction(theta, 40.0) for theta in degrees], np.float32)
        return layers_of(tables, np.full(len(degrees), sigma, np.float32), wo).tolist()

    above, low, lower, grazing = layers(0.1, (0.0, 30.0, 60.0, 88.0))
    assert above == 1
    assert 1 < low < lower < grazing == MOST_LAYERS
    assert layers(50.0, (60.0, 88.0)) == [1, 1]
    assert len(tabulate(woven("denim"), 16, False).extent) == 0
