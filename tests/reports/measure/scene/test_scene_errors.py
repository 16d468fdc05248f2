"""Frames of a scene and what is measured on them, at a size of a few pixels."""

import sys
from types import SimpleNamespace

import numpy as np
import pytest

from pipeline.models.fallback import Fallback
from pipeline.scenes.options import SceneOptions
from pipeline.truth.estimator import estimate
from pipeline.truth.options import TruthOptions
from reports.images.exr import film, read_exr
from reports.measure.scene import scene_errors
from reports.measure.scene.scene_errors import measure_scene, time_scene, write_truth
from reports.measure.scene.shot import read_shot, shoot
from reports.measure.timing import CallTiming
from reports.options import ImageOptions, RepeatOptions, SceneBenchOptions
from weaves.errors import BadInput

pytest.importorskip("mitsuba")

COARSE = TruthOptions(relative_error=0.1, min_count=64, max_count=128)
SCENES = SceneBenchOptions(
    names=("dinner_table",),
    size=(40, 32),
    frames=3,
    options=SceneOptions(environment_directions=4),
    truth=COARSE,
    frame_truth=COARSE,
    image=ImageOptions(block=4, resamples=100),
)
REPEATS = RepeatOptions(timing_repeats=20, warm_up=1)


class Answers:
    """The truth with other points, times a factor."""

    name = "answers"

    def __init__(self, factor, covered=True):
        self.factor, self.covered, self.setting = factor, covered, f"x {factor:g}"

    def covers(self, fabric):
        return self.covered

    def prepare(self, fabric):
        pass

    def predict(self, fabric, queries, seed=0):
        return self.factor * estimate(fabric, queries, COARSE, seed + 1).mean

    def bytes_stored(self, fabric):
        return 1


ALL = {"behind", "stretch", "curvature"}


INTERVALS = ("mse", "mse_relative", "psnr", "ssim", "flip_ldr", "flip_hdr", "delta_e", "flicker", "colour_rrmse")


def by_setting(records):
    """Return {setting: {metric: Record}}."""
    found = {}
    for record in records:
        found.setdefault(record.setting, {})[record.metric] = record
    return found


@pytest.fixture(scope="module")
def shot(tmp_path_factory):
    path = tmp_path_factory.mktemp("shot") / "dinner_table.npz"
    shoot("dinner_table", SCENES, path)
    return read_shot(path), path


def test_the_same_work_gives_the_same_bytes(shot, tmp_path):
    shoot("dinner_table", SCENES, tmp_path / "again.npz")
    assert (tmp_path / "again.npz").read_bytes() == shot[1].read_bytes()


def test_a_picture_is_the_base_and_the_light_of_its_queries(shot):
    frames, _ = shot
    pictures = frames.pictures()
    assert pictures.shape == (3, 32, 40, 3) and np.isfinite(pictures).all() and (pictures >= 0).all()
    # Where nothing is asked, the picture is its base; where something is, it is not darker.
    np.testing.assert_allclose(pictures[~frames.lit], frames.base[~frames.lit], rtol=1e-6)
    assert (pictures >= frames.base - 1e-6).all()
    # Answers twice as bright add the scattered light once more.
    twice = frames.pictures([2.0 * cloth.mean for cloth in frames.cloths])
    np.testing.assert_allclose(twice - pictures, pictures - frames.base, rtol=1e-5, atol=1e-9)
    assert len(frames.cloths) == 4


def test_noise_of_many_lights_adds_in_quadrature(shot):
    frames, _ = shot
    cloth = frames.cloths[0]
    pixel = np.bincount(cloth.pixel[cloth.frame == 0]).argmax()
    rows = (cloth.frame == 0) & (cloth.pixel == pixel)
    assert rows.sum() > 1
    own = np.sqrt(np.square(cloth.noise()[rows]).sum(axis=0))
    found = frames.noise()[0].reshape(-1, 3)[pixel]
    others = any((c.pixel[c.frame == 0] == pixel).any() for c in frames.cloths[1:])
    assert not others
    np.testing.assert_allclose(found, own, rtol=1e-6)


def test_a_better_method_scores_better_and_what_covers_not_all_is_left_out(shot):
    frames, _ = shot
    methods = [Fallback(Answers(1.0), ALL), Fallback(Answers(1.3), ALL), Fallback(Answers(1.0, covered=False), ALL)]
    records = measure_scene(methods, frames, SCENES, {})
    records += time_scene(methods, frames, REPEATS, 0)
    found = by_setting(records)
    assert list(found) == ["x 1", "x 1.3"]
    good, bad = ({metric: record.value for metric, record in found[name].items()} for name in found)
    assert all(good[name] < bad[name] for name in ("mse", "flip_hdr", "delta_e")) and good["psnr"] > bad["psnr"]
    # A picture a third too bright is wrong by that share of the light that the cloth scatters.
    light = (frames.pictures() - frames.base)[0][frames.lit[0]]
    assert bad["mse"] == pytest.approx(0.09 * np.square(light).mean(), rel=0.1)
    assert good["fallback_share"] == bad["fallback_share"] >= 0 and min(good["frame_time"], bad["frame_time"]) > 0
    # Every number but the energy lies in its interval.
    for records in found.values():
        for name in INTERVALS:
            assert records[name].low <= records[name].value <= records[name].high, name
    assert all(found["x 1.3"][name].low < found["x 1.3"][name].high for name in INTERVALS)
    assert min(good["psnr_floor"], bad["psnr_floor"]) > bad["psnr"]
    assert min(good["truth_noise"], bad["truth_noise"]) > 0


