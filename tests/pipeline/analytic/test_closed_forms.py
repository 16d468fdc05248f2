import itertools
import math

import numpy as np
import pytest

from pipeline.analytic.exact_points import sample_points
from pipeline.analytic.soft_nodes.answer import query_sums
from pipeline.analytic.soft_nodes.nodes import tabulate
from pipeline.analytic.soft_nodes.shade import AREA, OPEN_DIFFUSE, OPEN_SPECULAR
from pipeline.truth.cloth import cloth_side
from pipeline.truth.options import TruthOptions
from pipeline.truth.query import Queries
from tests.pipeline.analytic import methods
from tests.pipeline.truth.cloths import along_cylinders, cylinder_answers, cylinders, drawn, woven


@pytest.mark.parametrize("method", methods.ALL)
def test_a_lamp_at_the_eye_lights_all_that_is_seen(method):
    """Diffuse parts with cosines to the cloth alone: cos / pi, whatever the weave, the footprint and the direction.

    Soft nodes see by rays and areas what they light by soft horizons: up to 2.6 % are in soft shadows there.
    """
    fabric = woven("cotton_twill", blend=0.0)
    queries = drawn(fabric, 3, 60, sigma=(0.3, 4.0), max_angle=70.0, stretch=3.0)  # fmt: skip
    found = method(fabric, queries._replace(wi=queries.wo))[:, 2:].sum(axis=1)
    np.testing.assert_allclose(found * math.pi, queries.wo[:, 2], rtol=0.03 if method is methods.soft_nodes else 2e-3)


def cloth(blend=0.5):
    return cylinders(blend=blend, twist=20.0, roughness=0.4)


def shadow_errors(method, blend, viewer=0.0, **options):
    """Return the rms errors of specular and diffuse component over their means; viewers are along the yarns."""
    queries, fabric = along_cylinders(viewer=viewer), cloth(blend)
    exact = cylinder_answers(fabric, queries)[:, :2]
    found = method(fabric, queries, **options)
    assert not found[:, [1, 3]].any()  # no weft is seen
    return np.sqrt(np.mean((found[:, [0, 2]] - exact) ** 2, axis=0)) / exact.mean(axis=0)


@pytest.mark.parametrize(("method", "bound"), [(methods.soft_nodes, 0.04), (methods.points, 0.006)])
def test_shadows_of_cylinders_on_each_other(method, bound):
    """Without the neighbour's shadow diffuse light would be 17 % off, without shadow and terminator 37 %."""
    for blend, viewer in itertools.product((0.0, 1.0), (0.0, 1.2)):
        assert (shadow_errors(method, blend, viewer) < bound).all()


def test_soft_shadows_converge_with_the_nodes_across_and_the_seen_area_is_the_projected_one():
    """From k = 2 to 4 a yarn has twice as many, and narrower ramps: order 1/2 at least. Others change nothing."""
    errors = np.array([shadow_errors(methods.soft_nodes, 0.5, 1.2, level=level) for level in (1, 2, 4, 8)])
    np.testing.assert_allclose(errors[[0, 2]], errors[[1, 3]], atol=5e-4)
    assert (errors[2] < errors[1] / math.sqrt(2.0)).all(), errors
    # Straight yarns side by side hide one another, but no light passes: the area seen is cos, at any angle.  Its
    # table is linear between angles and azimuths; no wall is there to be left out.
    fabric = cloth()
    queries = drawn(fabric, 3, 60, sigma=(6.0, 8.0), max_angle=80.0)
    sums, gaps = query_sums(tabulate(fabric, rims=False), queries)
    assert not gaps.any()
    assert np.abs(sums[:, :, AREA].sum(axis=1) / queries.wo[:, 2] - 1.0).mean() < 0.01


@pytest.mark.parametrize("depth", [0.05, 0.4, 2.0])
def test_unscattered_light_through_cylinders(depth):
    """exp(-T Lambda) over the angle across, viewers along the yarns: nothing hides, and there is no gap."""
    fabric = cloth().model_copy(update={"optical_thickness": depth})
    queries = along_cylinders(viewer=1.2)
    exact = cylinder_answers(fabric, queries)[:, 2]
    np.testing.assert_allclose(methods.soft_nodes_behind(fabric, queries)[:, 4], exact, atol=0.02 * exact.max())
    looks = queries._replace(wi=-queries.wo)
    through = sample_points(cloth_side(fabric, TruthOptions()), looks, 1024, 3, True)[:, 4]
    np.testing.assert_allclose(through, exact, atol=0.01 * exact.max())


@pytest.mark.parametrize(
    ("sigma", "stretch"), [(0.08, 1.0), (0.2, 1.0), (0.2, 3.0), (0.45, 1.0), (0.45, 2.0), (0.8, 1.0)]
)
def test_footprints_on_a_lattice_cover_the_cloth_evenly(sigma, stretch):
    """The mean over centres of what is seen is that of a footprint far wider than the repeat, in every regime. Weights
    are shares of the footprint, up to the tail that is cut off, and to the error of rules; those of fixed nodes, from
    .3 yarns to even ones, are densities times the integral of the Gaussian."""
    fabric = woven("polyester_lining", twist=20.0, width=0.9)
    ends, picks = fabric.weave.repeat
    u, v = (axis.ravel() for axis in np.mgrid[0:ends:0.125, 0:picks:0.125] + 0.0625)
    wi, wo = (np.tile(np.float32(w), (u.size, 1)) for w in ([0.16, -0.12, 0.9798], [-0.12, 0.16, 0.9798]))
    queries = Queries.round(u, v, np.full(u.size, sigma * stretch), wi, wo)
    queries = queries._replace(sigma_minor=np.full_like(queries.u, sigma), angle=np.full_like(queries.u, 0.7))
    wide = Queries.round([0.0], [0.0], [1e3], wi[:1], wo[:1])
    means = []
    for asked in (queries, wide):
        sums, _ = query_sums(methods.soft_table(fabric), asked)
        means.append(sums[:, :, [AREA, OPEN_DIFFUSE, OPEN_SPECULAR]].mean(axis=0).astype(np.float64))
    ratio = means[0] / means[1]
    whole = 2.0 * math.pi * sigma**2 * stretch if sigma == 0.45 else 1.0
    assert 0.96 < ratio.mean() / whole < 1.01
    np.testing.assert_allclose(ratio / ratio.mean(), 1.0, atol=0.015)
