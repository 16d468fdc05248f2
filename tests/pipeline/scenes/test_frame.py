import math

import numpy as np
import pytest

from pipeline.scenes.frame import render
from pipeline.scenes.loading import load
from pipeline.scenes.options import SceneOptions
from pipeline.scenes.scene import Cloth, Scene
from pipeline.scenes.shipped import SHIPPED, developed, sheet
from pipeline.scenes.variant import llvm_works
from pipeline.truth.query import faults
from tests.pipeline.scenes.test_gbuffer import covariance

SCALAR = SceneOptions(variant="scalar_rgb", environment_directions=64)
SIZE = (64, 48)
WEARS = {"type": "diffuse", "id": "fabric_denim"}
SUN = {"type": "directional", "direction": [0.3, 0.2, -1.0]}


def framed(parts, eye=(0.0, -3.0, 2.0), camera=None, cloth=None, frame=0.0, options=SCALAR):
    """Return a frame of the cloth `denim` in a scene of some parts, given as a function of mitsuba."""

    def build(mi):
        look = mi.ScalarTransform4f().look_at(list(eye), [0, 0, 0], [0, 0, 1])
        sensor = {"type": "perspective", "fov": 40, "fov_axis": "x", "to_world": look}
        film = {"type": "hdrfilm", "width": SIZE[0], "height": SIZE[1]}
        return {"type": "scene", "camera": {**(camera(mi) if camera else sensor), "film": film}, **parts(mi)}

    scene = Scene(name="test", source=build, cloths={"denim": cloth or Cloth()}, step=(0.1, 0.0, 0.0))
    return render(load(scene, options), frame)


def shot(parts, **choices):
    return framed(parts, **choices).gbuffers["denim"]


def floor(mi):
    """Return a floor 8 wide and 4 deep around the origin, lit by the sun."""
    return {"floor": {"type": "rectangle", "to_world": mi.ScalarTransform4f().scale([4, 2, 1]), "b": WEARS}, "s": SUN}


def rays(x, y, eye=(0.0, -3.0, 2.0)):
    """Return the directions of the test camera's rays at positions in pixels, y downwards, by its definition."""
    forward = -np.array(eye) / np.linalg.norm(eye)
    right = np.cross(forward, [0, 0, 1]) / np.linalg.norm(np.cross(forward, [0, 0, 1]))
    up = np.cross(right, forward)
    half = math.tan(math.radians(20))
    across, down = (x / SIZE[0] - 0.5) * 2 * half, (y - SIZE[1] / 2) / SIZE[0] * 2 * half
    return forward + across[..., None] * right - down[..., None] * up


def on_floor(x, y):
    eye, ray = np.array([0.0, -3.0, 2.0]), rays(x, y)
    return eye + ray * (-eye[2] / ray[..., 2])[..., None]


def parallel(eye, size=1.0, up=(0, 0, 1)):

    def camera(mi):
        look = mi.ScalarTransform4f().look_at(list(eye), [0, 0, 0], list(up))
        return {"type": "orthographic", "to_world": look @ mi.ScalarTransform4f().scale([size, size, 1])}

    return camera


RADIUS, SPACING = 0.7, 0.05


def tube(mi):
    """Return a tube of RADIUS along x, lit by the sun; its cloth has yarns SPACING apart."""
    shape = {"type": "cylinder", "p0": [-2, 0, 0], "p1": [2, 0, 0], "radius": RADIUS}
    return {"tube": {**shape, "b": WEARS}, "s": SUN}


def on_tube(turn=0.0):
    return Cloth(yarns=(2 * math.pi * RADIUS / SPACING, 4 / SPACING), turn=turn)


def pixels(gbuffer):
    row, column = np.divmod(gbuffer.pixel, gbuffer.mask.shape[1])
    return column + 0.5, row + 0.5


