import numpy as np
import pytest

from pipeline.analytic.horizon_points.horizon_map import SLOTS, horizon_map
from pipeline.truth.cloth import cloth_side
from pipeline.truth.geometry.horizon import horizons
from pipeline.truth.geometry.pieces import different_cells
from pipeline.truth.options import TruthOptions
from weaves.fabric import load_fabric


@pytest.mark.parametrize("name", ["polyester_lining", "satin_8", "voile"])
def test_nodes_have_the_exact_horizon(name):
    """The first piece of the first cell: its nodes lie on the yarn on top, evenly in v and along it."""
    model = cloth_side(load_fabric(name), TruthOptions())
    field, grid, azimuths = model.front, 8, 16
    table = horizon_map(field, model.back, grid, azimuths)
    assert len(table.horizon) % (azimuths * grid * grid) == 0
    assert table.blocks.reshape(-1, SLOTS)[:, 0].size == field.top.size
    assert len(set(table.blocks.reshape(-1, SLOTS)[:, 0].tolist())) == different_cells(field)
    radius = field.yarn[field.top[0, 0], 0]
    middles = (np.arange(grid) + 0.5) / grid
    across, along = np.tile(0.5 + radius * np.sin(np.pi * (middles - 0.5)), grid), np.repeat(middles, grid)
    x, y = (across, along) if field.top[0, 0] == 0 else (along, across)
    slopes = horizons(field, x, y, azimuths, False).astype(np.float64)
    first = table.blocks[0]
    own = table.horizon[first : first + azimuths * grid * grid].reshape(azimuths, -1)
    np.testing.assert_allclose(own, slopes / np.sqrt(1.0 + slopes**2), atol=1e-6)
