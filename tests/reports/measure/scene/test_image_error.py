import io
import itertools
import math

import matplotlib.image
import numpy as np
import pytest
from scipy import ndimage

from reports.images import tiles
from reports.images.exr import read_exr, write_exr
from reports.images.tiles import flip_tile, relative_tile
from reports.measure.scene.image_error import PERCEIVED, image_errors, noise_floor, relative_differences
from reports.record import Record
from tests.refusals import refusal
from weaves.colour import linear_rgb

SIZE = 64
Y, X = np.mgrid[:SIZE, :SIZE]
ALL = np.ones((SIZE, SIZE), dtype=bool)
DISC = np.hypot(Y - 32, X - 32) < 28
CLOTH = (0.25 + 0.1 * np.sin(X / 2.5) * np.cos(Y / 4))[..., None] * [1.0, 0.8, 0.6]
EXACT = np.zeros_like(CLOTH)


def flat(*rgb):
    return np.full((SIZE, SIZE, 3), rgb)


def measured(*arguments, **options):
    subject = Record(method="woven", fabric="denim", scene="sphere")
    records, maps = image_errors(subject, *arguments, **options)
    return {record.metric: record for record in records}, maps


def values(picture, truth=CLOTH):
    records, _ = measured(picture, truth, EXACT, ALL)
    return {name: records[name].value if name in records else math.inf for name in ("mse", "mse_relative", *PERCEIVED)}


def test_known_errors_of_constant_pictures_of_colours_and_of_a_factor():
    exact = dict.fromkeys(("mse", "mse_relative", "flip_ldr", "flip_hdr", "delta_e"), 0)
    assert values(CLOTH) == exact | {"psnr": math.inf, "ssim": pytest.approx(1, abs=1e-12)}
    # Codes 102 and 128 of 255 differ by 26/255 everywhere; the exposure cancels what the values were divided by.
    # Without variance, SSIM = (2 a b + C) / (a^2 + b^2 + C), C = .01^2.
    a, b = 102 / 255, 128 / 255
    found = values(*(flat(*linear_rgb(code)) / 1.6 for code in ("#666666", "#808080")))
    assert found["psnr"] == pytest.approx(-20 * math.log10(b - a), abs=1e-9)
    assert found["ssim"] == pytest.approx((2 * a * b + 1e-4) / (a**2 + b**2 + 1e-4), abs=1e-9)
    # FLIP scales colour differences so that the one between the display's green and blue is its largest, 1.  L*
    # are 0 and 100, mean 50: S_L = 1, so Delta E = 100. m = 1.1 t, t = 1 and 3 in halves: ((.1 t)^2 / (t^2 + eps
    # 4)) averaged.
    assert values(flat(0.0, 1.0, 0.0), flat(0.0, 0.0, 1.0))["flip_ldr"] == pytest.approx(1, abs=1e-5)
    assert values(flat(1.0, 1.0, 1.0), flat(1e-9, 1e-9, 1e-9))["delta_e"] == pytest.approx(100, abs=1e-3)
    truth = np.where(X[..., None] < 32, 1.0, 3.0) * np.ones(3)
    expected = 0.01 * (1 / (1 + 0.01 * 4) + 9 / (9 + 0.01 * 4)) / 2
    assert values(1.1 * truth, truth)["mse_relative"] == pytest.approx(expected)


def test_every_measure_is_worse_with_noise_and_with_blur_and_some_do_not_know_the_unit_of_light():
    noise = np.random.default_rng(1).standard_normal(CLOTH.shape)
    noisy = [CLOTH, *(CLOTH + size * noise for size in (0.005, 0.02, 0.08))]
    blurred = [CLOTH, *(ndimage.gaussian_filter(CLOTH, (size, size, 0)) for size in (0.5, 1.0, 2.0))]
    for pictures in (noisy, blurred):
        for better, worse in itertools.pairwise(map(values, pictures)):
            assert {name for name in better if better[name] > worse[name]} == {"psnr", "ssim"}
            assert all(better[name] != worse[name] for name in better)
    bright = values(4 * (CLOTH + 0.01), 4 * CLOTH)
    found = values(CLOTH + 0.01)
    assert bright["mse_relative"] == pytest.approx(found["mse_relative"])
    assert bright["flip_hdr"] == pytest.approx(found["flip_hdr"], rel=1e-4)
    assert bright["mse"] == pytest.approx(16 * found["mse"])
    assert bright["delta_e"] != pytest.approx(found["delta_e"], rel=0.1)


def test_noise_is_subtracted_and_the_floor_is_what_a_perfect_method_scores():
    """A method equal to the field f, the truth f + s z: MSE and relative MSE vanish within 5 standard errors.

    The other measures are of f against t; the floor is of t + s z' against t, z' independent: alike but for the
    curvature of the measures, which an error of 4 % of the values leaves small; 10 % allowed.
    """
    size = 0.04 * CLOTH
    truth = CLOTH + size * np.random.default_rng(2).standard_normal((SIZE, SIZE, 1))
    records, _ = measured(CLOTH, truth, size, DISC)
    assert records["truth_noise"].value == pytest.approx((size[DISC] ** 2).mean())
    for error, noise in ((records["mse"], "truth_noise"), (records["mse_relative"], "mse_relative_floor")):
        assert abs(error.value) < 5 * error.standard_error and abs(error.value) < 0.1 * records[noise].value
        assert error.low < error.value < error.high
    floors = {metric: records[f"{metric}_floor"].value for metric in PERCEIVED}
    for metric, floor in floors.items():
        assert records[metric].value == pytest.approx(floor, rel=0.1), metric
    assert floors == noise_floor(truth, size, DISC)
    assert noise_floor(CLOTH, EXACT, DISC)["ssim"] == pytest.approx(1)


