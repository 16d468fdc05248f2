import math
from dataclasses import replace

import numpy as np
import pytest

from pipeline.scenes.options import ViewOptions
from pipeline.scenes.views import HEADING, view
from tests.directions import unit

FLAT = ViewOptions(turn=0.0)


def spread(gbuffer, column):
    """Lay a column over the picture, NaN where nothing is lit."""
    picture = np.full((*gbuffer.lit.shape, *column.shape[1:]), np.nan)
    picture[gbuffer.lit] = column
    return picture


def derivative(gbuffer):
    """Return d(u, v)/d(pixel) of the inner pixels, from central differences."""
    uv = spread(gbuffer, np.stack([gbuffer.u, gbuffer.v], -1))
    return 0.5 * np.stack([uv[1:-1, 2:] - uv[1:-1, :-2], uv[2:, 1:-1] - uv[:-2, 1:-1]], axis=-1)


@pytest.mark.parametrize("scene", ["sphere", "plane"])
def test_directions_are_unit_and_in_front_and_frames_slide_the_cloth_by_less_than_a_pixel(scene):
    gbuffer = view(scene, 64, 48)
    for directions in (gbuffer.wi, gbuffer.wo):
        assert np.linalg.norm(directions, axis=1) == pytest.approx(1.0, abs=1e-12)
        assert (directions[:, 2] > 0).all()
    assert gbuffer.wo[:, 2].min() >= math.cos(math.radians(ViewOptions().largest_angle))
    assert (gbuffer.sigma > 0).all() and not (gbuffer.lit & ~gbuffer.mask).any()
    still, moved = (view(scene, 48, 40, frame=frame, options=FLAT) for frame in (0, 2))
    slide, heading = 2 * FLAT.step / 6, math.radians(HEADING)
    np.testing.assert_allclose(still.u - moved.u, slide * math.cos(heading), rtol=1e-6)
    np.testing.assert_allclose(still.v - moved.v, slide * math.sin(heading), rtol=1e-6)
    assert FLAT.step < 1 and (still.lit == moved.lit).all() and (still.wi == moved.wi).all()


def test_the_centre_of_the_sphere_and_a_turn_of_light_and_coordinates_together():
    """Surface and picture are parallel there: pixels are 1/6 yarn apart, rows count downwards; wi is the light."""
    gbuffer = view("sphere", 129, 129, options=FLAT)
    assert derivative(gbuffer)[63, 63] == pytest.approx(np.diag([1 / 6, -1 / 6]), rel=1e-3, abs=1e-6)
    sigma, wi, wo = (spread(gbuffer, column)[64, 64] for column in (gbuffer.sigma, gbuffer.wi, gbuffer.wo))
    assert sigma == pytest.approx(0.5 / 6, rel=1e-3)
    assert wo == pytest.approx([0, 0, 1], abs=1e-12)
    assert wi == pytest.approx(unit(*FLAT.sphere_light), abs=1e-12)
    # With the weft turned by 90 degrees, x of the local frame points up: (x, y) reads (y, -x) of before.
    straight = view("sphere", 65, 65, options=FLAT)
    turned = view("sphere", 65, 65, options=ViewOptions(turn=90.0))
    assert turned.wi == pytest.approx(np.stack([straight.wi[:, 1], -straight.wi[:, 0], straight.wi[:, 2]], 1))
    columns = np.stack([straight.v, -straight.u, straight.sigma])
    assert np.stack([turned.u, turned.v, turned.sigma]) == pytest.approx(columns)


