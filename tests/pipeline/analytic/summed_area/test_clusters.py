import numpy as np
import pytest

from pipeline.analytic.soft_horizons import AZIMUTHS
from pipeline.analytic.summed_area.clusters import _split, blocks_of, sources
from pipeline.analytic.summed_area.horizon_map import horizon_map
from pipeline.truth.cloth import cloth_side
from pipeline.truth.geometry.heightfield import GAP, WARP, WEFT
from pipeline.truth.options import TruthOptions
from weaves.fabric import load_fabric
from weaves.surface import surface_at


def parts(fabric, count):
    model = cloth_side(fabric, TruthOptions())
    table = horizon_map(model.front, model.back, 16, 2 * AZIMUTHS)
    found, patches = sources(model.front, table)
    return found, patches, *blocks_of(found, patches, count)


@pytest.mark.parametrize("name", ["denim", "gauze"])
def test_patches_have_the_surface_of_the_oracle(name):
    """Normal's z and inclination at the nodes, against `weaves.surface`."""
    fabric = load_fabric(name)
    found, patches, *_ = parts(fabric, 8)
    for source in found[:6]:
        patch = patches[source.block]
        piece = patch.piece
        if piece.family == GAP:
            assert (patch.surface == 1.0).all()
            continue
        v = patch.v[0]
        across = 0.5 + piece.radius * np.sin(v)
        low, high = piece.along
        along = low + (high - low) * (np.arange(16) + 0.5) / 16
        x, y = (across[None, :], along[:, None]) if piece.family == WARP else (along[:, None], across[None, :])
        there = surface_at(fabric, source.end + x, source.pick + y)
        assert (there.yarn == piece.family).all()
        # A node has the mean over its interval of v, in which 1 / n_z is least curved after division by 1 / cos v.
        inner = slice(2, 14)
        np.testing.assert_allclose(patch.surface[:, inner], 1.0 / there.normal[:, inner, 2], rtol=0.05)


@pytest.mark.parametrize(("name", "count"), [("denim", 4), ("satin_8", 8), ("gauze", 16)])
def test_a_block_is_of_one_family(name, count):
    found, patches, blocks, (first, middle, last) = parts(load_fabric(name), count)
    assert first == 0 and 0 < middle < last == count
    seen = set()
    for key, own in blocks.items():
        family = patches[key].piece.family
        assert ((own < middle) == (family == WARP)).all() and family in (WARP, WEFT)
        seen |= set(own.tolist())
    assert seen == set(range(count))
    assert {source.block for source in found} == set(patches)


def test_lumps_of_points_are_found():
    """Four distant lumps of two families, of unlike weights: each is a cluster, whatever the order of its rows."""
    random = np.random.default_rng(0)
    lump = np.repeat(np.arange(4), 25)
    order = random.permutation(100)
    lump = lump[order]
    features = np.array([[0.0, 0.0], [5.0, 0.0], [0.0, 0.0], [0.0, 5.0]])[lump] + 0.1 * random.normal(size=(100, 2))
    labels, families = _split(features, random.uniform(0.5, 2.0, 100), np.where(lump < 2, WEFT, WARP), 4)
    assert families.tolist() == [WARP, WARP, WEFT, WEFT]
    assert sorted(len(set(lump[labels == one])) for one in range(4)) == [1, 1, 1, 1]
    assert len({(a, b) for a, b in zip(labels, lump, strict=True)}) == 4