def test_a_plane_agrees_with_its_rays():
    """Positions, directions and footprints of a floor, the ellipse by differences of the closed form. Mitsuba reckons
    in single precision: 1e-5 of the floor's size for positions, 1e-3 for its differences over a pixel to the right and
    one downwards; in this small picture the far edge's derivative differs from those by 7 %."""
    turn, yarns = 30.0, (80.0, 60.0)
    gbuffer = shot(floor, cloth=Cloth(yarns=yarns, turn=turn))
    x, y = pixels(gbuffer)
    cosine, sine = math.cos(math.radians(turn)), math.sin(math.radians(turn))
    matrix = np.array([[cosine, sine], [-sine, cosine]]) @ np.diag([yarns[0] / 8, yarns[1] / 4])

    def uv(x, y):
        return (on_floor(x, y)[..., :2] + [4, 2]) @ matrix.T

    assert len(gbuffer.pixel) > 1500
    np.testing.assert_allclose(np.stack([gbuffer.u, gbuffer.v], -1), uv(x, y), atol=1e-5 * 80)
    wo = np.array([0.0, -3.0, 2.0]) - on_floor(x, y)
    wo /= np.linalg.norm(wo, axis=-1, keepdims=True)
    frame = np.array([[cosine, sine, 0], [-sine, cosine, 0], [0, 0, 1]])
    np.testing.assert_allclose(gbuffer.wo, wo @ frame.T, atol=1e-5)
    sun = -np.array(SUN["direction"]) / np.linalg.norm(SUN["direction"])
    np.testing.assert_allclose(gbuffer.wi, np.tile(frame @ sun, (len(x), 1)), atol=1e-5)
    assert gbuffer.irradiance == pytest.approx(1.0)
    assert (gbuffer.curvature == 0).all()

    # The covariance of the ellipse is pixel_sigma^2 J J^T, whatever its axes are called.
    ours = covariance(gbuffer)
    centre, h = uv(x, y), 1e-3
    step = np.stack([uv(x + 1, y) - centre, uv(x, y + 1) - centre], axis=-1)
    slope = np.stack([uv(x + h, y) - uv(x - h, y), uv(x, y + h) - uv(x, y - h)], axis=-1) / (2 * h)
    for jacobian, allowed in ((step, 1e-3), (slope, 0.07)):
        expected = 0.25 * jacobian @ np.swapaxes(jacobian, 1, 2)
        size = np.abs(expected).max(axis=(1, 2))
        assert (np.abs(ours - expected).max(axis=(1, 2)) / size).max() < allowed
    assert (gbuffer.sigma >= gbuffer.sigma_minor).all()


@pytest.mark.parametrize(("turn", "askew"), [(0.0, 0.0), (0.0, 0.8), (35.0, 0.8), (0.0, 12.0)])
def test_a_cylinders_curvature_is_eulers(turn, askew):
    """Spacing over radius straight across, 0 along the axis, Euler's in between; parallel rays from askew."""
    towards = np.array([askew, -1.0, 0.6]) / np.linalg.norm([askew, -1.0, 0.6])
    gbuffer = shot(tube, camera=parallel((3 * towards).tolist()), cloth=on_tube(turn))
    # In the local frame the circumference runs along u, which the turn takes to (cos, -sin).
    along = np.arctan2(gbuffer.wo[:, 1], gbuffer.wo[:, 0]) + math.radians(turn)
    sure = (gbuffer.wo[:, 2] > 0.04) & (gbuffer.wo[:, 2] < 0.999)
    expected = SPACING / RADIUS * np.cos(along) ** 2
    assert sure.sum() > 400
    if askew == 0.0:
        assert expected[sure] == pytest.approx(SPACING / RADIUS, rel=1e-4)
    # Less than 1e-4 counts as flat.
    assert gbuffer.curvature[sure & (expected < 0.9e-4)] == pytest.approx(0.0)
    sure &= expected > 1.1e-4
    np.testing.assert_allclose(gbuffer.curvature[sure], expected[sure], atol=2e-4 * SPACING / RADIUS)


