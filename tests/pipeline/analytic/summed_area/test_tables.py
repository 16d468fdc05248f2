import numpy as np
import pytest

from pipeline.analytic.summed_area.clusters import LANES
from pipeline.analytic.summed_area.tables import AREA, AZIMUTHS, SPREAD_U, SPREAD_V, U, V, tabulate
from weaves.fabric import load_fabric


@pytest.fixture(scope="module", params=["denim", "gauze"])
def tables(request):
    return tabulate(load_fabric(request.param), 32)


def test_arrays_fit_together(tables):
    texels, blocks = tables.slots.shape
    assert blocks == 32 // LANES + 1 == tables.starts[2] + 1
    assert tables.levels[-1].tolist() == [texels - 1, 0, 0]
    assert tables.slots.max() == len(tables.surface) - 1 == len(tables.horizon) - 1
    assert tables.horizon.shape[1:] == (AZIMUTHS, 2, LANES)
    assert not tables.surface[0].any()
    assert (tables.levels[:-1, 1] == 1 << tables.levels[:-1, 2]).all()
    assert tables.nbytes > tables.surface.nbytes


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
    own = tables.surface[1:]
    of_yarn = np.unique(tables.slots[:, : tables.starts[2]])
    own = tables.surface[of_yarn[of_yarn > 0]]
    full = own[:, AREA] > 1e-4
    edges = np.pi * (np.arange(LANES + 1) / LANES - 0.5)
    assert ((own[:, V] > edges[:-1] - 1e-3) & (own[:, V] < edges[1:] + 1e-3))[full].all()
    assert (own[:, SPREAD_V][full] <= np.pi / LANES / 2).all()
    assert (own[:, SPREAD_U][full] < 0.7).all() and (np.abs(own[:, U][full]) < np.pi / 2).all()
