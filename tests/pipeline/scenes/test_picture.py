from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest

from pipeline.scenes import bounces
from pipeline.scenes import picture as pictures
from pipeline.scenes.frame import render
from pipeline.scenes.loading import FilmWindow, load
from pipeline.scenes.options import SceneOptions
from pipeline.scenes.picture import TruthAnswers, picture, sharpened, windows
from pipeline.scenes.shade import colours_of, compose
from pipeline.scenes.shipped import SHIPPED
from pipeline.truth.conventions import COMPONENTS
from pipeline.truth.options import TruthOptions

OPTIONS = SceneOptions(variant="scalar_rgb", environment_directions=4)
SIZE = (32, 24)


class Flat:
    """A matte white cloth that lets a quarter of the light through; it says so of the queries that it is asked for."""

    def rows(self, fabric, queries, seed):
        known = np.where(queries.behind, 0.25, np.nan)
        return np.column_stack([np.full((len(known), 4), 0.1), known]).astype(np.float32)

    def transparency(self, fabric, looks, seed):
        return np.full(len(looks.u), 0.25, np.float32)

    def coverage(self, fabric, looks, seed):
        return np.ones(len(looks.u), np.float32)

    def colours(self, fabric, queries, seed):
        return colours_of(fabric, queries).astype(np.float32)


@pytest.fixture(scope="module")
def table():
    return load(SHIPPED["dinner_table"], OPTIONS)


def whole(loaded, answerer=None, threads=1, side=1, layers=False, size=SIZE, seed=0):
    """Return the planes of a whole picture, and the numbers of its queries."""
    found, counts = {}, np.zeros(2, int)
    with ThreadPoolExecutor(threads) as pool:
        for part in picture(loaded, answerer or Flat(), pool, size, 0.0, side, layers, seed):
            left, top, width, height = part.window
            for name, plane in part.planes.items():
                assert plane.shape[:2] == (height, width) and plane.dtype == np.float32
                target = found.setdefault(name, np.full((size[1], size[0], plane.shape[2]), np.nan, np.float32))
                target[top : top + height, left : left + width] = plane
            counts += part.queries, part.fallback
    return found, counts


@pytest.mark.parametrize(("size", "queries"), [((7, 5), 1), ((1024, 1024), 10), ((3000, 2), 800), ((2, 2), 2**21)])
def test_windows_cover_a_picture_once_and_are_small(size, queries):
    count = np.zeros(size[::-1], int)
    for left, top, width, height in windows(size, queries):
        count[top : top + height, left : left + width] += 1
        assert width * height == 1 or width * height * queries <= pictures.QUERIES
    assert (count == 1).all()


def test_windows_and_threads_change_nothing(table, monkeypatch):
    expected, counts = whole(table)
    monkeypatch.setattr(pictures, "QUERIES", 500)
    monkeypatch.setattr(pictures, "CHUNK", 37)
    cut, again = whole(table, threads=3)
    np.testing.assert_allclose(cut["rgb"], expected["rgb"], atol=2e-6)
    assert (counts == again).all() and 0 < counts[1] < counts[0]


def test_one_thread_or_three_give_the_same_bytes_of_a_random_method(table, monkeypatch):
    monkeypatch.setattr(pictures, "CHUNK", 64)
    mc = TruthAnswers(TruthOptions(estimator="mc", relative_error=1.0, min_count=32, max_count=32))
    one, three = (whole(table, mc, threads, size=(16, 12))[0]["rgb"] for threads in (1, 3))
    assert one.tobytes() == three.tobytes()
    assert one.tobytes() != whole(table, mc, seed=1, size=(16, 12))[0]["rgb"].tobytes()


def test_layers_sum_to_the_picture_and_a_window_shows_what_the_whole_frame_shows_there(table):
    expected, layers = whole(table)[0]["rgb"], whole(table, layers=True)[0]
    np.testing.assert_allclose(layers["rgb"], expected, atol=1e-6)
    total = layers["backdrop"] + sum(layers[name] for name in COMPONENTS)
    np.testing.assert_allclose(total, expected, atol=1e-6)
    frame = render(table, 0.0, SIZE)
    for number, gbuffer in enumerate(frame.gbuffers.values(), start=1):
        np.testing.assert_array_equal(layers["fabric"][..., 0] == number, gbuffer.mask)
        np.testing.assert_allclose(layers["uv"].reshape(-1, 2)[gbuffer.pixel, 0], gbuffer.u, rtol=1e-6)
    np.testing.assert_array_equal(layers["cloth"] > 0, layers["fabric"] > 0)
    np.testing.assert_allclose(layers["depth"][..., 0], frame.depth, rtol=1e-6)
    seen = layers["depth"][..., 0] > 0
    np.testing.assert_allclose(np.linalg.norm(layers["normal"][seen], axis=-1), 1.0, atol=1e-5)
    window = FilmWindow(5, 9, 20, 11)
    part, frame = render(table, 1.0, SIZE, window), render(table, 1.0, SIZE)
    cut = slice(9, 20), slice(5, 25)
    np.testing.assert_allclose(part.backdrop, frame.backdrop[cut], atol=1e-6)
    np.testing.assert_allclose(part.depth, frame.depth[cut], atol=1e-5)
    for key, gbuffer in part.gbuffers.items():
        np.testing.assert_array_equal(gbuffer.mask, frame.gbuffers[key].mask[cut])
    # The share of cloth is in ninths with nine rays, and its mean stays: the silhouette is a tenth of the pixels.
    one, nine = (whole(table, side=side, layers=True)[0]["cloth"] for side in (1, 3))
    assert set(np.unique(one)) == {0.0, 1.0}
    np.testing.assert_allclose(9 * nine, np.round(9 * nine), atol=1e-6)
    assert ((nine > 0) & (nine < 1)).mean() > 0.02
    assert nine.mean() == pytest.approx(one.mean(), rel=0.03)


