"""Where a picture differs from the truth's: maps as layers of its OpenEXR, and as tiles of a page.

Channels: `lit` (1 where a pixel counts), `relative.R`, `.G`, `.B` and `.Y` (signed, as shares), `flip_ldr`, `flip_hdr`,
`delta_e`, `ssim`, `square`; `reports.image_error` defines them.
"""

from __future__ import annotations

from typing import Any, Final

import matplotlib as mpl
import numpy as np
import numpy.typing as npt

from reports.exr import Exr
from reports.image_error import ImageErrors
from reports.metrics import relative_weight
from reports.tiles import png
from weaves.colour import LUMINANCE

Floats = npt.NDArray[np.float64]

RELATIVE_RANGE: Final = 0.5
"""Relative difference that is shown in full colour."""


def difference_maps(
    picture: npt.ArrayLike, truth: npt.ArrayLike, errors: ImageErrors, epsilon: float = 0.01
) -> dict[str, npt.NDArray[Any]]:
    """Return all maps of a picture's errors, (H, W) by channel.

    Parameters
    ----------
    picture, truth : array_like (H, W, 3)
        What `errors` was measured on, by `reports.image_error.image_errors`.
    epsilon : float
        As in `relative_differences`.
    """
    return {"lit": errors.mask, **relative_differences(picture, truth, errors.mask, epsilon), **errors.maps}


def relative_differences(
    picture: npt.ArrayLike, truth: npt.ArrayLike, mask: npt.NDArray[np.bool_], epsilon: float = 0.01
) -> dict[str, Floats]:
    """Return (m - t) / sqrt(t^2 + epsilon <t>^2), (H, W), of each channel and of luminance; 0 where nothing counts.

    The mean of the channels' squares is the relative MSE as measured (`reports.metrics`).
    """
    m, t = (np.asarray(values, np.float64)[mask] for values in (picture, truth))
    light, reference = m @ LUMINANCE, t @ LUMINANCE
    shares = [*((m - t) * relative_weight(t, epsilon)).T, (light - reference) * relative_weight(reference, epsilon)]
    maps = {f"relative.{name}": np.zeros(mask.shape) for name in "RGBY"}
    for plane, share in zip(maps.values(), shares, strict=True):
        plane[mask] = share
    return maps


def relative_tile(differences: Exr) -> bytes:
    """Return the relative difference of luminance: blue too dark, red too bright, full from `RELATIVE_RANGE` on."""
    share = np.clip(differences.channels["relative.Y"] / RELATIVE_RANGE, -1.0, 1.0)
    return _tile("RdBu_r", 0.5 + 0.5 * share, differences)


def flip_tile(differences: Exr, channel: str = "flip_ldr") -> bytes:
    """Return a map of FLIP, black to white from 0 to 1 by way of purple and orange, as its authors show it."""
    return _tile("magma", differences.channels[channel], differences)


def _tile(colours: str, share: npt.NDArray[np.float32], differences: Exr) -> bytes:
    """Return a map in colours, clear where nothing counts."""
    rgba = np.array(mpl.colormaps[colours](share, bytes=True))
    rgba[differences.channels["lit"] == 0] = 0
    return png(rgba)
