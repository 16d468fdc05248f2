"""Errors of one picture against the truth's, with intervals and the noise floor of the truth.

m is the method's value, t the truth's, s its standard error, all linear RGB, <.> the mean over the lit pixels (the
mask) and the channels.

linear light    MSE and relative MSE as in `reports.error`, noise subtracted.
display light   PSNR, SSIM, FLIP, HDR-FLIP and CIEDE2000, means of maps. PSNR is infinite where pictures are equal.

Noise floor: of MSE and relative MSE what was subtracted. The other measures are no sums of squares, nothing can be
subtracted; their floor is the measure of a noised copy, t + s z, against t, z standard normal, one a pixel for all
channels, fixed seed: about the score of a perfect method. Noise of the truth is that of the same points in a few
colours: drawn apart for each channel it would be coloured, and the floor of colour differences several times too high.
Intervals are 95 % percentile bootstraps over square blocks of pixels, since errors of neighbours are correlated
(`reports.measure.block_bootstrap`); they say how much the choice of pixels matters, not the noise floor.

Maps of the perceived difference on a display. Outside the mask both pictures are set to one grey, the median luminance
of the truth's lit pixels: nothing there enters, not even by the windows of SSIM and FLIP, and it shifts no exposure of
HDR-FLIP. L = min(max(exposure m, 0), 1), and E is its sRGB encoding, the codes of the picture on the page.

square          (E_m - E_t)^2, mean over channels; PSNR is 10 log10(1 / mean) in dB: peak 1, which is display white.
ssim            structural similarity of E, Gaussian window, one channel at a time, range 1, at the picture's edge
                continued by reflection [Wang2004SSIM], scikit-image. 1 where equal.
flip_ldr        error map of E at a number of pixels per degree [Andersson2020FLIP], NVIDIA's code. 0 to 1.
flip_hdr        the same for linear values >= 0 over the exposures between those that fit the truth's median and its
                maximum [Andersson2021HDRFLIP]. It does not depend on the unit of light.
delta_e         CIEDE2000 of L (`weaves.colour.delta_e`).
"""

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, Final

import flip_evaluator
import numpy as np
import numpy.typing as npt
from skimage.metrics import structural_similarity

from pipeline.compiled.arrays import Float64, Mask
from reports.error import Error, relative_weight, squared_error
from reports.measure.block_bootstrap import block_interval, blocks
from reports.options import ImageOptions
from reports.record import Metric, Record
from weaves.colour import EXPOSURE, LUMINANCE, delta_e, encoded
from weaves.errors import BadInput

PERCEIVED: Final[tuple[Metric, ...]] = ("psnr", "ssim", "flip_ldr", "flip_hdr", "delta_e")
"""Perceptual measures; the metric of the noise floor is `<metric>_floor`."""

RELATIVE_EPSILON: Final = 0.01
"""Constant that keeps the relative MSE of dark pixels finite, as a share of the truth's squared mean."""

_DEFAULTS: Final = ImageOptions()


def image_errors(
    subject: Record,
    picture: npt.ArrayLike,
    truth: npt.ArrayLike,
    standard_error: npt.ArrayLike,
    mask: npt.ArrayLike,
    options: ImageOptions = _DEFAULTS,
    floor: Mapping[Metric, float] | None = None,
) -> tuple[list[Record], dict[str, npt.NDArray[Any]]]:
    """Measure a picture against the truth's, linear RGB (H, W, 3), with the latter's standard error.

    Return every number as a Record of the `subject`, but those that are infinite (equal pictures); and maps of the
    errors by name, (H, W): `lit`, `relative.R` and so on, `square`, `ssim`, `flip_ldr`, `flip_hdr` and `delta_e`.

    The mask (H, W) is True where there is lit cloth; what other pixels hold does not matter. `floor` is the result of
    `noise_floor` for this truth; it takes half of the time if it is not given. BadInput if a value that counts is not
    finite, the truth is dark, or fewer than two blocks of pixels count.
    """
    m, t, s, lit = _checked(picture, truth, standard_error, mask, options)
    mse, r = _light_errors(m[lit], t[lit], s[lit], lit, options)
    relative = subject.of("mse_relative", r.value, r.count, standard_error=r.standard_error, low=r.low, high=r.high)
    records = [*subject.of_error(mse), relative, subject.of("mse_relative_floor", r.noise, r.count)]
    maps, floors = _perceived_maps(m, t, lit), floor or noise_floor(t, s, lit, options)
    for metric in PERCEIVED:
        rows = _rows(metric, maps, lit)
        _, *means = block_interval(rows, lit, options)
        low, high = (end if math.isfinite(end) else None for end in sorted(_unit(metric, mean) for mean in means))
        value, pixels = _unit(metric, float(rows.mean())), len(rows)
        records += [subject.of(metric, value, pixels, low=low, high=high)] if math.isfinite(value) else []
        if math.isfinite(floors[metric]):
            records.append(subject.of(f"{metric}_floor", floors[metric], pixels))
    return records, {"lit": lit, **relative_differences(m, t, lit), **maps}


def relative_differences(m: Float64, t: Float64, lit: Mask, epsilon: float = RELATIVE_EPSILON) -> dict[str, Float64]:
    """Return (m - t) / sqrt(t^2 + epsilon <t>^2), (H, W), of each channel and of luminance; 0 where nothing counts.

    The mean of the channels' squares is the relative MSE as measured (`reports.error`).
    """
    m, t = m[lit], t[lit]
    light, reference = m @ LUMINANCE, t @ LUMINANCE
    shares = [*((m - t) * relative_weight(t, epsilon)).T, (light - reference) * relative_weight(reference, epsilon)]
    maps = {f"relative.{name}": np.zeros(lit.shape) for name in "RGBY"}
    for plane, share in zip(maps.values(), shares, strict=True):
        plane[lit] = share
    return maps


