import re
import sys
from functools import partial
from unittest.mock import Mock

import matplotlib.image
import numpy as np
import pytest

import jobs.verbs.render
import jobs.verbs.show
import pipeline.scenes.picture
from jobs.cli import main
from pipeline.models.named import named_method
from pipeline.scenes.options import SceneOptions
from pipeline.truth.conventions import COMPONENTS
from pipeline.truth.options import TruthOptions
from reports.images.exr import read_exr
from reports.images.tiles import displayed
from reports.measure.scene.shot import read_shot, shoot
from reports.options import ShotOptions
from weaves.draft import Matrix
from weaves.fabric import load_fabric
from weaves.families import Satin

SMALL = ("--size", "32x24", "--directions", "4")
TINY = ("--size", "16x12", "--directions", "4", "--bounces", "1")
FAST = (*TINY, "--method", "soft_nodes")


@pytest.fixture
def render(twillight):
    return partial(twillight, "render")


def codes_of(path):
    """Return the 8-bit values of a PNG, (H, W, 3); it must be opaque."""
    rgba = np.rint(255 * matplotlib.image.imread(path)).astype(int)
    assert (rgba[..., 3] == 255).all()
    return rgba[..., :3]


@pytest.mark.slow
def test_a_picture_is_the_frame_of_the_benchmark(render, tmp_path):
    """The light of the cloth is the same; the light through it is the fallback's, 1 to 3 % from the truth's: a code.

    Where no light reaches the cloth, the benchmark asks for nothing and shows nothing through it.
    """
    coarse = TruthOptions(relative_error=0.1, min_count=64, max_count=128)
    options = ShotOptions(size=(32, 24), frames=3, options=SceneOptions(environment_directions=4), frame_truth=coarse)
    shoot("dinner_table", options, tmp_path / "shot.npz")
    shot = read_shot(tmp_path / "shot.npz")
    pictures = shot.pictures(shot.answers(named_method("soft_nodes", "render", "--method"), 0))
    code, text, _ = render("dinner_table", "--method", "soft_nodes", "--out", "a.exr", *SMALL)
    assert code == 0 and re.fullmatch(r"a\.exr: 32 x 24, \d+ s; \d+% of the queries by the fallback\n", text)
    layers = read_exr(tmp_path / "a.exr")
    light = sum(layers.stack(*(f"{name}.{channel}" for channel in "RGB")) for name in COMPONENTS)
    np.testing.assert_allclose(light, pictures[0] - shot.base[0], atol=1e-5)
    assert render("dinner_table", "--method", "soft_nodes", "--out", "a.png", *SMALL)[0] == 0
    same = shot.lit[0] | (layers.channels["A"] == 0)
    assert same.mean() > 0.95
    np.testing.assert_allclose(codes_of(tmp_path / "a.png")[same], displayed(pictures[0])[same].astype(int), atol=1)


def test_the_layers_of_an_exr_sum_to_its_colour_and_say_what_they_are(render, tmp_path):
    assert render("dinner_table", "--method", "point_sampled:2", "--out", "a.exr", *TINY)[0] == 0
    exr = read_exr(tmp_path / "a.exr")
    parts = [exr.stack(*(f"{name}.{channel}" for channel in "RGB")) for name in ("backdrop", *COMPONENTS)]
    np.testing.assert_allclose(sum(parts), exr.stack(*"RGB"), atol=1e-6)
    assert all(part.max() > 0 for part in parts)
    assert set(np.unique(exr.channels["fabric.id"])) == {0.0, 1.0, 2.0, 3.0, 4.0}
    np.testing.assert_array_equal(exr.channels["A"] > 0, exr.channels["fabric.id"] > 0)
    assert {"depth.Z", "normal.X", "uv.U", "sigma.major", "sigma.minor"} <= set(exr.channels)
    about = exr.attributes
    assert about["fabrics"] == "1 polyester_lining, 2 basket, 3 silk_charmeuse, 4 denim"
    assert (about["scene"], about["method"], about["samples"]) == ("dinner_table", "point_sampled:2", 1)
    assert str(about["bounces"]) == "1"
    assert about["fallback_share"] == 0 and about["versions"].startswith("truth ")


@pytest.mark.slow
def test_a_swatch_of_a_fabric_is_the_scene_swatch_and_shows_its_repeat(monkeypatch, tmp_path):
    """Tables of light between yarns have fewer walks; a satin of more threads than a swatch has gets more yarns."""
    path = jobs.verbs.show.write_swatch(load_fabric("denim"), tmp_path, (32, 24))
    assert path == tmp_path / "denim-swatch.png"
    drawn = ["render", "swatch", "--fabric", "denim", "--method", "soft_nodes:2", "--size", "32x24"]
    assert main([*drawn, "--out", str(tmp_path / "a.png")]) == 0
    np.testing.assert_allclose(codes_of(path), codes_of(tmp_path / "a.png"), atol=3)
    cloth = codes_of(path)[8:16, 12:20].reshape(-1, 3).mean(axis=0)
    assert cloth[2] > 1.2 * cloth[0]  # denim is blue
    wide = load_fabric("denim").model_copy(update={"name": "wide", "draft": Satin(ends=100, move=3)})
    asked = Mock(return_value=[])
    monkeypatch.setattr(pipeline.scenes.picture.WindowMaker, "made", asked)
    jobs.verbs.show.write_swatch(wide, tmp_path, (32, 24))
    assert asked.call_args.args[0].__self__.yarns == 150.0


