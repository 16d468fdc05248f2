import numpy as np
import pytest
from PIL import Image

from pipeline.bsdf.of_fabric import EVEN_SIGMA
from pipeline.scenes.shade import shade
from pipeline.truth.estimator import estimate
from pipeline.truth.options import TruthOptions
from pipeline.truth.query import Queries
from reports.images.photographs import read_photographs, streaks
from tests.refusals import refusal
from weaves.colour import LUMINANCE, encoded
from weaves.fabric import load_fabric

CAMERA, LAMP = np.array([5.0, -12.0, 20.0]), np.array([5.0, 16.0, 12.0])
WIDTH, HEIGHT = 60, 90


def seen(s, t):
    """Return the places on the cloth that a camera, tilted about x, sees at s, t of its picture plane."""
    forward = np.array([0.0, 17.0, -20.0]) / np.hypot(17.0, 20.0)
    ray = forward + s[..., None] * [1.0, 0.0, 0.0] + t[..., None] * np.cross([1.0, 0.0, 0.0], forward)
    return CAMERA - ray * (CAMERA[2] / ray[..., 2:])


def photographed(path, fabric, lamp, bits):
    """Write the picture of a cloth; return the places of its corners."""
    s, t = np.meshgrid((np.arange(WIDTH) + 0.5 - WIDTH / 2) / 150, (HEIGHT / 2 - np.arange(HEIGHT) - 0.5) / 150)
    places = seen(s, t).reshape(-1, 3)
    wi, wo = ((way := point - places) / np.linalg.norm(way, axis=1, keepdims=True) for point in (lamp, CAMERA))
    nothing = np.zeros(len(wi))
    queries = Queries.round(nothing, nothing, nothing + EVEN_SIGMA, wi, wo)
    answers = estimate(fabric, queries, TruthOptions(relative_error=0.02), 1).mean
    light = shade(fabric, answers, queries) @ LUMINANCE / np.square(lamp - places).sum(axis=1)
    codes = np.rint(encoded(0.8 * light / light.max()) * (2**bits - 1)).reshape(HEIGHT, WIDTH)
    Image.fromarray(codes.astype(np.uint8 if bits == 8 else np.uint16)).save(path)
    x, y = WIDTH / 300 * np.array([-1, 1, 1, -1]), HEIGHT / 300 * np.array([-1, -1, 1, 1])
    return seen(x, y)[:, :2].tolist()


def described(folder, kind, lamp, corners, image="a.png"):
    lines = f"[{kind}]", f'image = "{image}"', f"corners = {corners}", f"camera = {CAMERA.tolist()}"
    (path := folder / "p.toml").write_text("\n".join([*lines, f"light = {lamp.tolist()}"]))
    return path


@pytest.mark.parametrize(("kind", "bits"), [("reflection", 8), ("transmission", 16)])
def test_a_cloth_agrees_with_its_own_photograph_and_another_does_not(tmp_path, kind, bits):
    satin, lamp = load_fabric("satin_8"), LAMP * [1, 1, 1 if kind == "reflection" else -1]
    corners = photographed(tmp_path / "a.png", satin, lamp, bits)
    photograph = read_photographs(described(tmp_path, kind, lamp, corners))[kind]
    for same, other in zip(streaks(satin, photograph), streaks(load_fabric("denim"), photograph), strict=True):
        assert same.error < 0.01 < 0.05 < other.error
        assert same.predicted == pytest.approx(same.measured, rel=0.01)


@pytest.mark.parametrize(
    ("kind", "side", "change", "words"),
    [
        ("reflection", -1, {}, "in front of it, z > 0"),
        ("transmission", 1, {}, "behind it, z < 0"),
        ("reflection", 1, {"corners": [[0, 0]] * 4}, "must not lie on one line"),
        ("reflection", 1, {"image": "p.toml"}, "no picture"),
        ("reflection", 1, {"image": "white.png"}, "must be below white"),
    ],
)
def test_bad_files_are_refused_in_one_sentence(tmp_path, kind, side, change, words):
    for name in ("grey", "white"):
        Image.new("RGB", (64, 64), name).save(tmp_path / f"{name}.png")
    given = {"corners": [[0, 0], [1, 0], [1, 1], [0, 1]], "image": "grey.png"} | change
    assert words in refusal(read_photographs, described(tmp_path, kind, LAMP * [1, 1, side], **given))
