import math

import numpy as np
import pytest

from pipeline.truth.geometry.first_hit import MISSED, ON_WALL, ON_YARN, first_hit, sinking
from pipeline.truth.geometry.heightfield import GAP, height_field, surface_at
from pipeline.truth.geometry.march import ray
from pipeline.truth.geometry.pieces import reference_plane
from tests.directions import unit
from tests.pipeline.truth.cloths import LOPSIDED, woven
from tests.pipeline.truth.geometry.marches import NEVER, marched
from tests.presets import slow
from weaves.surface import surface_at as oracle

STEP = 0.002


@pytest.mark.parametrize("fabric", [LOPSIDED, woven("silk_charmeuse"), woven("voile")], ids=["narrow", "satin", "open"])
@pytest.mark.parametrize(("degrees", "curvature"), [(20.0, 0.0), slow(55.0, 0.0), slow(80.0, 0.0), (80.0, 0.1)])
def test_first_hits_are_those_of_a_march(fabric, degrees, curvature):
    field = height_field(fabric)
    random = np.random.default_rng(int(degrees))
    x, y = random.random((2, 300)) * np.array(fabric.weave.repeat)[:, None]
    theta, azimuth = math.radians(degrees), random.uniform(0.0, 2.0 * math.pi)
    viewer = ray(math.sin(theta) * math.cos(azimuth), math.sin(theta) * math.sin(azimuth), math.cos(theta), curvature)
    towards, _, _ = sinking(viewer, field.highest, field.highest)
    hits = [first_hit(field, *at, field.highest, towards) for at in zip(x, y, strict=True)]
    what = np.array([hit.what for hit in hits])
    distance = np.array([hit.distance if hit.what != MISSED else NEVER for hit in hits])
    line = towards.dx, towards.dy, towards.rise, towards.bend
    late = marched(fabric, x, y, np.full(300, field.highest), line, STEP, field.lowest) - distance
    # A march steps over slivers of yarn, and finds the rest up to a step too late.
    assert ((late < -1e-6) | (late > STEP + 1e-6)).mean() < 0.01
    assert (what == ON_YARN).mean() > 0.3

    # Where a ray meets a yarn, it is on its surface, and comes from above it.
    for hit in (hit for hit in hits if hit.what == ON_YARN):
        _, _, height, nx, ny, nz, _, _, _ = surface_at(field, hit.x, hit.y, hit.end, hit.pick)
        s = hit.distance
        assert height == pytest.approx(field.highest + s * (towards.rise + 0.5 * towards.bend * s), abs=1e-8)
        slope = (towards.rise + towards.bend * s) * nz + towards.dx * nx + towards.dy * ny
        assert slope < 1e-6


@pytest.mark.parametrize("fabric", [LOPSIDED, woven("denim"), woven("voile")], ids=["narrow", "closed", "open"])
def test_the_reference_plane_is_the_mean_height(fabric):
    ends, picks = fabric.weave.repeat
    x, y = (np.arange(200 * count) / 200 + 0.0025 for count in (ends, picks))
    height = oracle(fabric, *np.meshgrid(x, y)).height
    expected = height[np.isfinite(height)].mean()
    assert reference_plane(height_field(fabric)) == pytest.approx(expected, abs=2e-4)


@pytest.mark.parametrize("fabric", [LOPSIDED, woven("silk_charmeuse"), woven("voile")], ids=["narrow", "satin", "open"])
def test_rays_from_yarn_to_yarn_are_those_of_a_march(fabric):
    """Directions above the tangent plane of points of the cloth, rising and sinking: hits as of a march, to a step."""
    field, random = height_field(fabric), np.random.default_rng(3)
    ends, picks = fabric.weave.repeat
    wrong, met, rising = 0, 0, 0
    for _ in range(200):
        x, y = random.random() * ends, random.random() * picks
        family, side, z, nx, ny, nz, _, _, _ = surface_at(field, x, y, int(x), int(y))
        w = random.normal(size=3)
        w /= np.linalg.norm(w)
        w *= math.copysign(1.0, w @ (nx, ny, nz))
        if family == GAP or abs(w[2]) > 0.999 or w @ (nx, ny, nz) < 0.02:
            continue
        towards = ray(*w, 0.0)
        hit = first_hit(field, x, y, z, towards, side)
        s = STEP * np.arange(1, 4000)
        altitude = z + s * towards.rise
        within = (altitude > field.lowest) & (altitude < field.highest)
        below = (oracle(fabric, x + s * towards.dx, y + s * towards.dy).height > altitude) & within
        first = s[np.argmax(below)] if below.any() else NEVER
        distance = hit.distance if hit.what != MISSED else NEVER
        wrong += not -1e-6 <= first - distance <= STEP + 1e-6
        met, rising = met + (hit.what != MISSED), rising + (hit.what != MISSED and w[2] > 0.0)
    assert wrong <= 2 and met > 15 and rising > 5


@pytest.mark.parametrize("fabric", [LOPSIDED, woven("voile"), woven("satin_8")], ids=["narrow", "open", "closed"])
def test_a_ray_that_ends_on_a_wall_names_the_yarn_whose_wall_it_is(fabric):
    """Its rim lies above the ray; the piece on the other side of the border lies below."""
    field = height_field(fabric)
    random = np.random.default_rng(4)
    walls = 0
    for x, y, azimuth in random.random((900, 3)) * np.array([*fabric.weave.repeat, 2.0 * math.pi]):
        viewer = ray(*unit(65.0, math.degrees(azimuth)), 0.0)
        towards, _, _ = sinking(viewer, field.highest, field.highest)
        hit = first_hit(field, x, y, field.highest, towards)
        if hit.what == ON_WALL:
            walls += 1
            family, _, height, *_ = surface_at(field, hit.x, hit.y, hit.end, hit.pick)
            assert family != GAP
            assert height > field.highest + hit.distance * towards.rise
    assert walls > 10
