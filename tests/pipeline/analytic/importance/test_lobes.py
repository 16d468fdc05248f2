import math

import numpy as np
import pytest

from pipeline.analytic.importance import lobes as point
from pipeline.analytic.importance.mixture import STRAIGHT_ON, density_rows
from pipeline.truth.cloth import cloth_side
from pipeline.truth.geometry.heightfield import ALPHA, GAP, surface_at
from pipeline.truth.geometry.march import ray
from pipeline.truth.geometry.visibility import visible
from pipeline.truth.options import TruthOptions
from pipeline.truth.query import Queries
from pipeline.truth.scattering.slab import density, sigma
from tests.pipeline.truth.cloths import LOPSIDED, woven

COUNT = 400


def points_of(fabric):
    """Return queries about points of a fabric, directions over the sphere, viewers in front."""
    rng, (ends, picks) = np.random.default_rng(4), fabric.weave.repeat
    wi, wo = rng.standard_normal((2, COUNT, 3))
    wo[:, 2] = np.abs(wo[:, 2]) + 0.3
    u, v, tiny = rng.random(COUNT) * ends, rng.random(COUNT) * picks, np.full(COUNT, 1e-3)
    units = (w / np.linalg.norm(w, axis=1, keepdims=True) for w in (wi, wo))
    return Queries.round(u, v, tiny, *units)


def lobes_of(fabric, queries):
    """Return the lobes of points, and the densities of their wi."""
    lobes = point.find_lobes(point.tabulate_surface(fabric), queries, point.point_places(1), 2.0)
    pdf = np.empty(COUNT, np.float32)
    density_rows(lobes, queries.wi, queries.wo, pdf)
    return lobes, pdf


@pytest.mark.parametrize("fabric", [woven("denim"), LOPSIDED, woven("voile")], ids=["closed", "narrow", "open"])
def test_the_lobe_of_a_point_is_that_of_the_truths_surface(fabric):
    """Tangents to 1e-3, gaps and densities; points within a deviation of an edge may lie beyond it."""
    front, queries = cloth_side(fabric, TruthOptions()).front, points_of(fabric)
    lobes, pdf = lobes_of(fabric, queries)
    right, seen_alike, checked = 0, 0, 0
    for n in range(COUNT):
        x, y, wo = float(queries.u[n]), float(queries.v[n]), queries.wo[n].astype(float)
        family, side, z, nx, ny, nz, tx, ty, tz = surface_at(front, x, y, int(x), int(y))
        if family == GAP:
            right += lobes.rest[n, point.STRAIGHT] > 0.9 or lobes.flakes[n, point.SHARE].sum() == 0
            continue
        found = lobes.flakes[n, point.TX : point.TZ + 1, 0].astype(float)
        right += abs(found @ (tx, ty, tz)) > 1.0 - 1e-3
        seen = wo @ (nx, ny, nz) > 0.0 and bool(visible(front, x, y, z, side, ray(*wo, 0.0)))
        share = float(lobes.flakes[n, point.SHARE, 0])
        seen_alike += seen == (share > 0.0)
        checked += 1
        wi, alpha = queries.wi[n].astype(float), front.yarn[family, ALPHA]
        own, mirrored = (
            density(*(wo + light), *found, alpha) / (4.0 * sigma(*wo, *found, alpha))
            for light in (wi, wi * (1.0, 1.0, -1.0))
        )
        near = wi[2] > 0.0
        wanted = share * (own + (1.0 - STRAIGHT_ON) * mirrored if near else STRAIGHT_ON * own)
        wanted += lobes.rest[n, point.NEAR if near else point.NEAR + 1] * abs(wi[2]) / math.pi
        assert pdf[n] == pytest.approx(wanted, rel=2e-3)
    assert right >= 0.98 * COUNT
    # A coarse grid of horizons and a ramp decide what a march decides here.
    assert seen_alike >= 0.9 * checked
