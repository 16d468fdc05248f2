"""Errors of answers against the truth, and the part of them that is noise of the truth.

With a model's value m, the truth's estimate t, its standard error s, and means <.> over queries (pixels) and channels:

MSE measured   <(m - t)^2> in linear RGB of the fabric's own colours: the paper of `woven` reports one of a picture.
noise          <s^2>, s the calibrated standard error (`pipeline.truth.calibration`). Components are taken to be
               uncorrelated, s_rgb^2 = sum_j colour_j^2 s_j^2: an approximation, for they share their points; the page
               says how much of an error the noise is.
MSE            MSE measured - noise. The truth's error is independent of the model's, so E[(m - t)^2] = (m - f)^2 + s^2
               and the difference estimates the model's own error (m - f)^2; it can fall below zero.
relative MSE   <((m - t)^2 - s^2) / (t^2 + eps <t>^2)>: every pixel counts by its share, the noise subtracted likewise;
               eps keeps dark pixels from counting without bound. As the weight holds the noisy t, a bias of relative
               size (s / t)^2 remains [Rousselle2011Adaptive].
relative RMSE  sqrt(max(MSE, 0)) / <t>, one component at a time.
colour measure the relative RMSE of .3 (S_warp + S_weft) + .5 (C_warp + C_weft), which compares fabrics of any colour.
               Where almost nothing of a patch is seen the truth is 0 by definition below a limit; a few such queries
               hold most of the squared error of accurate methods. So there is a second figure, of 99 % of the queries.

Intervals are 95 % percentile bootstraps over queries [Efron1993Bootstrap] by scipy, with a fixed seed.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import numpy.typing as npt
from scipy import stats

from pipeline.compiled.arrays import Float64
from pipeline.truth.query import Answers

COLOUR_WEIGHTS: Final = np.array([[0.3], [0.3], [0.5], [0.5]])  # colours of the colour measure: one channel, (4, 1)


@dataclass(frozen=True)
class Error:
    """A mean squared error with its interval and the noise of the truth."""

    value: float  # MSE with the noise of the truth subtracted
    standard_error: float  # of `value`, from the spread over queries
    low: float  # lower end of the 95 % interval of `value`
    high: float
    measured: float  # MSE as measured
    noise: float  # mean squared standard error of the truth
    mean: float  # of the truth
    count: int  # queries (pixels)

    @property
    def relative_rmse(self) -> float:
        """Root of the MSE over the mean of the truth; NaN where that is 0."""
        return math.sqrt(max(self.value, 0.0)) / self.mean if self.mean > 0 else math.nan


def squared_error(
    values: npt.ArrayLike, truth: npt.ArrayLike, standard_error: npt.ArrayLike, resamples: int = 500
) -> Error:
    """Return the mean squared error of values, noise of the truth subtracted.

    All are (N, ...): one row a query or pixel, further axes are channels. With less than 2 bootstrap `resamples` the
    interval is value +- 1.96 standard errors.
    """
    t = np.asarray(truth, dtype=np.float64)
    t = t.reshape(len(t), -1)
    squared = (np.asarray(values, dtype=np.float64).reshape(t.shape) - t) ** 2
    variance = np.asarray(standard_error, dtype=np.float64).reshape(t.shape) ** 2
    measured, noise = float(squared.mean()), float(variance.mean())
    rows = (squared - variance).mean(axis=1)
    value, spread = float(rows.mean()), float(stats.sem(rows)) if len(rows) > 1 else 0.0
    low, high = value - 1.96 * spread, value + 1.96 * spread
    if resamples > 1 and spread != 0.0:
        ends = bootstrap((rows,), np.mean, resamples, 0).confidence_interval
        low, high = float(ends.low), float(ends.high)
    return Error(value, spread, low, high, measured, noise, float(t.mean()), len(rows))


def relative_weight(truth: npt.ArrayLike, epsilon: float) -> Float64:
    """Return 1 / sqrt(t^2 + epsilon <t>^2), in the truth's shape; the truth may not be zero everywhere."""
    t = np.asarray(truth, np.float64)
    return np.asarray(1.0 / np.sqrt(t**2 + epsilon * t.mean() ** 2))


def colour_error(values: npt.ArrayLike, answers: Answers, colours: Float64, resamples: int = 500) -> Error:
    """Return the mean squared error in colour of a method's components (N, 4), with the truth's `answers`.

    The `colours` of the components, (4, channels), or (N, 4, channels) if they differ, are those of
    `pipeline.scenes.shade`, or `COLOUR_WEIGHTS`; `resamples` as in `squared_error`.
    """
    seen, truth = (_coloured(np.asarray(parts, np.float64), colours) for parts in (values, answers.mean))
    return squared_error(seen, truth, colour_noise(answers, colours), resamples)


def most_error(values: npt.ArrayLike, answers: Answers) -> Error:
    """Return the error in the colour measure of 99 % of all queries, those of the largest errors left out.

    Arguments as in `colour_error`; the noise of the truth is subtracted without choosing by it.
    """
    seen, truth = (_coloured(np.asarray(x, np.float64), COLOUR_WEIGHTS) for x in (values, answers.mean))
    kept = np.argsort(np.abs(seen - truth)[:, 0], kind="stable")[: math.ceil(0.99 * len(seen))]
    return squared_error(seen[kept], truth[kept], colour_noise(answers, COLOUR_WEIGHTS)[kept], resamples=0)


def component_errors(values: npt.ArrayLike, answers: Answers) -> list[Error]:
    """Return the mean squared error of each component, in the order of `pipeline.truth.conventions.COMPONENTS`."""
    columns = zip(np.asarray(values).T, answers.mean.T, answers.standard_error.T, strict=True)
    return [squared_error(value, mean, error, resamples=0) for value, mean, error in columns]


def colour_noise(answers: Answers, colours: Float64) -> Float64:
    """Return the standard error of the truth in colour, (N, channels), components taken to be uncorrelated."""
    return np.asarray(np.sqrt(_coloured(answers.standard_error.astype(np.float64) ** 2, colours**2)))


def _coloured(components: Float64, colours: Float64) -> Float64:
    """Return components (N, 4) in colours (4, channels) or (N, 4, channels)."""
    return np.asarray(np.einsum("nj,jc->nc" if colours.ndim == 2 else "nj,njc->nc", components, colours))


def ratio(numerator: tuple[float, float], denominator: tuple[float, float]) -> tuple[float, float, float]:
    """Return the ratio of two measured means (value, standard error), both positive, and its 95 % interval.

    The interval is the delta method's in the logarithm: log r +- 1.96 sqrt((s_a/a)^2 + (s_b/b)^2). Methods that answer
    errors of the same queries are correlated, so it is wider than necessary.
    """
    (a, error_a), (b, error_b) = numerator, denominator
    spread = 1.96 * math.hypot(error_a / a, error_b / b)
    return a / b, a / b * math.exp(-spread), a / b * math.exp(spread)


def bootstrap(columns: tuple[npt.NDArray[Any], ...], statistic: Callable[..., Any], resamples: int, seed: int) -> Any:
    """Return scipy's percentile bootstrap of a statistic of columns, whose rows are drawn together."""
    return stats.bootstrap(
        columns, statistic, paired=True, vectorized=True, n_resamples=resamples, method="percentile",
        batch=max(1, 2_000_000 // len(columns[0])), rng=np.random.default_rng(seed),
    )  # fmt: skip
