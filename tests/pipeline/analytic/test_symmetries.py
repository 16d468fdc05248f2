"""What holds for every method: the same cloth, drawn in another way, has the same answers."""

import numpy as np
import pytest

from pipeline.shards.queries import QueryOptions, draw_queries
from tests.pipeline.analytic.methods import (
    ALL,
    PLACED,
    averaged_normals,
    horizon_points,
    soft_nodes,
    soft_nodes_behind,
    summed_area,
    woven,
)
from weaves.draft import Draft

MEAN, WORST = 2e-4, 0.05
"""Of the largest answer: a node on the border of two cells of a grid may read either, which moves few answers."""

LOPSIDED = woven("denim", ("#.#", "##.", ".##"), {"width": 0.8, "twist": 20.0}, {"bend": 35.0, "relief": 1.2})
"""Without symmetries of its own: yarns unlike, with gaps."""

ENDS, PICKS = LOPSIDED.weave.repeat


def asked(**options):
    return draw_queries(QueryOptions(sigma=(0.05, 4.0), max_angle=75.0, **options), (ENDS, PICKS), 3, 0, 120)


def redrawn(over, swap=False, mirrored=False):
    """Return the cloth with another draft, its families exchanged if `swap`, its twists reversed if `mirrored`."""
    sign = -1.0 if mirrored else 1.0
    warp, weft = (yarn.model_copy(update={"twist": sign * yarn.twist}) for yarn in (LOPSIDED.warp, LOPSIDED.weft))
    rows = tuple(Draft(over).rows())
    yarns = {"warp": weft, "weft": warp} if swap else {"warp": warp, "weft": weft}
    return LOPSIDED.model_copy(update=yarns | {"draft": LOPSIDED.draft.model_copy(update={"rows": rows})})


def turn(queries, x, y):
    """Return queries with x, y or both reversed."""
    signs = np.float32([x, y, 1.0])
    u = queries.u if x > 0 else ENDS - queries.u
    v = queries.v if y > 0 else PICKS - queries.v
    return queries._replace(u=u, v=v, wi=queries.wi * signs, wo=queries.wo * signs, angle=x * y * queries.angle)


def exchange(queries):
    """Return queries with x and y exchanged."""
    order = [1, 0, 2]
    return queries._replace(
        u=queries.v, v=queries.u, wi=queries.wi[:, order], wo=queries.wo[:, order],
        angle=np.float32(np.pi / 2) - queries.angle,
    )  # fmt: skip


def assert_equal(one, other, worst=WORST):
    difference = np.abs(one - other) / one.max(axis=0)
    assert one.max(axis=0).min() > 0.01 and difference.max() < worst, difference.max(axis=0)
    assert difference.mean() < MEAN


OVER = LOPSIDED.weave.warp_over
QUERIES = asked(stretch=4.0)


@pytest.mark.parametrize("method", PLACED)
def test_a_cloth_turned_by_half_a_turn_and_a_mirrored_one(method):
    """A mirror reverses the sense of the twists, half a turn does not."""
    own = method(LOPSIDED, QUERIES)
    assert_equal(own, method(redrawn(OVER[::-1, ::-1]), turn(QUERIES, -1, -1)))
    assert_equal(own, method(redrawn(OVER[:, ::-1], mirrored=True), turn(QUERIES, -1, 1)))
    # The twist is seen: without reversal the mirrored cloth answers otherwise.
    assert np.abs(own - method(redrawn(OVER[:, ::-1]), turn(QUERIES, -1, 1))).max() > 0.01 * own.max()


@pytest.mark.parametrize("method", PLACED)
def test_warp_and_weft_change_places(method):
    """The transposed draft, yarns exchanged: a mirror in the diagonal."""
    there = method(redrawn(~OVER.T, swap=True, mirrored=True), exchange(QUERIES))
    order = [1, 0, 3, 2, *range(4, there.shape[1])]
    assert_equal(method(LOPSIDED, QUERIES), there[:, order])


