import math

import numpy as np
import pytest

from pipeline.truth.geometry.heightfield import GAP, UNDER, height_field, surface_at
from pipeline.truth.geometry.march import ray
from pipeline.truth.geometry.visibility import visible
from tests.directions import unit
from tests.pipeline.truth.cloths import woven
from tests.pipeline.truth.geometry.marches import leaves
from weaves.fabric import load_fabric


@pytest.mark.parametrize(("name", "width"), [("denim", 1.0), ("silk_charmeuse", 1.0), ("basket", 0.8)])
@pytest.mark.parametrize("degrees", [25.0, 75.0])
def test_visibility_matches_a_march(name, width, degrees):
    fabric = woven(name, width=width)
    field = height_field(fabric)
    ends, picks = fabric.weave.repeat
    generator = np.random.default_rng(int(degrees))
    x, y = generator.random((2, 1200)) * np.array([[ends], [picks]])
    azimuth = generator.random() * 2 * math.pi
    w = unit(degrees, math.degrees(azimuth))
    points = [surface_at(field, a, b, int(a), int(b)) for a, b in zip(x, y, strict=True)]
    above = np.array([p[0] != GAP and w @ p[3:6] > 1e-3 for p in points])
    exact = np.array([visible(field, a, b, p[2], p[1], ray(*w, 0.0)) for a, b, p in zip(x, y, points, strict=True)])
    marched = leaves(fabric, x, y, np.array([p[2] for p in points]), w, step=0.004)
    # A march misses what it steps over: it may see more than there is, by about the step's share of an edge.
    assert (exact != marched)[above].mean() < 0.005 and above.sum() > 500


def test_rays_that_leave_a_gap_find_the_yarn_beneath():
    """What a march meets is there: it hides a direction, however thin the sliver of yarn."""
    fabric, w, random = load_fabric("gauze"), unit(50.0, 20.0), np.random.default_rng(50)
    field, half = height_field(fabric), 0.5 * (1.0 - fabric.warp.width)
    x, y = (random.integers(0, 2, (2, 20_000)) + random.uniform(-half, half, (2, 20_000))) % 2.0
    sees = [visible(field, a, b, 0.0, UNDER, ray(*w, 0.0)) for a, b in zip(x, y, strict=True)]
    free = leaves(fabric, x, y, np.zeros(len(x)), w)
    assert 0.05 < free.mean() < 0.95 and not (np.array(sees) & ~free).any()