def test_pictures_hold_their_frames_and_differences(shot, tmp_path):
    frames, _ = shot
    measure_scene([Fallback(Answers(1.3), ALL)], frames, SCENES, {"x 1.3": tmp_path / "picture.exr"})
    found = read_exr(tmp_path / "picture.exr")
    shown, lit = film(found), frames.lit
    np.testing.assert_allclose(shown[~lit], frames.base[~lit], rtol=2e-3, atol=1e-6)
    assert (shown[lit] >= frames.base[lit] * (1 - 2e-3) - 1e-6).all() and shown.shape == frames.base.shape
    np.testing.assert_array_equal(found.channels["lit"] > 0, lit[0])
    # Cloth answers a third too bright: relative differences are positive where the cloth is all there is to see.
    assert np.median(found.channels["relative.Y"][lit[0]]) > 0.05
    assert (found.channels["flip_ldr"][lit[0]] >= 0).all() and found.channels["flip_ldr"][lit[0]].mean() > 0.01


def test_what_an_eye_sees_is_scored_where_it_can_be(shot, monkeypatch):
    """A stand-in for pyfvvdp scores 10 less the mean difference of the light it is shown."""

    class Metric:
        def __init__(self, **about):
            pass

        def predict(self, film, reference, dim_order, frames_per_second):
            assert film.shape == reference.shape == (3, 32, 40) and dim_order == "FHW"
            return 10.0 - float(np.abs(film - reference).mean()), None

    anything = lambda *values, **named: None  # noqa: E731
    stand_in = SimpleNamespace(fvvdp=Metric, fvvdp_display_photo_eotf=anything, fvvdp_display_geometry=anything)
    monkeypatch.setitem(sys.modules, "pyfvvdp", stand_in)
    frames, _ = shot
    methods = [Fallback(Answers(factor), ALL) for factor in (1.0, 1.3)]
    found = by_setting(measure_scene(methods, frames, SCENES, {}))
    assert 10 > found["x 1"]["fovvideovdp"].value > found["x 1.3"]["fovvideovdp"].value


def test_a_frames_time_weighs_every_cloth_by_its_queries(shot, monkeypatch):
    """With a clock that says 1, 2, 3, ... microseconds a query of the first, second, third cloth of a method."""
    frames, _ = shot
    counts = [len(cloth.frame) for cloth in frames.first().cloths]
    assert len(set(counts)) > 1

    def readings(contenders, repeats, warm_up):
        assert [len(contender.queries) for contender in contenders] == [1] * 2 * len(counts)
        return [
            CallTiming(tuple(1e3 * (1 + index % len(counts)) * (1 + turn) for turn in range(repeats)), 1)
            for index, _ in enumerate(contenders)
        ]

    monkeypatch.setattr(scene_errors, "time_side_by_side", readings)
    records = time_scene([Fallback(Answers(factor), ALL) for factor in (1.0, 1.3)], frames, REPEATS, 0)
    whole = 1e-3 * sum(count * (1 + index) for index, count in enumerate(counts))
    for record in records:
        assert record.samples == pytest.approx([whole * (1 + turn) for turn in range(20)])
        assert record.value == pytest.approx(10.5 * whole) and record.low < record.value < record.high
    assert time_scene([Fallback(Answers(1.0, covered=False), ALL)], frames, REPEATS, 0) == []


def test_the_truths_picture_holds_its_noise(shot, tmp_path):
    frames, _ = shot
    write_truth(frames, tmp_path / "truth.exr")
    found = read_exr(tmp_path / "truth.exr")
    np.testing.assert_allclose(found.stack("R", "G", "B"), frames.pictures()[0], rtol=1e-6)
    np.testing.assert_allclose(film(found), frames.pictures(), rtol=1e-3, atol=1e-6)
    np.testing.assert_allclose(found.stack("error.R", "error.G", "error.B"), frames.noise()[0], rtol=1e-5, atol=1e-9)


def test_a_scene_that_does_not_exist_is_one_sentence(tmp_path):
    with pytest.raises(BadInput, match="scene"):
        shoot("tabel", SCENES, tmp_path / "x.npz")
