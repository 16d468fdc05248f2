import math

import numpy as np
import pytest

from pipeline.truth.cloth import cloth_side
from pipeline.truth.estimator import estimate
from pipeline.truth.scattering.point import directions_of, point_share
from tests.directions import unit
from tests.pipeline.truth.cloths import equal_queries, fixed
from tests.pipeline.truth.geometry.marches import leaves
from tests.presets import slow
from weaves.fabric import load_fabric
from weaves.surface import WARP, WEFT, surface_at

EXACT = fixed(1 << 14, footprint="box")
PLANE = fixed(1 << 14, footprint="box", parallax=False)


def _queries(fabric, wi, wo, curvature):
    """Return a query about the whole repeat, by a box."""
    query = equal_queries(wi, wo, fabric.weave.repeat[0] / math.sqrt(12), centre=(1.0, 1.0))
    return query._replace(curvature=np.float32([curvature]))


def _brute(fabric, wi, wo, curvature, x, y):
    """Return area, F_specular V A and F_diffuse V A of points, the formulas of scattering.point written anew."""
    point, back = surface_at(fabric, x, y), surface_at(fabric.back(), x, y)
    n, t = point.normal, point.tangent
    across = (wi[:2] @ wo[:2]) ** 2 / ((wi[:2] @ wi[:2]) * (wo[:2] @ wo[:2]))
    cos_o, cos_i = n @ wo, n @ wi
    seen = (cos_o > 0) & leaves(fabric, x, y, point.height, wo, curvature)
    front = (cos_i > 0) & leaves(fabric, x, y, point.height, wi, curvature * across)
    behind = np.zeros(len(x), bool)
    if wi[2] < 0:
        mirrored = wi * (1, 1, -1)
        behind = (cos_i < 0) & (back.normal @ mirrored > 0) & leaves(fabric.back(), x, y, back.height, mirrored, 0.0)
    area = np.where(seen, cos_o / n[:, 2], 0.0)

    def of(yarns, name):
        return np.where(point.yarn == WARP, getattr(yarns[0], name), getattr(yarns[1], name))

    alpha, blend = (of((fabric.warp, fabric.weft), name) for name in ("roughness", "blend"))
    sigma_i, sigma_o = (np.sqrt(((np.cross(w, t)) ** 2).sum(1) + (alpha * (t @ w)) ** 2) for w in (wi, wo))
    h = (wi + wo) / np.linalg.norm(wi + wo)
    q = (h**2).sum() - (t @ h) ** 2 + (t @ h) ** 2 / alpha**2
    flakes = 1 / (math.pi * alpha * q**2)
    depth, c_i = fabric.optical_thickness, np.abs(cos_i)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        a, b = sigma_i / c_i, sigma_o / cos_o
        reflected = flakes * (1 - np.exp(-depth * (a + b))) / (4 * (sigma_i * cos_o + sigma_o * c_i))
        passed = flakes * (np.exp(-depth * b) - np.exp(-depth * a)) / (a - b) / (4 * c_i * cos_o)
        specular = c_i * np.where(front, reflected, passed)
    macro = np.where(front, max(wi[2], 0.0), abs(wi[2]))
    diffuse = (blend * c_i + (1 - blend) * macro) / math.pi
    lit = seen & (front | behind)
    shares = np.stack([area, np.where(lit, specular, 0) * area, np.where(lit, diffuse, 0) * area], axis=-1)
    return np.where(seen[:, None], shares, 0), point.yarn, front[seen].mean(), behind[seen].mean()


@pytest.mark.parametrize(
    ("name", "curvature", "light", "viewer"),
    [
        ("denim", 0.0, (60, 20), (20, 150)),
        ("polyester_lining", 0.2, (94, 30), (65, 185)),
        slow("denim", 0.4, (98, 250), (40, 85)),
    ],
)
def test_estimates_match_brute_force(name, curvature, light, viewer):
    """Directions are no mirror pairs: the swapped pair of the flat cloth differs by far more than the tolerance.

    Points of the fabric, which is what the formulas are written for.
    """
    fabric, wi, wo = load_fabric(name), unit(*light), unit(*viewer)
    # One random point in each stratum of a grid over the repeat.
    strata = 72
    at = np.stack(np.meshgrid(np.arange(strata), np.arange(strata)), -1).reshape(-1, 2)
    x, y = ((at + np.random.default_rng(5).random(at.shape)) * fabric.weave.repeat / strata).T
    shares, yarn, front, behind = _brute(fabric, wi, wo, curvature, x, y)
    assert front > 0.05, "light below the tangent plane reaches a curved cloth"
    assert (behind > 0) == (wi[2] < 0)

    # Point by point: only where a march steps over an edge may they differ.
    model, query = cloth_side(fabric, PLANE), directions_of(*wi, *wo, curvature)
    kernels = [point_share(model.front, model.back, *p, query, model.choices) for p in zip(x, y, strict=True)]
    assert all(k[0] == family for k, family in zip(kernels, yarn, strict=True))
    wrong = ~np.isclose([k[1:4] for k in kernels], shares, rtol=1e-9, atol=1e-12).all(axis=1)
    assert wrong.mean() < 0.005

    # The patch.
    exact = [shares[yarn == f, column].sum() / shares[:, 0].sum() for column in (1, 2) for f in (WARP, WEFT)]
    answers = estimate(fabric, _queries(fabric, wi, wo, curvature), PLANE, 2)
    error = answers.standard_error[0]
    assert np.linalg.norm(error) < 0.02 * np.linalg.norm(exact)
    assert (np.abs(answers.mean[0] - exact) < 4 * error).all()
    swapped = estimate(fabric, _queries(fabric, wo, wi, curvature), PLANE, 2) if curvature == 0.0 else None
    assert swapped is None or (np.abs(swapped.mean / answers.mean - 1) > 0.1).any()


def test_flat_is_the_limit_of_a_small_curvature():
    fabric = load_fabric("denim")
    for light in (30.0, 80.0, 125.0):
        flat, bent = (
            estimate(fabric, _queries(fabric, unit(light, 70), unit(50, 200), k), EXACT, 2) for k in (0.0, 1e-6)
        )
        assert flat.mean.max() > 1e-4
        np.testing.assert_allclose(bent.mean, flat.mean, rtol=1e-4, atol=1e-7)
        np.testing.assert_allclose(bent.transparency, flat.transparency, rtol=1e-4)
