from dataclasses import replace

import numpy as np
import pytest

from pipeline.scenes.gbuffer import GBuffer
from pipeline.scenes.shade import colours, compose, shade
from pipeline.truth.query import Queries
from weaves.fabric import Fabric, load_fabric


def lit(side):
    """Return queries that are lit from these sides."""
    ones, none = np.ones_like(side), np.zeros_like(side)
    wi, wo = np.stack([0.6 * ones, none, 0.8 * side], axis=-1), np.stack([none, none, ones], axis=-1)
    return Queries.round(ones, ones, ones, wi, wo)


def test_shade_applies_each_colour_to_its_component_and_those_of_threads_to_footprints_of_a_check():
    """One component at a time gives back its own colour, transmitted light that of transmission."""
    denim = load_fabric("denim")
    fabric = denim.model_copy(update={"weft": denim.weft.model_copy(update={"diffuse_transmission": (0.1, 0.2, 0.3)})})
    yarns, sides = (fabric.warp, fabric.weft), ("diffuse_rgb", "diffuse_transmission_rgb")
    expected = [[getattr(yarn, name) for name in ("specular_rgb", side) for yarn in yarns] for side in sides]
    rgb = shade(fabric, np.tile(np.eye(4), (2, 1)), lit(np.repeat([1.0, -1.0], 4)), bounces=1)
    assert rgb.reshape(2, 4, 3) == pytest.approx(np.array(expected))
    assert np.array([colours(fabric), colours(fabric, transmitted=True)]) == pytest.approx(np.array(expected))
    assert fabric.warp.diffuse_rgb != fabric.weft.diffuse_rgb
    # A white end beside a black one: each footprint on one end has its colour, a wide one the mean of both.
    palette = {"white": {"diffuse": [0.8, 0.8, 0.8]}, "black": {"diffuse": [0.0, 0.0, 0.0]}}
    order = {"palette": palette, "ends": [["white", 2], ["black", 2]]}
    fabric = Fabric.model_validate(load_fabric("denim").model_dump() | {"colours": order})
    places = np.array([1.0, 3.0, 5.0, 2.0])
    size = np.array([0.1, 0.1, 0.1, 50.0])
    queries = lit(np.ones(4))._replace(u=places, sigma=size, sigma_minor=size)
    rgb = shade(fabric, np.tile([0.0, 0.0, 1.0, 0.0], (4, 1)), queries, bounces=1)
    assert rgb[:, 0] == pytest.approx([0.8, 0.0, 0.8, 0.4], abs=1e-3)
    assert colours(fabric)[2] == pytest.approx([0.4] * 3)


UP, SIDE, DOWN = [0.0, 0.0, 1.0], [0.6, 0.0, 0.8], [0.0, 0.6, -0.8]


@pytest.fixture
def gbuffer():
    """Three pixels of cloth in a picture of 2 by 3, the last unlit; one light from the side, one from behind."""
    mask = np.array([[True, False, True], [False, True, False]])
    column = np.arange(3.0)
    shapes = column + 7.0, column - 9.0, column + 1.0, column + 0.5, column / 10, column / 20
    queries = np.array([0, 1, 0]), np.array([SIDE, UP, DOWN]), np.array([[1.0, 2.0, 3.0], [1.0] * 3, [4.0] * 3])
    return GBuffer(mask, np.flatnonzero(mask), *shapes, np.array([UP, SIDE, UP]), *queries)


def test_queries_repeat_their_places_and_lights_add_up_over_what_is_seen_through(gbuffer):
    queries = gbuffer.queries((4, 4))
    assert queries.u.tolist() == [3.0, 0.0, 3.0] and queries.v.tolist() == [3.0, 0.0, 3.0]
    assert queries.sigma_minor.tolist() == [0.5, 1.5, 0.5]
    assert queries.curvature == pytest.approx([0, 0.05, 0])
    assert queries.wo == pytest.approx(np.array([UP, SIDE, UP]))
    assert queries.wi == pytest.approx(np.array([SIDE, UP, DOWN]))
    assert gbuffer.lit.tolist() == [[True, False, True], [False, False, False]]
    looks = gbuffer.looks((4, 4))
    assert looks.u.tolist() == [3.0, 0.0, 1.0] and (looks.wi == looks.wo).all()
    # Their directions are not tilted; all other places are covered.
    assert len(gbuffer.rims((4, 4)).u) == 0 and gbuffer.coverage([]).tolist() == [1.0, 1.0, 1.0]
    low = np.array([[0.8, 0.0, -0.6]])
    seen = replace(gbuffer, rim=np.array([2]), rim_wo=low)
    (look,) = zip(*seen.rims((4, 4)), strict=True)
    assert look[0] == 1.0 and look[4] == pytest.approx(low[0]) and look[3] == pytest.approx(low[0])
    assert seen.coverage([0.25]).tolist() == [1.0, 1.0, 0.25]
    rgb = np.array([[0.1, 0.1, 0.1], [0.2, 0.4, 0.6], [0.01, 0.02, 0.03]])
    background = np.arange(18.0).reshape(2, 3, 3)
    picture = compose(gbuffer, rgb, background, transparency=[0.0, 0.5, 0.25])
    assert picture[0, 0] == pytest.approx([0.1 + 0.04, 0.2 + 0.08, 0.3 + 0.12])
    assert picture[0, 2] == pytest.approx(rgb[1] + 0.5 * background[0, 2])
    assert picture[1, 1] == pytest.approx(0.25 * background[1, 1])
    assert picture[~gbuffer.mask] == pytest.approx(background[~gbuffer.mask])
    covered = compose(gbuffer, rgb, background, [0.0, 0.5, 0.25], [1.0, 0.25, 0.0])
    assert (covered[0, 0] == picture[0, 0]).all()
    assert covered[0, 2] == pytest.approx(0.25 * rgb[1] + (0.75 + 0.25 * 0.5) * background[0, 2])
    assert covered[1, 1] == pytest.approx(background[1, 1])
    dark = compose(gbuffer, np.zeros((3, 3)), background=0.5)
    assert dark.dtype == np.float32 and (dark[gbuffer.mask] == 0).all() and (dark[~gbuffer.mask] == 0.5).all()