@pytest.mark.parametrize("wall", [False, True])
def test_the_rim_of_a_tube_is_seen_against_what_is_no_cloth(wall):
    """Rays may leave again up to tan^2 = 8 kappa; where cloth is behind, none is asked."""

    def parts(mi):
        behind = mi.ScalarTransform4f().translate([0, 2, 1]).rotate([1, 0, 0], 90)
        board = {"type": "rectangle", "to_world": behind, "b": {**WEARS, "id": "fabric_gauze"}}
        return tube(mi) | ({"board": board} if wall else {})

    gbuffer = shot(parts, camera=parallel((0, -3, 0)), cloth=on_tube())
    _, row = pixels(gbuffer)
    height = (SIZE[1] / 2 - row) * 2 / SIZE[0]  # the film is two wide
    cosine = np.sqrt(np.clip(1 - (height / RADIUS) ** 2, 0, 1))
    slope = cosine / np.maximum(np.abs(height) / RADIUS, 1e-12)
    expected = (np.abs(height) < RADIUS - 1e-3) & (slope**2 < 8 * SPACING / RADIUS)
    if wall:  # it reaches down to the axis
        expected &= height < 0
    sure = np.abs(slope**2 - 8 * SPACING / RADIUS) > 0.01
    asked = np.zeros(len(row), bool)
    asked[gbuffer.rim] = True
    assert (asked[sure] == expected[sure]).all() and asked.sum() > 100
    np.testing.assert_allclose(gbuffer.rim_wo[:, 2], cosine[gbuffer.rim], atol=2e-3)


@pytest.mark.parametrize(("curvature", "rims"), [("at_point", True), ("minimum", False)])
def test_the_end_of_a_bend_is_no_silhouette(curvature, rims):
    """A quarter of a tube that goes over into a plane: by its curvature alone rays would leave the last of the tube.
    The camera looks slightly down on the plane, so every ray sinks into it; it is too short to be met by those rays."""
    radius, camera = 0.4, parallel((0, -3, 0.03), 0.1)

    def parts(mi):
        turn = np.linspace(-math.pi / 2, 0, 201)
        y, z = np.append(radius * np.sin(turn), 0.3), np.append(radius * np.cos(turn) - radius, 0.0)
        length, _ = developed(np.stack([y, z], axis=-1))
        tilt = np.append(turn, 0.0)
        x = np.linspace(-1, 1, 3)
        points = np.stack(np.broadcast_arrays(x, y[:, None], z[:, None]), axis=-1)
        normal = np.stack([0 * tilt, np.sin(tilt), np.cos(tilt)], axis=-1)[:, None]
        uv = np.stack(np.broadcast_arrays(x, length[:, None]), axis=-1)
        return {"bend": sheet(mi, "denim", points, np.broadcast_to(normal, points.shape), uv), "s": SUN}

    options = SCALAR.model_copy(update={"curvature": curvature})
    gbuffer = shot(parts, camera=camera, cloth=Cloth(yarns=(1 / SPACING, 1 / SPACING)), options=options)
    assert gbuffer.curvature.max() == pytest.approx(SPACING / radius, rel=0.02)
    low = gbuffer.rim_wo[:, 2] < 0.2
    assert low.sum() > 60 if rims else not low.any()


