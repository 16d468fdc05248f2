import numpy as np
import pytest

from reports.images.exr import RGB, read_exr, write_exr
from reports.images.film import film, frame_layers

FRAMES = np.random.default_rng(3).random((4, 6, 8, 3)) * [0.01, 1.0, 30.0]


def write(path, picture, layers=None):
    """Write a picture, and the layers of its other frames as float16."""
    layers = layers or {}
    write_exr(path, {name: picture[..., i] for i, name in enumerate(RGB)} | layers, {}, half=layers)


def test_frames_come_back_from_one_file(tmp_path):
    """The first frame in single precision, the others in float16: to half its last bit, or half its smallest number."""
    write(tmp_path / "film.exr", FRAMES[0], frame_layers(FRAMES))
    exr = read_exr(tmp_path / "film.exr")
    assert film(exr).shape == FRAMES.shape
    assert film(exr)[0] == pytest.approx(FRAMES[0], rel=2.0**-24)
    assert film(exr) == pytest.approx(FRAMES, rel=2.0**-11, abs=2.0**-25)
    assert exr.stack("R", "G", "B") == pytest.approx(FRAMES[0], rel=2.0**-24)


def test_a_picture_without_layers_is_a_film_of_one_frame(tmp_path):
    write(tmp_path / "one.exr", FRAMES[0])
    assert film(read_exr(tmp_path / "one.exr")).shape == (1, 6, 8, 3)


def test_float16_takes_less_room(tmp_path):
    for name, layers in (("one", FRAMES[:1]), ("four", FRAMES)):
        big = np.repeat(np.repeat(layers, 8, axis=1), 8, axis=2) + np.random.default_rng(1).random((48, 64, 3))
        write(tmp_path / f"{name}.exr", big[0], frame_layers(big))
    one, four = ((tmp_path / f"{name}.exr").stat().st_size for name in ("one", "four"))
    assert four < 2.6 * one  # 1 + 3 / 2, and no more than that
