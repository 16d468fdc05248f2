import sys
from types import SimpleNamespace

import numpy as np
import pytest

from pipeline.models.fallback import Fallback
from pipeline.scenes import bounces
from pipeline.scenes.options import SceneOptions
from pipeline.truth.estimator import estimate
from pipeline.truth.options import TruthOptions
from reports.images.exr import film, read_exr
from reports.measure.scene import scene_errors
from reports.measure.scene.scene_errors import measure_scene, time_scene, write_truth
from reports.measure.scene.shot import read_shot, shoot
from reports.measure.timing import CallTiming
from reports.options import ImageOptions, RepeatOptions, SceneBenchOptions
from reports.record import Record
from tests.pipeline.models.stand_ins import FakeMethod
from tests.refusals import refusal

pytest.importorskip("mitsuba")
pytestmark = pytest.mark.usefixtures("coarse_truth")

COARSE = TruthOptions(relative_error=0.1, min_count=64, max_count=128)
FEW = {"frames": 3, "options": SceneOptions(environment_directions=4, bounces=1)}
FEW |= {"truth": COARSE, "frame_truth": COARSE}
SCENES = SceneBenchOptions(names=("dinner_table",), size=(40, 32), image=ImageOptions(block=4, resamples=100), **FEW)
INTERVALS = ("mse", "mse_relative", "psnr", "ssim", "flip_ldr", "flip_hdr", "delta_e", "flicker", "colour_rrmse")


class Answers(FakeMethod):
    """The truth with other points, times a factor."""

    def __init__(self, factor, covered=True):
        self.factor, self.covered, self.setting = factor, covered, f"x {factor:g}"

    def covers(self, fabric):
        return self.covered

    def predict(self, fabric, queries, seed=0):
        return self.factor * estimate(fabric, queries, COARSE, seed + 1).mean


class Metric:
    """A stand-in for pyfvvdp: 10 less the mean difference of the light that it is shown."""

    def __init__(self, **about):
        pass

    def predict(self, film, reference, dim_order, frames_per_second):
        assert film.shape == reference.shape == (3, 32, 40) and dim_order == "FHW"
        return 10.0 - float(np.abs(film - reference).mean()), None


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("shot")


@pytest.fixture(scope="module")
def frames(folder):
    shoot("dinner_table", SCENES, folder / "dinner_table.npz")
    return read_shot(folder / "dinner_table.npz")


def method(factor, covered=True):
    return Fallback(Answers(factor, covered), {"behind", "stretch", "curvature"})


@pytest.fixture(scope="module")
def measured(frames, folder):
    """{setting: {metric: Record}} of three methods, of which one does not cover all cloths; a picture of one."""
    ignored = lambda *values, **named: None  # noqa: E731
    stand_in = SimpleNamespace(fvvdp=Metric, fvvdp_display_photo_eotf=ignored, fvvdp_display_geometry=ignored)
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(sys.modules, "pyfvvdp", stand_in)
        methods = [method(1.0), method(1.3), method(1.1, covered=False)]
        records = measure_scene(methods, frames, SCENES, {"x 1.3": folder / "picture.exr"})
    found = {}
    for record in records:
        found.setdefault(record.setting, {})[record.metric] = record
    return found


@pytest.mark.slow
def test_the_same_work_gives_the_same_bytes(frames, folder):
    shoot("dinner_table", SCENES, folder / "again.npz")
    assert (folder / "again.npz").read_bytes() == (folder / "dinner_table.npz").read_bytes()


def test_a_picture_is_the_base_and_the_light_of_its_queries_whose_noise_adds_in_quadrature(frames):
    pictures = frames.pictures()
    assert pictures.shape == (3, 32, 40, 3) and np.isfinite(pictures).all() and (pictures >= 0).all()
    # Where nothing is asked, the picture is its base; where something is, it is not darker.
    np.testing.assert_allclose(pictures[~frames.lit], frames.base[~frames.lit], rtol=1e-6)
    assert (pictures >= frames.base - 1e-6).all()
    # Answers twice as bright add the scattered light once more.
    twice = frames.pictures([2.0 * cloth.mean for cloth in frames.cloths])
    np.testing.assert_allclose(twice - pictures, pictures - frames.base, rtol=1e-5, atol=1e-9)
    assert len(frames.cloths) == 4
    cloth = frames.cloths[0]
    pixel = np.bincount(cloth.pixel[cloth.frame == 0]).argmax()
    rows = (cloth.frame == 0) & (cloth.pixel == pixel)
    assert rows.sum() > 1 and not any((c.pixel[c.frame == 0] == pixel).any() for c in frames.cloths[1:])
    own = np.sqrt(np.square(cloth.noise()[rows]).sum(axis=0))
    np.testing.assert_allclose(frames.noise()[0].reshape(-1, 3)[pixel], own, rtol=1e-6)


@pytest.mark.slow
def test_silhouettes_have_the_truths_light_and_an_error_of_their_own(tmp_path):
    """Hems: 32 rays are near the truth's coverage; all that is called covered errs by what is not."""
    options = SCENES.model_copy(update={"names": ("hem",), "size": (40, 40)})
    shoot("hem", options, tmp_path / "hem.npz")
    (cloth,) = (shot := read_shot(tmp_path / "hem.npz")).cloths
    assert 10 < len(cloth.coverage) == len(cloth.rims.u) and 0 < cloth.coverage.mean() < 1
    quick, whole = Answers(1.0), Answers(2.0)
    whole.coverage = lambda fabric, looks: np.ones(len(looks.u), np.float32)
    records = measure_scene(
        [Fallback(one, {"behind", "stretch", "curvature"}) for one in (quick, whole)], shot, options, {}
    )
    errors = [record.value for record in records if record.metric == "rim_coverage"]
    assert errors[0] < 0.1 and errors[1] == pytest.approx(np.sqrt(np.square(1 - cloth.coverage.astype(float)).mean()))


