import math

import numpy as np
import pytest

from pipeline.truth.geometry.heightfield import height_field, surface_at
from pipeline.truth.geometry.march import ray
from pipeline.truth.geometry.visibility import visible
from tests.pipeline.truth.cloths import woven
from weaves.fabric import load_fabric
from weaves.surface import GAP
from weaves.surface import surface_at as oracle

STEP = 0.004


def _marched(fabric, x, y, z, w):
    """Say for each point whether a march in steps of STEP leaves the cloth; all points share the direction w."""
    ends, picks = fabric.weave.repeat
    dx, dy, rise = np.array(w) / math.hypot(w[0], w[1])
    highest, free, left, s = height_field(fabric).highest, np.ones(len(x), bool), np.arange(len(x)), 0.0
    while left.size:
        s += STEP
        point = oracle(fabric, (x[left] + s * dx) % ends, (y[left] + s * dy) % picks)
        altitude = z[left] + s * rise
        hidden = (point.yarn != GAP) & (point.height > altitude + 1e-9)
        free[left[hidden]] = False
        left = left[~hidden & (altitude < highest)]
    return free


@pytest.mark.parametrize(("name", "width"), [("denim", 1.0), ("silk_charmeuse", 1.0), ("basket", 0.8)])
@pytest.mark.parametrize("degrees", [25.0, 55.0, 75.0])
def test_visibility_matches_a_march(name, width, degrees):
    fabric = woven(name, width=width)
    field = height_field(fabric)
    ends, picks = fabric.weave.repeat
    generator = np.random.default_rng(int(degrees))
    x, y = generator.random((2, 1200)) * np.array([[ends], [picks]])
    azimuth = generator.random() * 2 * math.pi
    sine, cosine = math.sin(math.radians(degrees)), math.cos(math.radians(degrees))
    w = (sine * math.cos(azimuth), sine * math.sin(azimuth), cosine)
    points = [surface_at(field, a, b, int(a), int(b)) for a, b in zip(x, y, strict=True)]
    above = np.array([p[0] != GAP and p[3] * w[0] + p[4] * w[1] + p[5] * w[2] > 1e-3 for p in points])
    exact = np.array([visible(field, a, b, p[2], p[1], ray(*w, 0.0)) for a, b, p in zip(x, y, points, strict=True)])
    marched = _marched(fabric, x, y, np.array([p[2] for p in points]), w)
    # A march misses what it steps over: it may see more than there is, by about the step's share of an edge.
    wrong = (exact != marched)[above]
    assert wrong.mean() < 0.005
    assert above.sum() > 500


def test_the_normal_is_always_visible_and_a_crest_sees_the_horizon():
    field = height_field(load_fabric("polyester_lining"))
    point = surface_at(field, 0.3, 0.4, 0, 0)
    assert visible(field, 0.3, 0.4, point[2], point[1], ray(0.0, 0.0, 1.0, 0.0))
    crest = max(((x + 0.5), (y + 0.5)) for x in range(2) for y in range(2) if field.crown[y, x] == field.highest)
    height = surface_at(field, *crest, int(crest[0]), int(crest[1]))[2]
    assert visible(field, *crest, height, 0, ray(math.cos(0.3), math.sin(0.3), 1e-6, 0.0))