def test_a_hollow_is_flat_left_handed_coordinates_show_the_front_and_frames_move_the_camera():
    dome = {"type": "cylinder", "p0": [-1, 0, 0], "p1": [1, 0, 0], "flip_normals": True, "b": WEARS}
    gbuffer = shot(lambda mi: {"dome": dome, "s": SUN}, eye=(-4, -1.5, 1.5), cloth=Cloth(yarns=(300, 300)))
    # Through the open end the inside is seen, which is the front; from outside, the back.
    assert (gbuffer.wo[:, 2] > 0).sum() > 100 and (gbuffer.wo[:, 2] < 0).sum() > 100
    assert (gbuffer.curvature == 0).all()
    # Mitsuba's sphere counts v from the pole downwards, so v is counted backwards: u to the right, v upwards.
    ball = {"type": "sphere", "b": WEARS}
    gbuffer = shot(lambda mi: {"ball": ball, "s": SUN}, eye=(0, -4, 0), cloth=Cloth(yarns=(200, 100)))
    assert (gbuffer.wo[:, 2] > 0).all()
    plane = np.full((2, SIZE[1], SIZE[0]), np.nan)
    plane[:, gbuffer.mask] = gbuffer.u, gbuffer.v
    centre = plane[:, 22:27, 30:35]
    assert (np.diff(centre[0], axis=1) > 0).all() and (np.diff(centre[1], axis=0) < 0).all()
    assert np.linalg.norm(gbuffer.wi, axis=1) == pytest.approx(1.0, abs=1e-6)
    # A camera 0.4 further right sees a place of the floor that lies 0.4 further along x.
    still, moved = shot(floor), shot(floor, frame=4.0)
    shared = np.intersect1d(still.pixel, moved.pixel)
    u = [gbuffer.u[np.searchsorted(gbuffer.pixel, shared)] for gbuffer in (still, moved)]
    assert u[1] - u[0] == pytest.approx(0.4 * 100 / 8, abs=1e-3)


def test_a_blocker_throws_its_shadow_and_those_of_an_even_sky_are_soft():
    """A square of side 1 at height 1/2 under a slanting sun hides the square of floor behind it, to the pixel."""

    def parts(mi):
        board = mi.ScalarTransform4f().translate([0.2, 0.3, 0.5]).scale(0.5)
        return {**floor(mi), "board": {"type": "rectangle", "to_world": board}}

    gbuffer = shot(parts)
    x, y = pixels(gbuffer)
    place = on_floor(x, y)[:, :2]
    # A ray from the floor to the sun crosses z = 1/2 here.
    crossing = place + 0.5 * -np.array(SUN["direction"][:2])
    distance = np.abs(crossing - [0.2, 0.3]).max(axis=1) - 0.5
    lit = np.zeros(len(place), bool)
    lit[gbuffer.place] = True
    clear = np.abs(distance) > 1e-3
    assert (lit[clear] == (distance > 0)[clear]).all()
    assert 50 < (~lit).sum() < len(lit) / 2

    # A wall of height 1 along x = 0 takes (1 - x / sqrt(x^2 + 1)) / 2 of the sky's irradiance pi. One shadow ray
    # to each of 64 directions would be off by .085 rms.
    def walled(mi):
        upright = mi.ScalarTransform4f().rotate([0, 1, 0], 90).scale([1, 99, 1])
        wall = {"type": "rectangle", "to_world": upright, "paint": {"type": "diffuse"}}
        return {**floor(mi), "wall": wall, "s": {"type": "constant", "radiance": 1.0}}

    gbuffer = shot(walled, eye=(1.5, -1.0, 3.0))
    total, above = np.zeros(len(gbuffer.pixel)), gbuffer.wi[:, 2] > 0
    np.add.at(total, gbuffer.place[above], gbuffer.wi[above, 2] * gbuffer.irradiance[above, 0])
    x = gbuffer.u / 100 * 8 - 4
    chosen = x > 0.05
    expected = math.pi * (1 + x / np.hypot(x, 1)) / 2
    assert chosen.sum() > 1000 and x[chosen].max() > 1.0
    assert np.sqrt(np.mean(np.square(total - expected)[chosen])) < 0.05