def test_what_is_outside_the_mask_does_not_matter_and_a_nearly_dark_truth_does_not_end_the_process():
    garbage = np.random.default_rng(3).choice([np.nan, -3.0, 1e30], CLOTH.shape)
    clean, clean_maps = measured(1.1 * CLOTH, CLOTH, 0.01 * CLOTH, DISC)
    found, maps = measured(*(np.where(DISC[..., None], a, garbage) for a in (1.1 * CLOTH, CLOTH, 0.01 * CLOTH)), DISC)
    assert found == clean and all((maps[name] == clean_maps[name]).all() for name in clean_maps)
    assert all(found[metric].count == DISC.sum() for metric in PERCEIVED)
    # FLIP leaves the process (exit code 255) if the reference is below 1e-8: it must never see one.
    dark = np.full((32, 32, 3), 1e-9)
    assert measured(2 * dark, dark, 0 * dark, np.ones((32, 32), bool))[0]["flip_hdr"].value > 0


def test_a_record_for_every_number_that_is_finite():
    records, _ = measured(1.1 * CLOTH, CLOTH, 0.01 * CLOTH, ALL, floor=dict.fromkeys(PERCEIVED, 0.5))
    light = ["mse", "mse_measured", "truth_noise", "mse_relative", "mse_relative_floor"]
    assert list(records) == [*light, *(name for metric in PERCEIVED for name in (metric, f"{metric}_floor"))]
    assert all(r.method == "woven" and r.count == SIZE**2 for r in records.values())
    for metric in ("mse", "mse_relative", *PERCEIVED):
        assert records[metric].low < records[metric].value < records[metric].high
    assert {records[f"{metric}_floor"].value for metric in PERCEIVED} == {0.5}, "a given floor is taken"
    assert records["psnr"].unit == "dB"
    equal, _ = measured(CLOTH, CLOTH, EXACT, ALL)
    assert not {"psnr", "psnr_floor"} & equal.keys() and {"ssim", "ssim_floor"} <= equal.keys()


def test_maps_average_to_the_errors_tiles_are_red_where_bright_and_differences_signed_shares(tmp_path):
    sign = np.where(X < SIZE // 2, 1.3, 0.7)[..., None]
    errors, maps = measured(sign * CLOTH, CLOTH, 0.01 * CLOTH, DISC)
    write_exr(tmp_path / "differences.exr", maps)
    exr = read_exr(tmp_path / "differences.exr")
    assert (exr.channels["lit"] == DISC).all()
    for name in ("flip_ldr", "flip_hdr", "delta_e", "ssim"):
        assert exr.channels[name][DISC].mean() == pytest.approx(errors[name].value, rel=1e-5)
    squares = exr.stack("relative.R", "relative.G", "relative.B")[DISC].astype(float) ** 2
    relative = errors["mse_relative"].value + errors["mse_relative_floor"].value
    assert squares.mean() == pytest.approx(relative, rel=1e-5)
    for tile in (flip_tile(exr), flip_tile(exr, "flip_hdr"), relative_tile(exr)):
        rgba = matplotlib.image.imread(io.BytesIO(tile), format="png")[:: tiles.SCALE, :: tiles.SCALE]
        assert ((rgba[..., 3] > 0) == DISC).all()
    assert ((rgba[..., 0] > rgba[..., 2]) == (X < SIZE // 2))[DISC].all()
    maps = relative_differences(sign * CLOTH, CLOTH, DISC, epsilon=1e-12)
    assert set(maps) == {f"relative.{name}" for name in "RGBY"}
    for plane in maps.values():
        np.testing.assert_allclose(plane, np.where(DISC, sign[..., 0] - 1.0, 0.0), rtol=1e-6)


def broken(array, value):
    array = np.array(array)
    array[32, 32, 1] = value
    return array


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"picture": broken(CLOTH, np.nan)}, "picture = 'not finite'"),
        ({"truth": broken(CLOTH, np.inf)}, "truth = 'not finite'"),
        ({"standard_error": broken(EXACT, np.nan)}, "standard error = 'not finite'"),
        ({"standard_error": broken(EXACT, -1)}, "standard errors >= 0"),
        ({"truth": EXACT}, "dark"),
        ({"mask": ~ALL}, "lit pixels = 0"),
        ({"mask": np.logical_and(X == 3, Y == 4)}, "lit pixels = 1"),
    ],
)
def test_what_cannot_be_measured_is_bad_input(change, sentence):
    given = {"picture": CLOTH, "truth": CLOTH, "standard_error": EXACT, "mask": ALL} | change
    assert sentence in refusal(measured, **given)
