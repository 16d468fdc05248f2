"""Confidence intervals of means over the pixels of a picture, whose values resemble their neighbours'.

Whole square blocks of pixels are drawn with replacement instead of pixels [Kunsch1989Jackknife]: what goes on within a
block stays together. With blocks wider than the distance over which values resemble each other, and some dozens of
them, 95 % intervals cover nearly that; drawing pixels would make them far too narrow.

Paired comparison: two intervals that overlap say little, because pixels with a large error of one method have a large
error of the other too. The difference of squared errors, pixel by pixel, cancels these differences and the noise of
the truth: (b - t)^2 - (a - t)^2 = (b - a) (b + a - 2 t), unbiased, for t enters linearly.
"""

import numpy as np
import numpy.typing as npt

from pipeline.compiled.arrays import Float64, Mask
from reports.error import bootstrap
from reports.options import ImageOptions


def block_interval(rows: Float64, mask: Mask, options: ImageOptions) -> tuple[float, float, float]:
    """Return the standard error of a mean over pixels and the ends of its 95 % interval.

    `rows` (N,) are the values of the N pixels of the mask (H, W), row by row, in two blocks at least. The options tell
    the side of a block as in `blocks`, and draws of the percentile bootstrap [Efron1993Bootstrap] with their seed. The
    mean of a draw is the sum of its values over the number of its pixels: blocks may be lit in part.
    """
    block = blocks(mask, options.block)
    sums, counts = np.bincount(block, rows), np.bincount(block).astype(np.float64)

    def mean(a: Float64, b: Float64, axis: int) -> Float64:
        return np.asarray(a.sum(axis=axis) / b.sum(axis=axis))

    drawn = bootstrap((sums, counts), mean, options.resamples, options.seed)
    return float(drawn.standard_error), float(drawn.confidence_interval.low), float(drawn.confidence_interval.high)


def blocks(mask: Mask, side: int) -> npt.NDArray[np.intp]:
    """Return the number of the block of every pixel of the mask, (N,), without gaps.

    `side` is that of a block in pixels; at most a quarter of the picture's shorter side is used.
    """
    side = max(1, min(side, min(mask.shape) // 4))
    y, x = np.nonzero(mask)
    return np.unique((y // side) * mask.shape[1] + x // side, return_inverse=True)[1]


def mse_difference(
    a: npt.ArrayLike, b: npt.ArrayLike, truth: npt.ArrayLike, mask: Mask, options: ImageOptions
) -> tuple[float, float, float]:
    """Return the MSE of b less that of a, and its 95 % interval over blocks of pixels; pictures are linear RGB."""
    first, second, t = (np.asarray(picture, np.float64)[mask] for picture in (a, b, truth))
    rows = ((second - first) * (second + first - 2.0 * t)).mean(axis=1)
    _, low, high = block_interval(rows, mask, options)
    return float(rows.mean()), low, high