def test_all_bounces_are_those_of_the_table_for_the_truth_and_for_methods(tmp_path):
    """Stored once: a frame is that of one bounce and, for the same colours, the same light more."""
    loaded = SCENES.options.model_copy(update={"bounces": "all"})
    small = SCENES.model_copy(update={"size": (16, 12)})
    for name, options in (("one", small), ("all", small.model_copy(update={"options": loaded}))):
        shoot("dinner_table", options, tmp_path / name)
    one, every = (read_shot(tmp_path / name) for name in ("one", "all"))
    np.testing.assert_array_equal(every.base, one.base)
    zero = [np.zeros_like(cloth.mean) for cloth in every.cloths]
    added = every.pictures(zero) - every.base
    np.testing.assert_allclose(every.pictures() - one.pictures(), added, rtol=1e-6, atol=1e-9)
    cloth = every.cloths[0]
    light = bounces.later_bounces(cloth.fabric, cloth.queries, cloth.colours).sum(axis=1)
    np.testing.assert_allclose(cloth.light(zero[0]), cloth.weight * light, rtol=1e-5)
    assert light.min() >= 0.0 and light.max() > 1e-3


def test_a_better_method_scores_better_and_what_covers_not_all_is_left_out(frames, measured):
    assert list(measured) == ["x 1", "x 1.3"]
    good, bad = ({metric: record.value for metric, record in measured[name].items()} for name in measured)
    assert all(good[name] < bad[name] for name in ("mse", "flip_hdr", "delta_e"))
    assert good["psnr"] > bad["psnr"] and 10 > good["fovvideovdp"] > bad["fovvideovdp"]
    # A picture a third too bright is wrong by that share of the light that the cloth scatters.
    light = (frames.pictures() - frames.base)[0][frames.lit[0]]
    assert bad["mse"] == pytest.approx(0.09 * np.square(light).mean(), rel=0.1)
    assert good["fallback_share"] == bad["fallback_share"] >= 0
    # Every number but the energy lies in its interval.
    for records in measured.values():
        for name in INTERVALS:
            assert records[name].low <= records[name].value <= records[name].high, name
    assert all(measured["x 1.3"][name].low < measured["x 1.3"][name].high for name in INTERVALS)
    assert min(good["psnr_floor"], bad["psnr_floor"]) > bad["psnr"]
    assert min(good["truth_noise"], bad["truth_noise"]) > 0


def test_a_missing_metric_fails_nothing(monkeypatch):
    monkeypatch.setitem(sys.modules, "pyfvvdp", None)
    assert scene_errors.fovvideovdp(Record(method="woven"), np.ones((3, 8, 8)), np.ones((3, 8, 8))) == []


def test_pictures_hold_their_frames_and_differences(frames, measured, folder):
    found = read_exr(folder / "picture.exr")
    shown, lit = film(found), frames.lit
    np.testing.assert_allclose(shown[~lit], frames.base[~lit], rtol=2e-3, atol=1e-6)
    assert (shown[lit] >= frames.base[lit] * (1 - 2e-3) - 1e-6).all() and shown.shape == frames.base.shape
    np.testing.assert_array_equal(found.channels["lit"] > 0, lit[0])
    # Cloth answers a third too bright: relative differences are positive where the cloth is all there is to see.
    assert np.median(found.channels["relative.Y"][lit[0]]) > 0.05
    assert (found.channels["flip_ldr"][lit[0]] >= 0).all() and found.channels["flip_ldr"][lit[0]].mean() > 0.01


def test_a_frames_time_weighs_every_cloth_by_its_queries(frames, monkeypatch):
    """With a clock that says 1, 2, 3, ... microseconds a query of the first, second, third cloth of a method."""
    counts = [int((cloth.frame == 0).sum()) for cloth in frames.cloths]
    assert len(set(counts)) > 1

    def readings(contenders, repeats, warm_up):
        assert [len(contender.queries) for contender in contenders] == [1] * 2 * len(counts)
        return [
            CallTiming(tuple(1e3 * (1 + index % len(counts)) * (1 + turn) for turn in range(repeats)))
            for index, _ in enumerate(contenders)
        ]

    monkeypatch.setattr(scene_errors, "time_side_by_side", readings)
    repeats = RepeatOptions(timing_repeats=20, warm_up=1)
    whole = 1e-3 * sum(count * (1 + index) for index, count in enumerate(counts))
    for record in time_scene([method(1.0), method(1.3)], frames, repeats, 0):
        assert record.samples == pytest.approx([whole * (1 + turn) for turn in range(20)])
        assert record.value == pytest.approx(10.5 * whole) and record.low < record.value < record.high
    assert time_scene([method(1.0, covered=False)], frames, repeats, 0) == []


def test_the_truths_picture_holds_its_noise_and_a_scene_that_does_not_exist_is_one_sentence(frames, tmp_path):
    write_truth(frames, tmp_path / "truth.exr")
    found = read_exr(tmp_path / "truth.exr")
    np.testing.assert_allclose(found.stack("R", "G", "B"), frames.pictures()[0], rtol=1e-6)
    np.testing.assert_allclose(film(found), frames.pictures(), rtol=1e-3, atol=1e-6)
    np.testing.assert_allclose(found.stack("error.R", "error.G", "error.B"), frames.noise()[0], rtol=1e-5, atol=1e-9)
    assert "scene" in refusal(shoot, "tabel", SCENES, tmp_path / "x.npz")
