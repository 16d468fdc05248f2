import numpy as np
import pytest
import torch

from pipeline.models.woven.standard_position import SYMMETRIES, moved, placement, standard
from tests.pipeline.truth.cloths import woven
from tests.presets import PRESETS
from weaves.draft import Matrix
from weaves.fabric import load_fabric
from weaves.surface import GAP, surface_at


@pytest.fixture
def fabric():
    """Return a fabric without any symmetry of its own: 5 ends, 4 picks, twisted yarns that differ."""
    rows = ("##.#.", ".##.#", "#...#", ".#.##")
    return woven("silk_shantung", rows, warp={"twist": 25.0}, weft={"twist": -40.0})


def moved_vector(vector, symmetry):
    moved = vector * np.array([-1.0 if symmetry.mirror_x else 1.0, -1.0 if symmetry.mirror_y else 1.0, 1.0])
    return moved[..., [1, 0, 2]] if symmetry.exchange else moved


def check_moved(here, there, symmetry, atol):
    """Compare normals and yarns at the images of points with those at the points."""
    np.testing.assert_allclose(there.normal, moved_vector(here.normal, symmetry), atol=atol)
    exchanged = np.where(here.yarn == GAP, GAP, 1 - here.yarn)
    np.testing.assert_array_equal(there.yarn, exchanged if symmetry.exchange else here.yarn)


@pytest.mark.parametrize("symmetry", SYMMETRIES)
def test_the_surface_moves_with_the_cloth(fabric, symmetry):
    """Height, normal and fibre (up to its sense) at the image of a point are the images of those at the point."""
    ends, picks = fabric.weave.repeat
    random = np.random.default_rng(3)
    x, y = random.random(500) * ends, random.random(500) * picks
    there_x = ends - x if symmetry.mirror_x else x
    there_y = picks - y if symmetry.mirror_y else y
    if symmetry.exchange:
        there_x, there_y = there_y, there_x
    here, there = surface_at(fabric, x, y), surface_at(moved(fabric, symmetry), there_x, there_y)
    np.testing.assert_allclose(there.height, here.height, atol=1e-9)
    check_moved(here, there, symmetry, 1e-9)
    along = np.abs(np.sum(there.tangent * moved_vector(here.tangent, symmetry), axis=-1))
    np.testing.assert_allclose(along, 1.0, atol=1e-9)


def test_every_image_has_the_same_standard_position(fabric):
    """All images differ, and the first symmetry changes nothing."""
    assert moved(fabric, SYMMETRIES[0]).optics() == fabric.optics()
    assert len({tuple(moved(fabric, symmetry).weave.rows()) for symmetry in SYMMETRIES}) == 8
    for symmetry in SYMMETRIES:
        for begin in [(0, 0), (3, 1)]:
            image = moved(fabric, symmetry)
            image = image.model_copy(update={"draft": Matrix(rows=tuple(image.weave.rolled(*begin).rows()))})
            assert standard(image)[0].optics() == standard(fabric)[0].optics()


@pytest.mark.parametrize("name", PRESETS)
def test_standard_position_is_one_of_the_fabric(name):
    """The surface at a placed query is the fabric's own, moved: sign, order and start agree with the drafts."""
    fabric = load_fabric(name)
    seen, symmetry, start = standard(fabric)
    one = placement(fabric, symmetry, start)
    random = np.random.default_rng(4)
    ends, picks = fabric.weave.repeat
    u, v = random.random(200), random.random(200)
    there_u, there_v = one.move(torch.from_numpy(u)[None], torch.from_numpy(v)[None])
    here = surface_at(fabric, u * ends, v * picks)
    ends, picks = seen.weave.repeat
    there = surface_at(seen, there_u[0].numpy() * ends, there_v[0].numpy() * picks)
    # `start` is float32: points move by 1e-7 of a repeat, and a point within that of an edge would change sides.
    check_moved(here, there, symmetry, 1e-4)
