import numpy as np
import pytest

from pipeline.analytic.soft_nodes import nodes
from pipeline.analytic.soft_nodes.nodes import AZIMUTHS, BLOCK_NODES, LEVELS, _ramps, tabulate
from pipeline.compiled.arrays import nbytes
from tests.pipeline.truth.cloths import irregular
from tests.presets import slow
from weaves.fabric import load_fabric


@pytest.mark.parametrize(
    ("fabric", "most"),
    [
        (load_fabric("polyester_lining"), 3.5e5),
        (irregular(8, seed=4, width=1.0), 1.3e6),
        slow(irregular(8, seed=4, width=0.8), 2e6),
    ],
    ids=["plain", "irregular", "irregular with gaps"],
)
def test_tables_stay_small(fabric, most, monkeypatch, _small_tables):
    """With the grids of the package. Areas that a viewer sees are a third to a half of them."""
    monkeypatch.setattr(nodes, "_GRID_BYTES", _small_tables)
    nodes._lay_out.cache_clear()
    table = tabulate(fabric)
    assert nbytes(table) < most and table.evenly.sum() == pytest.approx(1.0, abs=1e-5)
    assert table.evenly.size <= 256 + 128 + 3 * BLOCK_NODES


def test_horizons_of_narrow_and_wide_footprints_agree_and_ramps_of_the_back_have_their_light():
    """A node's mean horizon is that of the grid over its box: both average to the same over a cell."""
    table = tabulate(load_fabric("polyester_lining"))
    for family in range(2):
        a, b = table.starts[family], table.starts[family + 1]
        weights = table.evenly[a:b] / table.evenly[a:b].sum()
        nodes = (table.mean[:, a:b] * weights).sum(axis=(1, 2))
        (block,) = {int(row[1]) for row in table.pieces if row[0] == family}
        grid = table.grid[block] / LEVELS
        size = grid.shape[-1]
        across = np.diff(np.sin(np.pi * (np.linspace(0, 1, size + 1) - 0.5))) / 2
        axes = (across, np.full(size, 1 / size))
        x, y = axes if family == 0 else axes[::-1]
        np.testing.assert_allclose(nodes, np.einsum("ayx,x,y->a", grid, x, y), atol=2e-3)
    assert table.grid.shape[1] == AZIMUTHS
    # Mixtures of horizons, many of them 1: the integral of z V differs by less than .01; for V = 1 it is .5.
    random, z = np.random.default_rng(3), np.linspace(0.0, 1.0, 2001)
    for share in random.uniform(0.0, 1.0, 60):
        sines = np.where(random.random(2000) < share, 1.0, random.uniform(*np.sort(random.random(2)), 2000))
        middle, sharpness = _ramps(sines.mean(keepdims=True), sines.var(keepdims=True))
        apart = np.clip(0.5 + (z - middle) * sharpness, 0.0, 1.0) - (sines[:, None] < z).mean(axis=0)
        assert abs((z * apart).mean()) < 0.01
