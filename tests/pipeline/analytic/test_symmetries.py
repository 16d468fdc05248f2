from functools import partial

import numpy as np
import pytest

from tests.pipeline.analytic import methods
from tests.pipeline.truth.cloths import LOPSIDED, agree, drawn, images_agree, moved_far, reversed_axes, woven
from tests.presets import slow

MEAN, WORST = 2e-4, 0.05
"""Of the largest answer: a node on the border of two cells of a grid may read either, which moves few answers."""


def asked(**options):
    return drawn(LOPSIDED, 3, 120, sigma=(0.05, 4.0), max_angle=75.0, **options)


QUERIES = asked(stretch=4.0)


@pytest.mark.parametrize("method", [slow(m) if m is methods.soft_nodes_behind else m for m in methods.PLACED])
def test_a_cloth_drawn_in_another_way_has_the_same_answers(method):
    """Twice the repeat has the same longest period: waves and means over all cells are not others. Maps of mean normals
    begin somewhere."""
    without = ("begun elsewhere", "drawn twice") if method is methods.averaged_normals else ()
    images_agree(method, QUERIES, WORST, MEAN, without)


@pytest.mark.parametrize("method", [*methods.ALL, methods.soft_nodes_behind])
def test_translation_by_repeats_changes_nothing(method):
    """Places are reduced in double precision; what is random or sampled depends on the place in the repeat alone."""
    near, far = moved_far(QUERIES)
    own = method(LOPSIDED, near)
    np.testing.assert_allclose(method(LOPSIDED, far), own, rtol=1e-4, atol=1e-5 * own.max())
    assert np.abs(own - method(LOPSIDED, near._replace(u=near.u + np.float32(1)))).max() > 0.05 * own.max()


@pytest.mark.parametrize("method", methods.PLACED)
def test_a_footprint_far_larger_than_the_repeat_has_no_place(method):
    queries = asked().take(slice(0, 1)).take(np.zeros(5, np.int64))._replace(sigma=np.full(5, 50.0, np.float32))
    queries = queries._replace(sigma_minor=queries.sigma, u=np.linspace(0, 3, 5, dtype=np.float32))
    found = method(LOPSIDED, queries)
    np.testing.assert_allclose(found, found[:1].repeat(5, axis=0), rtol=1e-5)


@pytest.mark.parametrize("method", [methods.soft_nodes, methods.soft_nodes_behind])
def test_an_ellipse_is_the_same_after_half_a_turn_and_with_its_axes_exchanged(method):
    own = method(LOPSIDED, QUERIES)
    right = np.float32(np.pi / 2)
    for same in (
        QUERIES._replace(angle=QUERIES.angle + 2 * right),
        QUERIES._replace(sigma=QUERIES.sigma_minor, sigma_minor=QUERIES.sigma, angle=QUERIES.angle - right),
    ):
        agree(own, method(LOPSIDED, same), 1e-5, MEAN)
    # An ellipse at right angles to it is another one.
    assert np.abs(own - method(LOPSIDED, QUERIES._replace(angle=QUERIES.angle + right))).max() > 0.1 * own.max()


RECIPROCAL = {"averaged_normals": 3e-3, "soft_nodes": 0.02}
"""Bounds of the sine: cosines of .3 % of shadows, because the faint tail of a ramp is the viewer's alone. Soft nodes
see by rays and areas what they light by soft horizons; with rims the sine would be .12."""


@pytest.mark.parametrize("name", RECIPROCAL)
def test_all_components_change_by_one_factor_if_light_and_viewer_do(name):
    """f(wi, wo) A(wo) is reciprocal, of both families, diffuse parts with cosines to the ply: only A(wo) differs. f and
    f' with light and viewer exchanged are parallel vectors of four components. Nothing is left out: points that one of
    the two does not reach count for neither. View rays that meet walls see rims, which lights do not: walls are left
    out. A footprint has to cover the cloth evenly: its rays are those of the viewer alone."""
    method = partial(methods.soft_nodes, rims=False, level=8) if name == "soft_nodes" else getattr(methods, name)
    cloth = LOPSIDED.model_copy(update={
        "warp": LOPSIDED.warp.model_copy(update={"blend": 1.0}), "weft": LOPSIDED.weft.model_copy(update={"blend": 1.0})
    })  # fmt: skip
    queries = asked()._replace(sigma=np.full(120, 24.0, np.float32), sigma_minor=np.full(120, 24.0, np.float32))
    there, back = (
        method(cloth, q).astype(np.float64) for q in (queries, queries._replace(wi=queries.wo, wo=queries.wi))
    )
    sizes = np.linalg.norm(there, axis=1) * np.linalg.norm(back, axis=1)
    seen = sizes > 1e-6 * sizes.max()
    assert seen.mean() > 0.8
    sine = np.abs(there[:, :, None] * back[:, None, :] - there[:, None, :] * back[:, :, None]).max(axis=(1, 2))
    assert np.quantile(sine[seen] / sizes[seen], 0.95) < RECIPROCAL[name]
    factor = np.linalg.norm(there[seen], axis=1) / np.linalg.norm(back[seen], axis=1)
    assert factor.max() > 1.5 and factor.min() < 0.7


@pytest.mark.parametrize("method", [methods.soft_nodes, methods.soft_nodes_behind, methods.averaged_normals])
def test_the_back_of_a_plain_weave_turned_over_is_its_front(method):
    """Turned about y, each float beneath lies on top; light from behind meets the same horizons on its way."""
    plain = woven("voile", twist=25.0)
    queries = drawn(plain, 5, 120, sigma=(0.05, 4.0), max_angle=75.0)
    over = reversed_axes(queries, -1, 1, plain.weave.repeat)
    agree(method(plain, queries), method(plain.back(), over), WORST, MEAN)
