"""Nodes on view lines: what they weigh against the Gaussian's own, what they see against single rays and the truth."""

import math

import numpy as np
import pytest

from pipeline.analytic.soft_nodes.answer import query_sums
from pipeline.analytic.soft_nodes.components import read_queries
from pipeline.analytic.soft_nodes.nodes import tabulate
from pipeline.analytic.soft_nodes.shade import AREA, BARE_AREA, OPEN_DIFFUSE, OPEN_SPECULAR
from pipeline.truth.cloth import cloth_side
from pipeline.truth.options import TruthOptions
from pipeline.truth.query import Queries
from pipeline.truth.scattering.point import Choices, directions_of, ray_share
from tests.pipeline.models.against_truth import colour_error, truth_of
from tests.pipeline.truth.cloths import drawn, woven
from weaves.fabric import load_fabric


@pytest.mark.parametrize("rims", [True, False])
@pytest.mark.parametrize("curvature", [0.0, 0.15])
def test_a_point_sees_what_its_ray_meets(curvature, rims):
    """Shares of the area, diffuse and specular light without shadows of a thousandth of a yarn, in double precision.

    Footprints across the border of a yarn, or of what hides it, differ: one in fifty.
    """
    fabric = woven("denim", relief=1.2, twist=30.0, blend=0.7)
    table, cloth = tabulate(fabric, curved=True, rims=rims), cloth_side(fabric, TruthOptions())
    asked = drawn(fabric, 5, 400, sigma=(1e-3, 1e-3), max_angle=75.0)
    asked = asked._replace(curvature=np.full(400, curvature, np.float32))
    sums, gaps = query_sums(table, asked)
    choices, expected = Choices(macro=False, shadows=False, rims=rims), np.zeros((400, 2, 3))
    for row in range(400):
        towards = directions_of(*asked.wi[row].astype(float), *asked.wo[row].astype(float), curvature)
        place = float(asked.u[row]), float(asked.v[row])
        family, *shares = ray_share(cloth.front, cloth.back, cloth.plane, *place, towards, choices)[:4]
        if family < 2:
            expected[row, family] = shares
    assert not gaps.any()
    found = sums[:, :, [AREA, OPEN_SPECULAR, OPEN_DIFFUSE]] / [1.0, 1.0, math.pi]
    area, of_rays = (shares[:, :, 0].sum(axis=1)[:, None, None] for shares in (found, expected))
    met = ((area > 0.0) & (of_rays > 0.0)).ravel()
    assert met.mean() > (0.99 if rims else 0.9)
    wrong = np.abs(found[met] / area[met] - expected[met] / of_rays[met]).sum(axis=1).max(axis=1)
    assert np.quantile(wrong, 0.97) < 1e-3


def test_a_thin_ellipse_covers_what_its_gaussian_covers():
    """The share of the warp, seen from straight above on a plain weave without gaps: it is on top in every other cell.

    Against midpoints along the ellipse's own axes. Lines run along x, a quarter of a yarn apart at most: a thin ellipse
    across them is on few.
    """
    random, count = np.random.default_rng(3), 80
    u, v, angle = random.random(count) * 2.0, random.random(count) * 2.0, random.random(count) * math.pi
    major, minor = random.uniform(0.3, 0.8, count), random.uniform(0.03, 0.15, count)
    up = np.tile([0.0, 0.0, 1.0], (count, 1))
    fabric = load_fabric("polyester_lining")
    queries = Queries.round(u, v, major, up, up)
    queries = queries._replace(sigma_minor=minor.astype(np.float32), angle=angle.astype(np.float32))
    sums, gaps = query_sums(tabulate(fabric), queries)
    assert not gaps.any()
    found = sums[:, 0, BARE_AREA] / sums[:, :, BARE_AREA].sum(axis=1)
    a, b = np.meshgrid((np.arange(320) + 0.5) / 32 - 5.0, (np.arange(160) + 0.5) / 16 - 5.0)
    weight = np.exp(-0.5 * (a**2 + b**2))
    shares = []
    for x, y, turn, long, short in zip(u, v, angle, major, minor, strict=True):
        cosine, sine = math.cos(turn), math.sin(turn)
        end = np.floor(x + long * a * cosine - short * b * sine).astype(int) % 2
        pick = np.floor(y + long * a * sine + short * b * cosine).astype(int) % 2
        shares.append((weight * fabric.weave.warp_over[pick, end]).sum() / weight.sum())
    assert np.ptp(shares) > 0.5
    np.testing.assert_allclose(found, shares, atol=0.1)
    assert np.sqrt(np.mean((found - shares) ** 2)) < 0.02


@pytest.mark.parametrize(
    ("sigma", "stretch", "bound"),
    [((0.1, 0.3), 12.0, 0.09), ((0.25, 0.6), 10.0, 0.05)],
    ids=["minor below .1", "below .25"],
)
def test_thin_footprints_are_near_the_truth(sigma, stretch, bound):
    """RMSE of a grey cloth's colour over its mean; as round footprints of equal area they were 8 to 16 %, 4 to 6 %."""
    fabric = load_fabric("denim")
    queries = drawn(fabric, 3, 300, sigma=sigma, stretch=stretch, max_angle=80.0)
    queries = queries.take(queries.sigma > 2.0 * queries.sigma_minor)
    assert colour_error(read_queries(tabulate(fabric), queries).components, truth_of(fabric, queries)) < bound
