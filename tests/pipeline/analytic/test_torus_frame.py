import math

import numpy as np
import pytest

from pipeline.analytic.torus_frame import Angles, Fibre, bend, normal, tangent, turning
from pipeline.truth.geometry import heightfield as heights
from tests.pipeline.truth.cloths import woven

STEP = 1e-5  # of central differences


@pytest.fixture(scope="module")
def field():
    return heights.height_field(woven("cotton_twill", relief=1.3, twist=25.0))


@pytest.mark.parametrize(("kind", "rtol"), [(float, 1e-12), (np.float32, 2e-6)], ids=["float64", "float32"])
def test_frames_are_those_of_the_height_field(field, kind, rtol):
    random = np.random.default_rng(5)
    picks, ends = np.nonzero(field.top == heights.WARP)
    for pick, end in zip(picks[:4], ends[:4], strict=True):
        own, yarn = field.floats[pick, end, heights.TOP], field.yarn[heights.WARP]
        radius, ring = yarn[heights.RADIUS], own[heights.BEND_RADIUS]
        for across, along in random.uniform(-0.45, 0.45, (20, 2)):
            x, y = end + 0.5 + across * 2 * radius, pick + 0.5 + along
            _, _, _, *expected = heights.surface_at(field, x, y, end, pick)
            sin_v, limit = (x - end - 0.5) / radius, own[heights.HALF_LENGTH] / ring
            numbers = (sin_v, math.sqrt(1 - sin_v**2), radius, along + own[heights.OFFSET], 1 / ring, limit)
            angles, curvature = bend(*(kind(number) for number in numbers))
            assert curvature == pytest.approx(1.0 / (ring + radius * math.sqrt(1.0 - sin_v**2)), rel=rtol)
            fibre = Fibre(*(kind(yarn[column]) for column in (heights.SIN_TWIST, heights.COS_TWIST, heights.BETA)))
            angles = Angles(*(kind(number) for number in angles))
            found = (*normal(angles, fibre.beta), *tangent(angles, fibre)[:3])
            np.testing.assert_allclose(found, expected, atol=rtol)


@pytest.mark.parametrize("seed", range(5))
def test_turning_is_the_derivative_of_the_tangent(seed):
    """Central differences with a step of 1e-5: their error is 1e-10."""
    v, u, twist, beta, *h = np.random.default_rng(seed).uniform(-0.9, 0.9, 7).tolist()
    fibre = Fibre(math.sin(twist), math.cos(twist), 1.0 + 0.3 * beta)

    def along(u, v):
        angles = Angles(math.sin(v), math.cos(v), math.sin(u), math.cos(u))
        t = tangent(angles, fibre)
        return float(np.dot(h, t[:3])), turning(*h, t, angles, fibre)

    pairs = (((u + STEP, v), (u - STEP, v)), ((u, v + STEP), (u, v - STEP)))
    expected = [(along(*after)[0] - along(*before)[0]) / (2 * STEP) for after, before in pairs]
    np.testing.assert_allclose(along(u, v)[1], expected, atol=1e-8)


@pytest.mark.parametrize(("sine", "expected"), [(0.2, 0.2), (5.0, 0.999), (-5.0, -0.999)])
def test_a_float_ends_at_its_steepest_place(sine, expected):
    angles, _ = bend(0.0, 1.0, 0.4, sine * 2.5, 1.0 / 2.1, 0.999)
    assert angles.sin_u == pytest.approx(expected) and math.hypot(angles.sin_u, angles.cos_u) == pytest.approx(1.0)