def test_what_comes_through_is_behind_in_the_share_of_transparency_and_of_rims():
    """Drape under an even sky: the transparency is .25 whether a query knows it or a look is asked."""
    drape = load(SHIPPED["drape"], OPTIONS)
    layers, frame = whole(drape, layers=True)[0], render(drape, 0.0, SIZE)
    (gbuffer,) = frame.gbuffers.values()
    behind = frame.backdrop.reshape(-1, 3)[gbuffer.pixel]
    assert behind.min() > 0
    np.testing.assert_allclose(layers["backdrop"].reshape(-1, 3)[gbuffer.pixel], 0.25 * behind, rtol=1e-6)
    # C (L + T background) + (1 - C) background at silhouettes; all else is as before.
    roll = load(SHIPPED["roll"], OPTIONS)
    full, thin = (whole(roll, answerer, layers=True)[0] for answerer in (Flat(), Gauze()))
    (gbuffer,) = render(roll, 0.0, SIZE).gbuffers.values()
    rim = np.zeros(gbuffer.mask.size, bool)
    rim[gbuffer.pixel[gbuffer.rim]] = True
    rim = rim.reshape(gbuffer.mask.shape)
    assert 5 < rim.sum() < 0.5 * gbuffer.mask.sum()
    assert (thin["cloth"][rim] == 0.25).all() and (full["cloth"][rim] == 1).all()
    background = full["backdrop"][rim] / 0.25
    light = full["rgb"][rim] - full["backdrop"][rim]
    expected = 0.25 * (light + 0.25 * background) + 0.75 * background
    np.testing.assert_allclose(thin["rgb"][rim], expected, rtol=1e-5)
    np.testing.assert_array_equal(thin["rgb"][~rim], full["rgb"][~rim])


class Gauze(Flat):
    """The same, of which a rim covers a quarter."""

    def coverage(self, fabric, looks, seed):
        return np.full(len(looks.u), 0.25, np.float32)


@pytest.mark.parametrize("side", [2, 3, 8])
def test_the_footprints_of_a_pixels_rays_have_the_variance_of_one(table, side):
    """In pixels: the variance of the rays' places and that of each footprint sum to pixel_sigma^2."""
    places = (np.arange(side) + 0.5) / side - 0.5
    own = sharpened(table, side).options.pixel_sigma / side
    assert np.square(places).mean() + own**2 == pytest.approx(OPTIONS.pixel_sigma**2)
    assert sharpened(table, 1).options.pixel_sigma == OPTIONS.pixel_sigma


def test_all_bounces_add_the_light_of_the_table_to_what_faces_the_lamp(table):
    """The layers of the diffuse light, each by its family; gaps, highlights and what is no cloth stay as they were."""
    once = replace(table, options=OPTIONS.model_copy(update={"bounces": 1}))
    one, more = (whole(loaded, layers=True)[0] for loaded in (once, table))
    added = dict.fromkeys(COMPONENTS[2:], np.zeros(one["rgb"].shape))
    for key, gbuffer in render(table, 0.0, SIZE).gbuffers.items():
        fabric = table.cloths[key][1]
        queries = gbuffer.queries(fabric.repeat)
        light = bounces.later_bounces(fabric, queries, colours_of(fabric, queries))
        for family, name in enumerate(COMPONENTS[2:]):
            added[name] = added[name] + compose(gbuffer, light[:, family])
    for name in ("backdrop", *COMPONENTS, "rgb"):
        wanted = added.get(name, sum(added.values()) if name == "rgb" else 0.0)
        np.testing.assert_allclose(more[name] - one[name], wanted, rtol=1e-4, atol=1e-6, err_msg=name)
    assert min(light.max() for light in added.values()) > 1e-3
    np.testing.assert_allclose(whole(table)[0]["rgb"], more["rgb"], atol=1e-6)
