import numpy as np
import pytest

from reports.images.tiles import write_film


def gradient(frame):
    """Return a grey picture that gets brighter with the frames."""
    return np.full((24, 32, 3), 60 + 20 * frame, np.uint8)


def test_a_film_has_its_frames_and_their_colours(tmp_path):
    """H.264 keeps flat grey to 2 codes of 255."""
    av = pytest.importorskip("av")
    for name in ("a.mp4", "b.mp4"):
        write_film(tmp_path / name, map(gradient, range(5)), (32, 24))
    with av.open(str(tmp_path / "a.mp4")) as film:
        shown = [frame.to_ndarray(format="rgb24") for frame in film.decode(video=0)]
    assert len(shown) == 5
    for index, frame in enumerate(shown):
        assert frame.shape == (24, 32, 3)
        np.testing.assert_allclose(frame.astype(int), gradient(index).astype(int), atol=2)
    assert (tmp_path / "a.mp4").read_bytes() == (tmp_path / "b.mp4").read_bytes()


def test_a_film_that_fails_leaves_the_one_before(tmp_path):
    pytest.importorskip("av")

    def frames():
        yield gradient(0)
        raise KeyboardInterrupt

    (tmp_path / "a.mp4").write_bytes(b"before")
    with pytest.raises(KeyboardInterrupt):
        write_film(tmp_path / "a.mp4", frames(), (32, 24))
    assert [path.name for path in tmp_path.iterdir()] == ["a.mp4"] and (tmp_path / "a.mp4").read_bytes() == b"before"
