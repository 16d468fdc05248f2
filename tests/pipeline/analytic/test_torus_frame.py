"""Normal, tangent and its turning against the height field and against finite differences."""

import math

import numpy as np
import pytest

from pipeline.analytic.torus_frame import Angles, Fibre, bend, normal, tangent, turning
from pipeline.truth.geometry.heightfield import (
    BEND_RADIUS,
    BETA,
    COS_TWIST,
    HALF_LENGTH,
    OFFSET,
    RADIUS,
    SIN_TWIST,
    TOP,
    WARP,
    height_field,
    surface_at,
)
from weaves.fabric import load_fabric


@pytest.fixture(scope="module")
def field():
    fabric = load_fabric("cotton_twill")
    changes = {"relief": 1.3, "twist": 25.0}
    return height_field(
        fabric.model_copy(update={key: getattr(fabric, key).model_copy(update=changes) for key in ("warp", "weft")})
    )


@pytest.mark.parametrize(("kind", "rtol"), [(float, 1e-12), (np.float32, 2e-6)], ids=["float64", "float32"])
def test_frames_are_those_of_the_height_field(field, kind, rtol):
    random = np.random.default_rng(5)
    picks, ends = np.nonzero(field.top == WARP)
    for pick, end in zip(picks[:4], ends[:4], strict=True):
        own, yarn = field.floats[pick, end, TOP], field.yarn[WARP]
        for across, along in random.uniform(-0.45, 0.45, (20, 2)):
            x, y = end + 0.5 + across * 2 * yarn[RADIUS], pick + 0.5 + along
            _, _, _, *expected = surface_at(field, x, y, end, pick)
            sin_v = (x - end - 0.5) / yarn[RADIUS]
            limit = own[HALF_LENGTH] / own[BEND_RADIUS]
            numbers = (sin_v, math.sqrt(1 - sin_v**2), yarn[RADIUS], along + own[OFFSET], 1 / own[BEND_RADIUS], limit)
            angles, _ = bend(*(kind(number) for number in numbers))
            fibre = Fibre(*(kind(yarn[column]) for column in (SIN_TWIST, COS_TWIST, BETA)))
            angles = Angles(*(kind(number) for number in angles))
            found = (*normal(angles, fibre.beta), *tangent(angles, fibre)[:3])
            np.testing.assert_allclose(found, expected, atol=rtol)


@pytest.mark.parametrize("seed", range(5))
def test_turning_is_a_derivative(seed):
    """Central differences with a step of 1e-5: their error is 1e-10."""
    v, u, twist, beta, *h = np.random.default_rng(seed).uniform(-0.9, 0.9, 7).tolist()
    fibre = Fibre(math.sin(twist), math.cos(twist), 1.0 + 0.3 * beta)

    def along(u, v):
        angles = Angles(math.sin(v), math.cos(v), math.sin(u), math.cos(u))
        t = tangent(angles, fibre)
        return float(np.dot(h, t[:3])), turning(*h, t, angles, fibre)

    step = 1e-5
    expected = [
        (along(u + step, v)[0] - along(u - step, v)[0]) / (2 * step),
        (along(u, v + step)[0] - along(u, v - step)[0]) / (2 * step),
    ]
    np.testing.assert_allclose(along(u, v)[1], expected, atol=1e-8)
