"""Maps of PSNR, SSIM, FLIP and CIEDE2000: the perceived difference of two pictures on a display.

Pictures are linear RGB. Outside the mask both are set to one grey, the median luminance of the truth's lit pixels:
nothing there enters, not even by the windows of SSIM and FLIP, and it shifts no exposure of HDR-FLIP.

display light   L = min(max(exposure m, 0), 1), and its sRGB encoding E, the codes of the picture on the page.
square          (E_m - E_t)^2, mean over channels; PSNR is 10 log10(1 / mean) in dB: peak 1, which is display white.
ssim            structural similarity of E, Gaussian window, one channel at a time, range 1, at the picture's edge
                continued by reflection [Wang2004SSIM], scikit-image. 1 where equal.
flip_ldr        error map of E at a number of pixels per degree [Andersson2020FLIP], NVIDIA's code. 0 to 1.
flip_hdr        the same for linear values >= 0 over the exposures between those that fit the truth's median and its
                maximum [Andersson2021HDRFLIP]. It does not depend on the unit of light.
delta_e         CIEDE2000 of L (`weaves.colour.delta_e`).
"""

from __future__ import annotations

from typing import Any

import flip_evaluator
import numpy as np
import numpy.typing as npt
from skimage.metrics import structural_similarity

from reports.options import ImageOptions
from weaves.colour import LUMINANCE, delta_e, encoded

Floats = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]


def perceived_maps(picture: Floats, truth: Floats, lit: Mask, options: ImageOptions) -> dict[str, Floats]:
    """Return the maps above by name, (H, W); pictures (H, W, 3), `lit` (H, W) the pixels that count."""
    grey = float(np.median(truth[lit] @ LUMINANCE))
    picture, truth = (np.where(lit[..., None], values, grey) for values in (picture, truth))
    light, light_truth = (np.clip(options.exposure * values, 0.0, 1.0) for values in (picture, truth))
    shown, shown_truth = encoded(light), encoded(light_truth)
    window = {"gaussian_weights": True, "sigma": options.ssim_sigma, "use_sample_covariance": False}
    compare: Any = structural_similarity  # has no types
    similarity = compare(shown, shown_truth, data_range=1.0, channel_axis=-1, full=True, **window)[1]
    # FLIP leaves the process where the reference is too dark for its exposures; it is made 1 at its brightest.
    unit = 1.0 / (truth @ LUMINANCE).max()
    return {
        "square": ((shown - shown_truth) ** 2).mean(axis=-1),
        "ssim": similarity.mean(axis=-1),
        "flip_ldr": _flip(shown, shown_truth, "LDR", options),
        "flip_hdr": _flip(np.maximum(unit * picture, 0.0), unit * truth, "HDR", options),
        "delta_e": delta_e(light, light_truth),
    }


def _flip(picture: Floats, truth: Floats, kind: str, options: ImageOptions) -> Floats:
    """Return FLIP's error map, (H, W); values are finite (FLIP would take NaN for a colour)."""
    values = [np.ascontiguousarray(array, np.float32) for array in (truth, picture)]
    parameters: dict[str, Any] = {"ppd": options.pixels_per_degree}
    if kind == "HDR":
        parameters["tonemapper"] = options.tone_mapper
    errors, _, _ = flip_evaluator.evaluate(
        *values, kind, applyMagma=False, computeMeanError=False, parameters=parameters
    )
    return np.asarray(errors[..., 0], np.float64)
