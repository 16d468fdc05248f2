import math

import numpy as np
import pytest

from pipeline.analytic.bounces.table import bounce_table, bounced
from pipeline.analytic.bounces.walks import transport
from pipeline.truth.geometry.heightfield import height_field
from pipeline.truth.query import Queries
from tests.directions import sphere, unit
from tests.pipeline.models.against_truth import truth_of
from tests.pipeline.truth.cloths import LOPSIDED, woven
from tests.presets import slow

CLOSED = woven("polyester_lining", width=1.0, blend=1.0)
WAYS = np.float32([unit(*angles) for angles in ((10, 40), (35, 130), (50, 300), (65, 200))])
LIGHTS, VIEWERS = (np.float32(w) for w in (np.repeat(WAYS, 4, axis=0), np.tile(WAYS, (4, 1))))


@pytest.fixture(scope="module")
def closed():
    return bounce_table(CLOSED, 1 << 13)


@pytest.mark.slow
def test_a_table_has_the_second_bounce_of_walks():
    """Dark colours leave the second bounce alone; other walks, between the nodes of the grid, and of each family."""
    closed = bounce_table(CLOSED)
    sums = transport(height_field(CLOSED), 1 << 17, WAYS.astype(float), WAYS.astype(float))
    expected = (sums.second / sums.seen[:, None, None, None]).transpose(3, 0, 1, 2).reshape(16, 2, 2)
    scale = expected.sum(axis=(1, 2)).mean()
    for family in range(2):
        dark = np.zeros((2, 1))
        dark[family] = 1e-6
        table = bounced(closed, LIGHTS, VIEWERS, dark)[..., 0] * 1e6
        assert np.sqrt(np.mean((table - expected[:, :, family]) ** 2)) < 0.02 * scale


def test_a_table_is_small_and_bounces_grow_with_every_colour(closed):
    assert sum(array.nbytes for array in closed) < 200_000
    # Channels do not mix: grey of each albedo alone, and the three together.
    albedos = np.array([0.3, 0.6, 0.9])
    together = bounced(closed, LIGHTS, VIEWERS, np.tile(albedos, (2, 1)))
    alone = [bounced(closed, LIGHTS, VIEWERS, np.full((2, 1), albedo)) for albedo in albedos]
    assert together == pytest.approx(np.concatenate(alone, axis=2))
    assert (np.diff(together, axis=2) > 0.0).all()


@pytest.mark.parametrize(
    ("fabric", "least"),
    [pytest.param(CLOSED, 0.98, id="closed"), pytest.param(LOPSIDED, 0.3, id="narrow", marks=pytest.mark.slow)],
)
def test_white_cloth_in_a_furnace_makes_no_light(fabric, least):
    """All bounces of white diffuse yarns: closed Lambertian cloth returns all light, others return less."""
    above = np.float32(sphere(32, 24))
    above = above[above[:, 2] > 0.0]
    table, ones = bounce_table(fabric, 1 << 14), np.ones(len(above))
    for viewer in np.float32([unit(0.1, 0), unit(35, 100), unit(65, 250)]):
        wo = np.tile(viewer, (len(above), 1))
        queries = Queries.round(0.3 * ones, 0.7 * ones, 50.0 * ones, above, wo)
        first = truth_of(fabric, queries)[:, 2:].sum(axis=1)
        later = bounced(table, above, wo, np.ones((2, 1))).sum(axis=(1, 2))
        total = (first + later).sum() * 2.0 * math.pi / len(above)
        assert least < total < 1.01


@pytest.mark.parametrize(("name", "blend"), [slow("gauze", 1.0), slow("organza", 0.0)])
def test_white_cloth_that_lets_light_through_makes_none(name, blend):
    """Light from all around, k_d + k_dt = 1: what yarns return and what comes through gaps is at most 1."""
    fabric, around = woven(name, blend=blend), np.float32(sphere(32, 20))
    table, ones = bounce_table(fabric, 1 << 13, through=True), np.ones(len(around))
    for viewer in np.float32([unit(0.1, 0), unit(35, 100), unit(65, 250)]):
        wo = np.tile(viewer, (len(around), 1))
        queries = Queries.round(0.3 * ones, 0.7 * ones, 50.0 * ones, around, wo)
        first = truth_of(fabric, queries)[:, 2:]
        for share in (0.9, 0.5, 0.1):
            colours = np.array([[share], [share], [1.0 - share], [1.0 - share]])
            later = (bounced(table, around, wo, colours) * colours).sum()
            once = np.where(around[:, 2:] > 0.0, share, 1.0 - share) * first
            gap = (1.0 - fabric.warp.width) * (1.0 - fabric.weft.width)
            assert 0.3 < (once.sum() + later) * 4.0 * math.pi / len(around) < 1.01 - 0.5 * gap * viewer[2]
