import math

import numpy as np
import pytest

from pipeline.analytic.coverage import quick_coverage
from pipeline.truth.geometry.heightfield import height_field
from pipeline.truth.geometry.opacity import coverage
from pipeline.truth.options import TruthOptions
from pipeline.truth.query import Queries
from tests.pipeline.truth.cloths import CORDUROY
from tests.presets import PRESETS
from weaves.fabric import load_fabric


def looks(fabric, rows, sigma, curvature, seed=0, depth=0.6):
    """Return looks at random places whose rays sink to at most `depth` of the heights of the yarns."""
    random = np.random.default_rng(seed)
    field = height_field(fabric)
    bend = np.exp(random.uniform(*np.log(curvature), rows))
    slope = random.random(rows) * np.sqrt(2.0 * bend * depth * (field.highest - field.lowest))
    azimuth, flat = 2.0 * math.pi * random.random(rows), 1.0 / np.sqrt(1.0 + slope**2)
    wo = np.stack([flat * np.cos(azimuth), flat * np.sin(azimuth), flat * slope], axis=-1)
    place = random.random((2, rows)) * np.array([[fabric.repeat[0]], [fabric.repeat[1]]])
    size = np.exp(random.uniform(*np.log(sigma), rows))
    return Queries.round(*place, size, wo, wo)._replace(curvature=bend.astype(np.float32))


@pytest.mark.parametrize("name", PRESETS)
def test_few_rays_and_the_table_are_near_the_truth(name):
    """32 rays: a step's share of a square is known to some .05; the table has .03 of interpolation."""
    fabric = load_fabric(name)
    widest = 0.7 * max(fabric.repeat)
    for sigma, allowed in (((0.05, 0.5), 0.05), ((0.5, 2.0), 0.07), ((widest, 2 * widest), 0.05)):
        asked = looks(fabric, 300, sigma, (0.004, 0.5))
        truth, _ = coverage(fabric, asked, TruthOptions(min_count=512, max_count=512), 0)
        errors = quick_coverage(fabric, asked) - truth
        assert 0.1 < truth.mean() < 0.9
        assert np.sqrt((errors**2).mean()) < allowed
        assert abs(errors.mean()) < 0.01


def test_closed_form_along_half_cylinders_and_rows_answered_one_by_one():
    """Along the warps: the share of a period whose height exceeds 1/2 - depth, by rays and by the table. The share is
    an interval, whose two ends lie in two of 32 strata."""
    depth = np.array([0.02, 0.1, 0.3, 0.49])
    share = 2 * np.sqrt(0.25 - (0.5 - depth) ** 2)
    for size, allowed in ((0.29, 2 / 32), (4.0, 0.02)):
        for bend in (1.0, 1 / 16):
            slope = np.sqrt(2 * bend * depth)
            wo = np.stack([0 * slope, slope**0, slope], axis=-1) / np.hypot(1, slope)[:, None]
            column = np.full(len(depth), size)
            asked = Queries.round(0.3 * column, 0 * column, column, wo, wo)
            asked = asked._replace(curvature=np.full(len(depth), bend, np.float32))
            truth, _ = coverage(CORDUROY, asked, TruthOptions(min_count=4096, max_count=4096), 0)
            if size == 4.0:
                np.testing.assert_allclose(truth, share, atol=0.005)
            np.testing.assert_allclose(quick_coverage(CORDUROY, asked), truth, atol=allowed)
    fabric = load_fabric("denim")
    asked = looks(fabric, 40, (0.1, 9.0), (0.01, 1.0))
    assert (quick_coverage(fabric, asked._replace(curvature=np.zeros(40, np.float32))) == 1).all()
    assert (quick_coverage(fabric, asked._replace(wo=asked.wo * np.float32([1, 1, -1]))) == 0).all()
    assert (quick_coverage(fabric, asked._replace(wo=np.tile(np.float32([0.6, 0, 0.8]), (40, 1)))) < 1).sum() == 0
    assert (quick_coverage(fabric, asked._replace(wo=np.tile(np.float32([0, 0, 1]), (40, 1)))) == 1).all()
    fabric = load_fabric("silk_charmeuse")
    asked = looks(fabric, 60, (0.05, 20.0), (0.01, 1.0))
    whole = quick_coverage(fabric, asked)
    parts = [quick_coverage(fabric, asked.take(slice(k, k + 1)))[0] for k in range(60)]
    np.testing.assert_array_equal(whole, np.array(parts))
    assert whole.dtype == np.float32 and (whole >= 0).all() and (whole <= 1).all()