@pytest.mark.parametrize("method", [soft_nodes, soft_nodes_behind, summed_area])
def test_a_repeat_may_begin_anywhere_and_be_drawn_twice(method):
    """Places move along; centres are on a lattice of 1/64, so that single precision moves them exactly."""
    queries = QUERIES._replace(u=np.round(QUERIES.u * 64) / 64, v=np.round(QUERIES.v * 64) / 64)
    own = method(LOPSIDED, queries)
    moved = queries._replace(u=queries.u - np.float32(1), v=queries.v - np.float32(2))
    rolled = np.roll(OVER, (-2, -1), axis=(0, 1))
    assert_equal(own, method(redrawn(rolled), moved))
    # Twice the repeat: the longest period is the same, waves and means over all cells are not others.
    assert_equal(own, method(redrawn(np.tile(OVER, (1, 2))), queries))


@pytest.mark.parametrize("method", [soft_nodes, soft_nodes_behind, summed_area, horizon_points])
def test_an_ellipse_is_the_same_after_half_a_turn_and_with_its_axes_exchanged(method):
    own = method(LOPSIDED, QUERIES)
    right = np.float32(np.pi / 2)
    for same in (
        QUERIES._replace(angle=QUERIES.angle + 2 * right),
        QUERIES._replace(sigma=QUERIES.sigma_minor, sigma_minor=QUERIES.sigma, angle=QUERIES.angle - right),
    ):
        assert_equal(own, method(LOPSIDED, same), 1e-5)
    # An ellipse at right angles to it is another one.
    assert np.abs(own - method(LOPSIDED, QUERIES._replace(angle=QUERIES.angle + right))).max() > 0.1 * own.max()


@pytest.mark.parametrize("method", ALL)
def test_all_components_change_by_one_factor_if_light_and_viewer_do(method):
    """f(wi, wo) A(wo) is reciprocal, of both families, diffuse parts with cosines to the ply: only A(wo) differs.

    f and f' with light and viewer exchanged are parallel vectors of four components. Nothing is left out: points that
    one of the two does not reach count for neither.
    """
    cloth = LOPSIDED.model_copy(update={
        "warp": LOPSIDED.warp.model_copy(update={"blend": 1.0}), "weft": LOPSIDED.weft.model_copy(update={"blend": 1.0})
    })  # fmt: skip
    queries = asked()
    there, back = (
        method(cloth, q).astype(np.float64) for q in (queries, queries._replace(wi=queries.wo, wo=queries.wi))
    )
    sizes = np.linalg.norm(there, axis=1) * np.linalg.norm(back, axis=1)
    seen = sizes > 1e-6 * sizes.max()
    assert seen.mean() > 0.8
    sine = np.abs(there[:, :, None] * back[:, None, :] - there[:, None, :] * back[:, :, None]).max(axis=(1, 2))
    # Cosines of .3 % of shadows: the faint tail of a ramp is the viewer's alone.
    assert np.quantile(sine[seen] / sizes[seen], 0.95) < 3e-3
    factor = np.linalg.norm(there[seen], axis=1) / np.linalg.norm(back[seen], axis=1)
    assert factor.max() > 1.5 and factor.min() < 0.7


@pytest.mark.parametrize("method", [soft_nodes, soft_nodes_behind, averaged_normals])
def test_the_back_of_a_plain_weave_turned_over_is_its_front(method):
    """Turned about y, each float beneath lies on top; light from behind meets the same horizons on its way."""
    plain = woven("voile", twist=25.0)
    ends, _ = plain.weave.repeat
    queries = draw_queries(QueryOptions(sigma=(0.05, 4.0), max_angle=75.0), plain.weave.repeat, 5, 0, 120)
    signs = np.float32([-1.0, 1.0, 1.0])
    over = queries._replace(u=ends - queries.u, wi=queries.wi * signs, wo=queries.wo * signs)
    assert_equal(method(plain, queries), method(plain.back(), over))
