import io

import matplotlib.image
import numpy as np
import pytest

from reports.images import draft, tiles
from reports.images.exr import Exr
from reports.images.tiles import displayed, encoded
from weaves.colour import EXPOSURE
from weaves.draft import Draft, Matrix
from weaves.fabric import load_fabric

SIDE = draft.LARGEST_CELL


def decoded(png):
    return np.rint(255 * matplotlib.image.imread(io.BytesIO(png), format="png")).astype(int)


def exr(rgb, alpha):
    rgb = np.asarray(rgb, np.float32)
    return Exr({**{c: rgb[..., i] for i, c in enumerate("RGB")}, "A": np.asarray(alpha, np.float32)}, {})


def test_tones_are_those_of_the_page_or_of_reinhard_and_a_difference_is_blue_where_dark():
    """Linear .21404 is sRGB 127.5/255 by IEC 61966-2-1; 0 stays 0, what is too bright is cut, no cloth is clear."""
    linear = np.array([[[0.21404 / EXPOSURE] * 3, [0.0] * 3, [9.0] * 3, [1.0] * 3]])
    shown = decoded(tiles.picture(exr(linear, [[1, 1, 1, 0]])))[0, :: tiles.SCALE]
    assert shown[0, :3].tolist() in ([127] * 3, [128] * 3) and shown[1].tolist() == [0, 0, 0, 255]
    assert shown[2].tolist() == [255, 255, 255, 255] and shown[3].tolist() == [0, 0, 0, 0]
    truth = exr(np.full((1, 4, 3), 0.5), [[1, 1, 1, 0]])
    shown = exr(np.array([[[0.5] * 3, [0.2] * 3, [0.9] * 3, [5.0] * 3]]), [[1, 1, 1, 0]])
    same, dark, bright, outside = decoded(tiles.difference(shown, truth))[0, :: tiles.SCALE]
    assert np.ptp(same[:3]) < 4 and dark[2] > dark[0] and bright[0] > bright[2] and outside[3] == 0
    # Grey of luminance L becomes L / (1 + L): 1 becomes a half, and no grey becomes 1.
    linear = np.linspace(0.0, 1.0, 60).reshape(4, 5, 3)
    np.testing.assert_array_equal(displayed(linear), encoded(EXPOSURE * linear))
    grey = np.array([1.0, 1.0, 1.0]) / EXPOSURE
    np.testing.assert_array_equal(displayed(grey, "reinhard"), encoded(np.full(3, 0.5)))
    bright = displayed(1e3 * grey, "reinhard", -3.0), displayed(1e3 * grey, "srgb", -3.0)
    assert bright[0].max() < 255 == bright[1].max()


def centres(pixels, rows, columns, top=0, left=0):
    """Return the colours in the middle of cells of so many pixels, (rows, columns, 3)."""
    found = pixels[(top + np.arange(rows)) * SIDE + SIDE // 2]
    return found[:, (left + np.arange(columns)) * SIDE + SIDE // 2, :3]


def test_a_draft_shows_the_loom_in_the_colours_of_the_threads_and_the_largest_one_fits():
    """Threading, tie-up and treadling, read from the picture, lift what the drawdown shows; first end left, below."""
    fabric = load_fabric("houndstooth")
    pixels, count = decoded(draft.draft(fabric)), 16
    shafts = treadles = 4
    assert pixels.shape[:2] == ((count + 4 + 3) * SIDE + 1,) * 2
    dark = [centres(pixels, *place).max(axis=-1) < 100 for place in (
        (shafts, count, 2, 0), (shafts, treadles, 2, count + 1), (count, treadles, shafts + 3, count + 1),
        (1, count), (count, 1, shafts + 3, count + treadles + 2), (count, count, shafts + 3, 0),
    )]  # fmt: skip
    threading, tie_up, treadling, warp, weft, cells = (part.astype(int) for part in dark)
    lifted = treadling @ tie_up.T @ threading > 0
    assert (lifted[::-1] == np.tile(fabric.weave.warp_over, (4, 4))).all()
    assert (cells == np.where(lifted, warp, weft)).all() and warp[0].tolist() == [1, 1, 1, 1, 0, 0, 0, 0] * 2
    # In a draft of one colour, lines run along the thread on top; 256 ends and shafts are three pixels each.
    plain = load_fabric("voile")
    white = plain.model_copy(update={"warp": plain.weft})
    pixels = decoded(draft.drawdown(white))[..., 0]
    side = draft.MOST_SHOWN // draft.LEAST_SHOWN
    lines = pixels[::side, side // 2 :: side] < pixels[side // 2, side // 2]  # above each cell
    over = np.tile(white.weave.warp_over, (8, 8))[::-1]
    assert (lines[1:-1] == (~over[1:] | ~over[:-1])).all()
    over = np.random.default_rng(1).random((256, 256)) < 0.5
    large = plain.model_copy(update={"draft": Matrix(rows=tuple(Draft(over).rows()))})
    assert decoded(draft.draft(large)).shape[:2] == ((2 * 256 + 3) * 3 + 1,) * 2


@pytest.mark.parametrize("draw", [tiles.height, tiles.normals])
def test_maps_repeat_with_the_weave(draw):
    fabric = load_fabric("denim")
    picture = decoded(draw(fabric))
    ends, side = fabric.weave.repeat[0] * tiles.CELL_PIXELS, tiles.CELLS * tiles.CELL_PIXELS
    assert picture.shape[:2] == (side, side) and (picture[:, : side - ends] == picture[:, ends:]).all()
    assert np.ptp(picture[..., :3]) > 50
    assert draw is tiles.height or picture[..., 2].min() >= 127, "normals point up in blue"


@pytest.mark.parametrize("tone", ["srgb", "reinhard"])
def test_a_stop_doubles_the_light(tone):
    linear = np.geomspace(1e-3, 0.4, 30).reshape(10, 3)
    for stops in (1.0, -2.0):
        np.testing.assert_array_equal(displayed(linear, tone, stops), displayed(2.0**stops * linear, tone))
