"""Maps of the difference between a picture and the truth's, as layers of its OpenEXR.

Channels: `lit` (1 where a pixel counts), `relative.R`, `.G`, `.B` and `.Y` (signed, as shares), `flip_ldr`, `flip_hdr`,
`delta_e`, `ssim`, `square` (`reports.measure.scene.flip_ssim`).
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from reports.error import relative_weight
from reports.measure.scene.image_error import ImageErrors
from weaves.colour import LUMINANCE

Floats = npt.NDArray[np.float64]


def difference_maps(
    picture: npt.ArrayLike, truth: npt.ArrayLike, errors: ImageErrors, epsilon: float = 0.01
) -> dict[str, npt.NDArray[Any]]:
    """Return all maps of a picture's errors, (H, W) by channel.

    Parameters
    ----------
    picture, truth : array_like (H, W, 3)
        The pictures that `image_errors` measured (`reports.measure.scene.image_error`).
    epsilon : float
        As in `relative_differences`.
    """
    return {"lit": errors.mask, **relative_differences(picture, truth, errors.mask, epsilon), **errors.maps}


def relative_differences(
    picture: npt.ArrayLike, truth: npt.ArrayLike, mask: npt.NDArray[np.bool_], epsilon: float = 0.01
) -> dict[str, Floats]:
    """Return (m - t) / sqrt(t^2 + epsilon <t>^2), (H, W), of each channel and of luminance; 0 where nothing counts.

    The mean of the channels' squares is the relative MSE as measured (`reports.error`).
    """
    m, t = (np.asarray(values, np.float64)[mask] for values in (picture, truth))
    light, reference = m @ LUMINANCE, t @ LUMINANCE
    shares = [*((m - t) * relative_weight(t, epsilon)).T, (light - reference) * relative_weight(reference, epsilon)]
    maps = {f"relative.{name}": np.zeros(mask.shape) for name in "RGBY"}
    for plane, share in zip(maps.values(), shares, strict=True):
        plane[mask] = share
    return maps
