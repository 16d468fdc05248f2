import numpy as np
import OpenEXR
import pytest

from reports.images.exr import RGB, film, frame_layers, read_exr, write_exr
from tests.refusals import refusal


def test_round_trip_keeps_every_bit_metadata_and_layers(tmp_path):
    """OpenEXR itself writes such arrays wrong without a word; a picture and its transpose, every second column."""
    picture = np.random.default_rng(0).random((33, 50, 3)).astype(np.float32)
    awkward = picture.transpose(1, 0, 2)[:, ::2]
    assert not awkward[..., 0].flags.c_contiguous
    write_exr(tmp_path / "a.exr", {name: awkward[..., i] for i, name in enumerate(("R", "G", "B"))})
    assert (read_exr(tmp_path / "a.exr").stack("R", "G", "B") == awkward).all()
    plane = np.float64([[1.5, -2.0], [np.float32(1e-30), 65504.0]])
    write_exr(tmp_path / "a.exr", {"Y": plane, "error.Y": 0 * plane}, {"fabric": "denim", "frames": 8, "share": 0.5})
    exr = read_exr(tmp_path / "a.exr")
    assert set(exr.channels) == {"Y", "error.Y"} and exr.channels["Y"].dtype == np.float32
    assert exr.channels["Y"] == pytest.approx(plane)
    assert {"fabric": "denim", "frames": 8, "share": 0.5}.items() <= exr.attributes.items()


def test_what_is_no_picture_is_bad_input_and_planes_must_agree(tmp_path):
    path = tmp_path / "a.exr"
    refusal(read_exr, path)
    write_exr(path, {"Y": np.random.default_rng(1).random((64, 64))})
    for content in (path.read_bytes()[:4000], b"", b"not a picture"):
        path.write_bytes(content)
        refusal(read_exr, path)
    with pytest.raises(ValueError, match="one size"):
        write_exr(path, {"R": np.zeros((2, 3)), "G": np.zeros((3, 2))})


FRAMES = np.random.default_rng(3).random((4, 6, 8, 3)) * [0.01, 1.0, 30.0]


def written(path, frames):
    """Write the first frame as a picture, and the others as layers in float16."""
    layers = frame_layers(frames)
    write_exr(path, {name: frames[0, ..., i] for i, name in enumerate(RGB)} | layers, {}, half=layers)
    return path


def test_frames_come_back_from_one_file_in_zip_and_float16_takes_less_room(tmp_path):
    """The first frame in single precision, the others in float16: to half its last bit, or half its smallest number."""
    exr = read_exr(written(tmp_path / "film.exr", FRAMES))
    assert film(exr).shape == FRAMES.shape and film(exr)[0] == pytest.approx(FRAMES[0], rel=2.0**-24)
    assert film(exr) == pytest.approx(FRAMES, rel=2.0**-11, abs=2.0**-25)
    assert film(read_exr(written(tmp_path / "one.exr", FRAMES[:1]))).shape == (1, 6, 8, 3)
    big = FRAMES.repeat(8, axis=1).repeat(8, axis=2) + np.random.default_rng(1).random((4, 48, 64, 3))
    one, four = (written(tmp_path / f"{count}.exr", big[:count]).stat().st_size for count in (1, 4))
    assert four < 2.6 * one  # 1 + 3 / 2, and no more than that
    plane = np.zeros((64, 64))
    paths = tmp_path / "zip" / "a.exr", tmp_path / "zip" / "b.exr"
    for path in paths:
        write_exr(path, {"Y": plane}, {"fabric": "denim"})
    with OpenEXR.File(str(paths[0])) as file:
        assert file.header()["compression"] == OpenEXR.ZIP_COMPRESSION
    assert paths[0].read_bytes() == paths[1].read_bytes() and paths[0].stat().st_size < plane.size
    assert sorted((tmp_path / "zip").iterdir()) == [*paths]