@pytest.mark.parametrize("scene", ["sphere", "plane"])
@pytest.mark.parametrize("footprint", ["geometric_mean", "major"])
def test_footprint_is_the_finite_difference_of_the_coordinates(scene, footprint):
    """Oracle: J from central differences of u, v between neighbouring pixels, singular values by numpy. Differences
    over two pixels bend away from the derivative by the square of the pixel: 3 % allowed at this size."""
    gbuffer = view(scene, 160, 120, options=ViewOptions(footprint=footprint, largest_sigma=1e6))
    sigma, jacobian = spread(gbuffer, gbuffer.sigma), derivative(gbuffer)
    inner = np.isfinite(jacobian).all(axis=(2, 3))
    inner &= spread(gbuffer, gbuffer.wo[:, 2])[1:-1, 1:-1] > 0.35
    singular = np.linalg.svd(jacobian[inner], compute_uv=False)
    expected = singular[:, 0] if footprint == "major" else np.sqrt(singular.prod(axis=1))
    assert inner.sum() > 3000
    # The map to the sphere is conformal: of a patch's foreshortening only the cosine of the view is left.
    cosine = spread(gbuffer, gbuffer.wo[:, 2])[1:-1, 1:-1][inner]
    assert scene == "plane" or singular[:, 1] / singular[:, 0] == pytest.approx(cosine, rel=0.04)
    assert sigma[1:-1, 1:-1][inner] == pytest.approx(0.5 * expected, rel=0.03)


def test_the_plane_goes_from_resolved_yarns_to_many_repeats_and_ends_with_a_whole_row():
    options = FLAT.model_copy(update={"horizon": 0.1, "largest_sigma": 1e6, "largest_angle": 89.0})
    gbuffer = view("plane", 320, 224, options=options)
    u, sigma = spread(gbuffer, gbuffer.u), spread(gbuffer, gbuffer.sigma)
    assert u[-1, 1:] - u[-1, :-1] == pytest.approx(1 / 6)
    assert sigma[-1].max() < 0.2
    top = np.flatnonzero(gbuffer.lit.any(axis=1))[0]
    assert 88.7 < np.degrees(np.arccos(np.nanmin(spread(gbuffer, gbuffer.wo)[top, :, 2]))) < 89.0
    assert np.nanmin(sigma[top]) > 50
    assert view("plane", 320, 224, options=ViewOptions(largest_sigma=4.0)).sigma.max() == 4.0
    plane = view("plane", 96, 72, options=ViewOptions(largest_angle=80.0))
    assert (plane.mask.any(axis=1) == plane.mask.all(axis=1)).all()
    assert plane.wo[:, 2].min() >= math.cos(math.radians(80.0))
    sphere = view("sphere", 64, 64, options=ViewOptions(sphere_light=(80.0, 0.0)))
    assert sphere.lit.sum() == len(sphere.u) < sphere.mask.sum()


def test_the_plane_camera_sees_along_the_ray_and_queries_are_reduced_in_float64_first():
    """Oracle: the angle of a pixel's view below the horizontal is pitch plus its angle in the picture."""
    gbuffer = view("plane", 101, 81, options=ViewOptions(turn=0.0, horizon=0.1))
    wo = spread(gbuffer, gbuffer.wo)
    focal = 50.5 / math.tan(math.radians(25.0))
    pitch = math.atan(0.4 * 81 / focal)
    for row in (30, 40, 80):
        below = pitch + math.atan((row + 0.5 - 40.5) / focal)
        assert wo[row, 50] == pytest.approx([0, -math.cos(below), math.sin(below)], abs=1e-12)
    # Near the horizon, 1e5 yarns away, float32 would have lost the position within the repeat.
    gbuffer = view("plane", 640, 480, options=ViewOptions(plane_pixels_per_yarn=0.01, largest_angle=89.0))
    assert np.abs(gbuffer.v).max() > 1e5
    queries = gbuffer.queries((3, 8))
    assert queries.u.dtype == queries.wi.dtype == np.float32
    assert queries.u.min() >= 0 and queries.u.max() < 3 and queries.v.min() >= 0 and queries.v.max() < 8
    difference = np.abs(queries.v - np.mod(gbuffer.v, 8))
    assert np.minimum(difference, 8 - difference).max() < 1e-6
    # What rounds up to the repeat becomes its start.
    assert (replace(gbuffer, u=np.full_like(gbuffer.u, -1e-12)).queries((4, 4)).u == 0).all()
