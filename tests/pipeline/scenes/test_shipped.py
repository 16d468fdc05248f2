import numpy as np
import pytest

from pipeline.scenes.frame import render
from pipeline.scenes.loading import FilmWindow, load
from pipeline.scenes.options import SceneOptions
from pipeline.scenes.shipped import SHIPPED
from pipeline.scenes.swatch import Swatch
from pipeline.truth.query import faults

OPTIONS = SceneOptions(variant="scalar_rgb", environment_directions=4, largest_sigma=1e6)
WIDTH = 48


@pytest.fixture(scope="module", params=SHIPPED)
def shown(request):
    loaded = load(SHIPPED[request.param], OPTIONS)
    width, height = loaded.camera.size
    assert (width, height) == ((512, 512) if request.param == "hem" else (256, 192))
    return loaded, *(render(loaded, frame, (WIDTH, WIDTH * height // width)) for frame in (0.0, 1.0, 23.0))


def test_every_fabric_is_seen_and_lit_in_legal_queries_and_frames_move_by_less_than_a_pixel(shown):
    loaded, *frames = shown
    for frame in frames:
        for key, (_, fabric) in loaded.cloths.items():
            gbuffer = frame.gbuffers[key]
            assert len(gbuffer.pixel) > 20 and gbuffer.lit.sum() > 0.5 * len(gbuffer.pixel)
            assert not faults(gbuffer.queries(fabric.weave.repeat))
            assert not faults(gbuffer.looks(fabric.weave.repeat))
            assert (gbuffer.irradiance >= 0).all() and np.isfinite(gbuffer.irradiance).all()
        assert np.isfinite(frame.backdrop).all() and (frame.backdrop >= 0).all()
    # A pixel's new place, measured in the ellipse of its old footprint, in pixels of the full picture. |J^-1 d|
    # is the length of d along the ellipse's axes over its standard deviations, times pixel_sigma. The median
    # bounds the motion; pixels that pass an edge see another fold.
    loaded, first, second, _ = shown
    assert loaded.scene.frames >= 24
    for key in loaded.cloths:
        old, new = first.gbuffers[key], second.gbuffers[key]
        shared, a, b = np.intersect1d(old.pixel, new.pixel, return_indices=True)
        d = np.stack([new.u[b] - old.u[a], new.v[b] - old.v[a]], axis=-1)
        cosine, sine = np.cos(old.angle[a]), np.sin(old.angle[a])
        along, across = d[:, 0] * cosine + d[:, 1] * sine, d[:, 1] * cosine - d[:, 0] * sine
        moved = np.hypot(along / old.sigma[a], across / old.sigma_minor[a])
        moved *= loaded.camera.size[0] / WIDTH * OPTIONS.pixel_sigma
        assert len(shared) > 0.8 * len(old.pixel)
        assert np.median(moved) > 0.05 and np.quantile(moved, 0.9) < 1.0


def test_only_the_curtain_is_lit_from_behind_and_the_roll_and_the_sphere_are_curved(shown):
    loaded, first, *_ = shown
    sun = max(light.power.max() for light in loaded.lights)
    for gbuffer in first.gbuffers.values():
        through = gbuffer.wi[:, 2] * gbuffer.wo[gbuffer.place, 2] < 0.0
        strong = through & (gbuffer.irradiance.max(axis=1) > 0.9 * sun)
        assert (strong.sum() > 0.3 * len(gbuffer.pixel)) == (loaded.scene.name == "curtain")
        # Seen head-on a footprint is round: its axes differ by the cosine of the view at most.
        facing = np.abs(gbuffer.wo[:, 2]) > 0.9
        assert (gbuffer.sigma_minor[facing] / gbuffer.sigma[facing] > 0.85).all()
    # The sphere's conformal spacing is 4 / (4 + u^2 + v^2) / 24; normals of its mesh are interpolated: 1 % allowed.
    for key, gbuffer in first.gbuffers.items():
        largest = {"plane": 0.0, "roll": 2 * np.pi / 128}.get(loaded.scene.name)
        if largest is not None:
            assert gbuffer.curvature.max() == pytest.approx(largest, rel=0.02, abs=1e-6), key
        if loaded.scene.name == "sphere":
            inner = gbuffer.wo[:, 2] > 0.1
            square = (np.square(gbuffer.u) + np.square(gbuffer.v))[inner] / 24**2
            np.testing.assert_allclose(gbuffer.curvature[inner], 4 / (4 + square) / 24, rtol=0.01)


def test_the_swatch_in_closed_form_is_that_of_mitsuba():
    """Places, footprints, directions, light, the board and the cloth's shadow; the mesh bends in 800 steps."""
    size, window = (96, 72), FilmWindow(0, 0, 96, 72)
    scene = SHIPPED["swatch"]
    ours = Swatch(48.0, size).frame(window)
    theirs = render(load(scene, SceneOptions(variant="scalar_rgb")), 0.0, size)
    a, b = ours.gbuffers["swatch"], theirs.gbuffers["swatch"]
    np.testing.assert_array_equal(a.pixel, b.pixel)
    assert not len(b.rim)
    turned = (a.angle - b.angle + np.pi / 2) % np.pi - np.pi / 2
    np.testing.assert_allclose(turned, 0.0, atol=1e-2)
    tolerances = {"sigma": 2e-3, "curvature": 3e-4}
    for name in ("u", "v", "sigma", "sigma_minor", "curvature", "wo", "place", "wi", "irradiance"):
        atol = tolerances.get(name, 1e-4)
        np.testing.assert_allclose(getattr(a, name), getattr(b, name), atol=atol, err_msg=name)
    for name in ("backdrop", "depth", "normal"):
        np.testing.assert_allclose(getattr(ours, name), getattr(theirs, name), atol=1e-4, err_msg=name)
