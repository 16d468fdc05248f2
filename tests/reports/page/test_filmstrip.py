import io

import matplotlib.image
import numpy as np
import pytest

from reports.images import tiles
from reports.page.filmstrip import GAP, Crop, filmstrip, liveliest
from weaves.errors import BadInput

FRAMES = np.linspace(0.0, 0.6, 4 * 12 * 20).reshape(4, 12, 20)


def decoded(png):
    picture = matplotlib.image.imread(io.BytesIO(png), format="png")
    return np.rint(255 * picture).astype(int)[:: tiles.SCALE, :: tiles.SCALE]


def test_every_row_shows_its_frames_cropped_and_alike():
    crop = Crop(top=3, left=5, height=6, width=8)
    shown = decoded(filmstrip({"truth": FRAMES, "points": FRAMES[::-1]}, crop, count=3))
    assert shown.shape == (2 * 6 + GAP, 4 * 8 + 5 * GAP, 4)
    codes = tiles.encoded(tiles.EXPOSURE * FRAMES[:, 3:9, 5:13])
    for row, order in enumerate(((0, 1, 2), (3, 2, 1))):
        line = shown[row * (6 + GAP) :][:6]
        for place, frame in enumerate(order):
            assert (line[:, place * (8 + GAP) :][:, :8, 0] == codes[frame]).all()
        over_time = line[:, -8:, 0]
        assert (over_time == codes[list(order)][[0, 0, 1, 1, 2, 2], 3]).all()
    assert (shown[6 : 6 + GAP, :, 3] == 0).all()


def test_colours_and_short_films_fit_beside_others():
    grey, coloured = FRAMES[:2], np.stack([FRAMES, 0 * FRAMES, FRAMES], axis=-1)
    shown = decoded(filmstrip({"truth": coloured, "points": grey}))
    assert shown.shape == (2 * 12 + GAP, 5 * 20 + 6 * GAP, 4)
    assert (shown[:12, :20, 1] == 0).all()
    assert (shown[:12, :20, 0] == shown[:12, :20, 2]).all()
    assert (shown[12 + GAP :, 3 * 20 + 4 * GAP :, 3] == 0).all()


@pytest.mark.parametrize(
    ("rows", "crop"),
    [
        ({}, None),
        ({"truth": FRAMES, "points": FRAMES[:, 1:]}, None),
        ({"truth": FRAMES[0]}, None),
        ({"truth": FRAMES[:0]}, None),
        ({"truth": FRAMES * np.nan}, None),
        ({"truth": FRAMES}, Crop(8, 0, 6, 6)),
        ({"truth": FRAMES}, Crop(-1, 0, 6, 6)),
        ({"truth": FRAMES}, Crop(0, 0, 0, 6)),
    ],
)
def test_what_cannot_be_shown_is_bad_input(rows, crop):
    with pytest.raises(BadInput, match="strip of frames"):
        filmstrip(rows, crop)


def test_the_liveliest_crop_holds_what_moves():
    """Films stand still but for one patch: the crop contains it, whichever film it is in; small films are whole."""
    still = np.zeros((3, 64, 120, 3))
    moving = still.copy()
    moving[1, 40:52, 70:90] = 0.5
    crop = liveliest({"truth": still, "points": moving}, (16, 32))
    assert crop.height == 16 and crop.width == 32
    assert crop.top <= 40 and crop.top + 16 >= 52 and crop.left <= 70 and crop.left + 32 >= 90
    assert liveliest({"truth": still}, (16, 32)) == Crop(0, 0, 16, 32)
    assert liveliest({"truth": moving}, (100, 200)) == Crop(0, 0, 64, 120)