def test_a_backdrop_is_matte_and_the_shadow_of_the_cloth_is_not_seen_behind_it():
    """albedo / pi times 2 cos 45; the cloth lies 1/2 above the floor, its shadow 1/2 to the left."""

    def parts(mi):
        move = mi.ScalarTransform4f
        matte = {"type": "diffuse", "reflectance": {"type": "rgb", "value": [0.2, 0.4, 0.6]}}
        return {
            "floor": {"type": "rectangle", "to_world": move().scale(1.25), "matte": matte},
            "cloth": {"type": "rectangle", "to_world": move().translate([0, 0, 0.5]).scale(0.5), "b": WEARS},
            "sun": {"type": "directional", "direction": [-1, 0, -1], "irradiance": 2.0},
            "sky": {"type": "constant", "radiance": 0.0},
        }

    frame = framed(parts, camera=parallel((0, 0, 5), 2.0, (0, 1, 0)))
    x, y = np.meshgrid((np.arange(SIZE[0]) + 0.5) / 16 - 2, 1.5 - (np.arange(SIZE[1]) + 0.5) / 16)
    cloth, floor = (np.maximum(np.abs(x), np.abs(y)) < side for side in (0.5, 1.25))
    assert (frame.gbuffers["denim"].mask == cloth).all()
    shadow = (np.abs(x + 0.5) < 0.5) & (np.abs(y) < 0.5) & ~cloth
    assert shadow.sum() == 128
    lit = np.array([0.2, 0.4, 0.6]) * 2 * math.cos(math.pi / 4) / math.pi
    np.testing.assert_allclose(frame.backdrop, np.where((floor & ~shadow)[..., None], lit, 0.0), rtol=1e-5, atol=1e-12)


def test_point_lights_fall_off_with_the_square_and_an_even_sky_lights_both_sides_with_pi():
    lamp = {"type": "point", "position": [0.5, 0, 2], "intensity": {"type": "rgb", "value": [1, 2, 3]}}
    gbuffer = shot(lambda mi: {**floor(mi), "s": lamp})
    x, y = pixels(gbuffer)
    towards = np.array([0.5, 0, 2]) - on_floor(x, y)[gbuffer.place]
    square = np.square(towards).sum(axis=1)
    np.testing.assert_allclose(gbuffer.irradiance, np.outer(1 / square, [1, 2, 3]), rtol=1e-4)
    np.testing.assert_allclose(gbuffer.wi, towards / np.sqrt(square)[:, None], atol=1e-5)
    # Irradiance of a hemisphere of radiance 1 is pi; the lattice of 64 directions is allowed 2 %.
    gbuffer = shot(lambda mi: {**floor(mi), "s": {"type": "constant", "radiance": 1.0}})
    cosine = gbuffer.wi[:, 2:] * gbuffer.irradiance
    for side in (1, -1):
        total = np.zeros(len(gbuffer.pixel))
        chosen = side * gbuffer.wi[:, 2] > 0
        np.add.at(total, gbuffer.place[chosen], np.abs(cosine[chosen, 0]))
        assert total == pytest.approx(math.pi, rel=0.02)
    assert (gbuffer.wo[:, 2] > 0).all()
    assert not faults(gbuffer.queries((4, 4)))


@pytest.mark.external
@pytest.mark.skipif(not llvm_works(), reason="no LLVM that Mitsuba can use")
def test_variants_agree():
    """A table with four cloths, other shapes and a point light, which is made in another order than it is shown."""

    def in_variants(name):
        options = SCALAR, SCALAR.model_copy(update={"variant": "llvm_ad_rgb"})
        return [render(load(SHIPPED[name], o), size=SIZE).gbuffers for o in options]

    scalar, vector = in_variants("dinner_table")
    for key, ours in scalar.items():
        assert (ours.mask == vector[key].mask).mean() > 0.999 and ours.mask.any(), key
        np.testing.assert_allclose(ours.irradiance.sum(axis=0), vector[key].irradiance.sum(axis=0), rtol=2e-3)
    ours, other = (gbuffers["silk_charmeuse"] for gbuffers in in_variants("sphere"))
    assert (ours.pixel == other.pixel).all()
    for name in ("u", "v", "sigma", "sigma_minor", "wo", "curvature"):
        # Places on the edge of two triangles may fall to either.
        assert np.isclose(getattr(ours, name), getattr(other, name), rtol=1e-3, atol=1e-4).mean() > 0.99, name
    assert abs(len(ours.place) - len(other.place)) < 0.002 * len(ours.place)
