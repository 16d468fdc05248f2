import itertools
import math

import numpy as np
import pytest

from pipeline.truth.cloth import cloth_side
from pipeline.truth.geometry.heightfield import GAP, UNDER, surface_at
from pipeline.truth.geometry.horizon import horizon
from pipeline.truth.geometry.march import ray
from pipeline.truth.geometry.visibility import visible
from pipeline.truth.options import TruthOptions
from weaves.fabric import load_fabric

CLOSE = 2e-3
"""Slope within which a horizon is found, but for strips beneath a yarn, which are searched at few points."""


CASES = [*itertools.product(("denim", "satin_8"), (0.0, 0.05, 0.3, 1.0), [0.0], [0.04])]
CASES += [(name, 0.0, 0.004, 0.01) for name in ("polyester_lining", "satin_8", "denim", "silk_shantung")]


@pytest.mark.parametrize(("name", "curvature", "slack", "most"), CASES)
def test_rays_above_are_free_and_rays_below_are_not(name, curvature, slack, most):
    field = cloth_side(load_fabric(name), TruthOptions()).front
    picks, ends = field.top.shape
    random = np.random.default_rng(7)
    wrong, below_the_plane = 0, 0
    for x, y, turn in zip(*(random.random((3, 400)) * [[ends], [picks], [2.0 * math.pi]]), strict=True):
        family, side, z, *_ = surface_at(field, x, y, int(x), int(y))
        side, z = (UNDER, 0.0) if family == GAP else (side, z)
        dx, dy = math.cos(turn), math.sin(turn)
        slope = horizon(field, x, y, z, side, dx, dy, curvature)
        below_the_plane += slope < 0.0
        above, below = (
            visible(field, x, y, z, side, ray(dx * flat, dy * flat, rise * flat, curvature))
            for rise in (slope + CLOSE + slack * slope, slope - CLOSE - slack * slope)
            for flat in [1.0 / math.hypot(1.0, rise)]
        )
        # A flat base hides whatever lies below its plane.
        wrong += not above or (below and (slope > CLOSE or curvature > 0.0))
    assert wrong <= most * 400
    assert (below_the_plane > 40) == (curvature > 0.0)
    assert curvature > 0.0 or below_the_plane == 0
