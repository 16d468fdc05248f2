"""Places and queries: two lights on the same places, one of them behind."""

import numpy as np
import pytest

from pipeline.scenes.gbuffer import GBuffer
from pipeline.scenes.shade import compose

UP, SIDE, DOWN = [0.0, 0.0, 1.0], [0.6, 0.0, 0.8], [0.0, 0.6, -0.8]


@pytest.fixture
def gbuffer():
    """Three pixels of cloth in a picture of 2 by 3, the last unlit; one light from the side, one from behind."""
    mask = np.array([[True, False, True], [False, True, False]])
    column = np.arange(3.0)
    shapes = column + 7.0, column - 9.0, column + 1.0, column + 0.5, column / 10, column / 20
    queries = np.array([0, 1, 0]), np.array([SIDE, UP, DOWN]), np.array([[1.0, 2.0, 3.0], [1.0] * 3, [4.0] * 3])
    return GBuffer(mask, np.flatnonzero(mask), *shapes, np.array([UP, SIDE, UP]), *queries)


def test_queries_repeat_their_places(gbuffer):
    queries = gbuffer.queries((4, 4))
    assert queries.u.tolist() == [3.0, 0.0, 3.0] and queries.v.tolist() == [3.0, 0.0, 3.0]
    assert queries.sigma_minor.tolist() == [0.5, 1.5, 0.5]
    assert queries.curvature == pytest.approx([0, 0.05, 0])
    assert queries.wo == pytest.approx(np.array([UP, SIDE, UP]))
    assert queries.wi == pytest.approx(np.array([SIDE, UP, DOWN]))
    assert gbuffer.transmitted.tolist() == [False, False, True]
    assert gbuffer.lit.tolist() == [[True, False, True], [False, False, False]]
    looks = gbuffer.looks((4, 4))
    assert looks.u.tolist() == [3.0, 0.0, 1.0] and (looks.wi == looks.wo).all()


def test_lights_add_up_over_what_is_seen_through(gbuffer):
    rgb = np.array([[0.1, 0.1, 0.1], [0.2, 0.4, 0.6], [0.01, 0.02, 0.03]])
    background = np.arange(18.0).reshape(2, 3, 3)
    picture = compose(gbuffer, rgb, background, transparency=[0.0, 0.5, 0.25])
    assert picture[0, 0] == pytest.approx([0.1 + 0.04, 0.2 + 0.08, 0.3 + 0.12])
    assert picture[0, 2] == pytest.approx(rgb[1] + 0.5 * background[0, 2])
    assert picture[1, 1] == pytest.approx(0.25 * background[1, 1])
    assert picture[~gbuffer.mask] == pytest.approx(background[~gbuffer.mask])
    dark = compose(gbuffer, np.zeros((3, 3)), background=0.5)
    assert dark.dtype == np.float32 and (dark[gbuffer.mask] == 0).all() and (dark[~gbuffer.mask] == 0.5).all()