def test_swatches_of_many_different_cells_are_made_of_points():
    """Tables grow with the different cells, points do not."""
    rows = tuple("".join("#" if up else "." for up in pick) for pick in np.random.default_rng(1).random((40, 30)) < 0.5)
    many = load_fabric("denim").model_copy(update={"draft": Matrix(family="matrix", rows=rows)})
    names = [jobs.verbs.show.method_of(fabric).name for fabric in (load_fabric("denim"), many)]
    assert names == ["soft_nodes", "point_sampled"]


@pytest.mark.slow
def test_fabrics_replace_those_of_the_cloths_in_their_order(render, tmp_path):
    own, denim = "own.exr", "denim.exr"
    assert render("dinner_table", "--out", own, *SMALL)[0] == 0
    assert render("dinner_table", "--fabric", "denim", "--fabric", "voile", "--out", denim, *SMALL)[0] == 0
    before, after = (read_exr(tmp_path / name) for name in (own, denim))
    assert after.attributes["fabrics"] == "1 denim, 2 voile, 3 silk_charmeuse, 4 denim"
    changed = np.abs(after.stack(*"RGB") - before.stack(*"RGB")).max(axis=-1) > 0
    number = before.channels["fabric.id"]
    assert changed[(number == 1) | (number == 2)].mean() > 0.9 and not changed[(number == 0) | (number > 2)].any()


def test_a_folder_holds_the_frames_and_the_tone_changes_them(render, tmp_path):
    assert render("plane", "--out", "film", "--frames", "2", *FAST)[0] == 0
    assert render("plane", "--out", "one.png", *FAST)[0] == 0
    assert render("plane", "--out", "dark.png", "--exposure", "-1", "--tone", "reinhard", *FAST)[0] == 0
    assert sorted(path.name for path in (tmp_path / "film").iterdir()) == ["frame-0001.png", "frame-0002.png"]
    first, second = ((tmp_path / "film" / f"frame-000{index}.png").read_bytes() for index in (1, 2))
    assert first == (tmp_path / "one.png").read_bytes() != second
    assert codes_of(tmp_path / "dark.png").mean() < codes_of(tmp_path / "one.png").mean()


def test_a_film_has_the_frames_that_are_asked_for_and_needs_its_library(render, refused, tmp_path, monkeypatch):
    av = pytest.importorskip("av")
    assert render("plane", "--out", "a.mp4", "--frames", "3", *FAST)[0] == 0
    with av.open(str(tmp_path / "a.mp4")) as film:
        assert len(list(film.decode(video=0))) == 3
    assert "even" in refused("render", "plane", "--out", "a.mp4", "--size", "15x12")
    monkeypatch.setitem(sys.modules, "av", None)
    assert "pip install 'twillight[video]'" in refused("render", "plane", "--out", "a.mp4", *FAST)


def test_a_stopped_picture_leaves_what_was_there(render, tmp_path, monkeypatch):
    (tmp_path / "a.png").write_bytes(b"before")
    monkeypatch.setattr(jobs.verbs.render, "displayed", Mock(side_effect=KeyboardInterrupt))
    code, _, complaint = render("plane", "--out", "a.png", *FAST)
    assert code == 130 and complaint == "stopped; a.png is as it was before\n"
    assert [path.name for path in tmp_path.iterdir()] == ["a.png"] and (tmp_path / "a.png").read_bytes() == b"before"


OWN = """
<scene version="3.0.0">
  <sensor type="perspective"><transform name="to_world"><lookat origin="0,-3,2" target="0,0,0" up="0,0,1"/></transform>
    <film type="hdrfilm"><integer name="width" value="20"/><integer name="height" value="10"/></film></sensor>
  <emitter type="directional"><vector name="direction" value="0.3,0.2,-1"/></emitter>
  <shape type="rectangle"><bsdf type="diffuse" id="fabric_mine"/></shape>
</scene>
"""


def test_a_mitsuba_file_has_its_own_size_and_wears_the_fabric_that_is_named(render, refused, tmp_path):
    (tmp_path / "own.xml").write_text(OWN)
    assert "fabric_mine" in refused("render", "own.xml", "--out", "a.exr", "--method", "soft_nodes")
    fabric = load_fabric("denim").model_copy(update={"name": "mine"})
    (tmp_path / "mine.toml").write_text(fabric.to_toml())
    assert render("own.xml", "--out", "a.exr", "--method", "soft_nodes", "--fabric", "mine.toml")[0] == 0
    exr = read_exr(tmp_path / "a.exr")
    assert exr.channels["R"].shape == (10, 20) and exr.attributes["fabrics"] == "1 mine"
    assert exr.stack(*"RGB")[exr.channels["A"] == 1].mean() > 0.05
