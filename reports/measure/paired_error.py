"""Paired comparison: the difference of the errors of two pictures of one frame, against the same truth.

Two intervals that overlap say little: both are wide because pixels differ, and pixels with a large error of one method
have a large error of the other too. The difference of squared errors, pixel by pixel, cancels these differences and the
noise of the truth:

    (b - t)^2 - (a - t)^2 = (b - a) (b + a - 2 t),     unbiased, for t enters linearly
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from reports.measure.block_bootstrap import block_interval
from reports.options import ImageOptions


def mse_difference(
    a: npt.ArrayLike,
    b: npt.ArrayLike,
    truth: npt.ArrayLike,
    mask: npt.NDArray[np.bool_],
    options: ImageOptions | None = None,
) -> tuple[float, float, float]:
    """Return the MSE of b less that of a, and its 95 % interval over blocks of pixels.

    Parameters
    ----------
    a, b, truth : array_like (H, W, 3)
        Linear RGB.
    mask : bool (H, W)
        Pixels that count.
    options : ImageOptions
        Blocks and resamples.
    """
    options = options or ImageOptions()
    first, second, t = (np.asarray(picture, np.float64)[mask] for picture in (a, b, truth))
    rows = ((second - first) * (second + first - 2.0 * t)).mean(axis=1)
    _, low, high = block_interval(rows, mask, options.block, options.resamples, options.seed)
    return float(rows.mean()), low, high