def noise_floor(
    truth: npt.ArrayLike, standard_error: npt.ArrayLike, mask: npt.ArrayLike, options: ImageOptions = _DEFAULTS
) -> dict[Metric, float]:
    """Return the scores of a noised copy of the truth, by the keys of `PERCEIVED`; arguments as in `image_errors`."""
    _, t, s, lit = _checked(truth, truth, standard_error, mask, options)
    noised = t + s * np.random.default_rng(options.seed).standard_normal((*t.shape[:2], 1))
    maps = _perceived_maps(noised, t, lit)
    return {metric: _unit(metric, float(_rows(metric, maps, lit).mean())) for metric in PERCEIVED}


def _light_errors(m: Float64, t: Float64, s: Float64, lit: Mask, options: ImageOptions) -> tuple[Error, Error]:
    """Return MSE and relative MSE; values, truth and standard error of the lit pixels, (N, 3)."""
    w = relative_weight(t, RELATIVE_EPSILON)
    squares = ((m - t) ** 2 - s**2).mean(axis=1), (((m - t) ** 2 - s**2) * w**2).mean(axis=1)
    errors = []
    for error, rows in zip((squared_error(m, t, s, 0), squared_error(m * w, t * w, s * w, 0)), squares, strict=True):
        spread, low, high = block_interval(rows, lit, options)
        errors.append(replace(error, standard_error=spread, low=low, high=high))
    return errors[0], errors[1]


def _rows(metric: Metric, maps: dict[str, Float64], lit: Mask) -> Float64:
    """Return the values whose mean is the measure, one a lit pixel."""
    return maps["square" if metric == "psnr" else metric][lit]


def _unit(metric: Metric, mean: float) -> float:
    """Return a mean in the unit of its measure: dB of a mean square, else itself."""
    if metric != "psnr":
        return mean
    return -10.0 * math.log10(mean) if mean > 0 else math.inf


def _checked(
    picture: npt.ArrayLike, truth: npt.ArrayLike, standard_error: npt.ArrayLike, mask: npt.ArrayLike, o: ImageOptions
) -> tuple[Float64, Float64, Float64, Mask]:
    """Return the arguments as arrays, or say which of them cannot be used."""
    m, t, s = (np.asarray(values, np.float64) for values in (picture, truth, standard_error))
    lit = np.asarray(mask, dtype=np.bool_)
    if not lit.any() or blocks(lit, o.block).max() < 1:
        raise BadInput("image errors", "lit pixels", int(lit.sum()), "at least two blocks of the picture must be lit")
    for name, values in (("picture", m), ("truth", t), ("standard error", s)):
        if not np.isfinite(values[lit]).all():
            raise BadInput("image errors", name, "not finite", "every lit pixel needs a number")
    if min(t[lit].min(), s[lit].min()) < 0 or t[lit].max() == 0:
        raise BadInput("image errors", "truth", "dark or negative", "light > 0 and standard errors >= 0 are needed")
    return m, t, s, lit


def _perceived_maps(picture: Float64, truth: Float64, lit: Mask) -> dict[str, Float64]:
    """Return the maps above by name, (H, W); pictures (H, W, 3), `lit` (H, W) the pixels that count."""
    grey = float(np.median(truth[lit] @ LUMINANCE))
    picture, truth = (np.where(lit[..., None], values, grey) for values in (picture, truth))
    light, light_truth = (np.clip(EXPOSURE * values, 0.0, 1.0) for values in (picture, truth))
    shown, shown_truth = encoded(light), encoded(light_truth)
    # The window is Gaussian, of 1.5 pixels, and cut at 3.5 of these.
    window = {"gaussian_weights": True, "sigma": 1.5, "use_sample_covariance": False}
    compare: Any = structural_similarity  # has no types
    similarity = compare(shown, shown_truth, data_range=1.0, channel_axis=-1, full=True, **window)[1]
    # FLIP leaves the process where the reference is too dark for its exposures; it is made 1 at its brightest.
    unit = 1.0 / (truth @ LUMINANCE).max()
    return {
        "square": ((shown - shown_truth) ** 2).mean(axis=-1),
        "ssim": similarity.mean(axis=-1),
        "flip_ldr": _flip(shown, shown_truth, "LDR"),
        "flip_hdr": _flip(np.maximum(unit * picture, 0.0), unit * truth, "HDR"),
        "delta_e": delta_e(light, light_truth),
    }


def _flip(picture: Float64, truth: Float64, kind: str) -> Float64:
    """Return FLIP's error map, (H, W); values are finite (FLIP would take NaN for a colour)."""
    values = [np.ascontiguousarray(array, np.float32) for array in (truth, picture)]
    # Pixels per degree of a 4K display .7 m wide from .7 m; the tone mapper shows the exposures of HDR.
    look: dict[str, Any] = {"ppd": 67.0, **({"tonemapper": "aces"} if kind == "HDR" else {})}
    errors, _, _ = flip_evaluator.evaluate(*values, kind, applyMagma=False, computeMeanError=False, parameters=look)
    return np.asarray(errors[..., 0], np.float64)
