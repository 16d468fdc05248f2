"""Means of errors over fabrics and their intervals.

Unseen fabrics are a sample: others give other errors. The errors of a method on two fabrics differ by a factor, so the
mean is that of their logarithms. Named unseen fabrics count like random ones. Of several trainings the geometric mean
is taken too, of the means and of the ends of their intervals: an interval that is never too narrow.
"""

from __future__ import annotations

import math
from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt
import pandas as pd
from scipy import stats

from pipeline.truth.conventions import COMPONENTS
from reports.record import Metric

ERRORS: Final[tuple[Metric, ...]] = ("mse", "colour_rrmse", *(f"rrmse_{name}" for name in COMPONENTS))
"""Metrics on held-out queries that have a mean over fabrics."""


OVER_FABRICS: Final = tuple(f"{name}_fabrics" for name in ("ratio", *ERRORS))
"""Columns of `columns_over_fabrics` that are means."""


class OverFabrics(NamedTuple):
    """Geometric mean over fabrics, and the ends of its 95 % interval."""

    mean: float
    low: float
    high: float


def over_fabrics(values: npt.ArrayLike) -> OverFabrics:
    """Return the geometric mean of errors or ratios, one a fabric, and its 95 % interval over fabrics.

    Parameters
    ----------
    values : array_like (fabrics,)
        Figures of one method.

    Returns
    -------
    OverFabrics
        NaN if there is no figure, or one is not above 0, as an error that is lost in the noise of the truth. The
        interval of a single fabric is NaN.

    Notes
    -----
    Student's t interval of the mean of the logarithms: exp(m ± t_{.975, n-1} s / sqrt(n)), with n fabrics, and mean m
    and standard deviation s of the logarithms. It holds if the fabrics are drawn at random and the logarithms are
    normal.
    """
    figures = np.asarray(values, np.float64)
    if not len(figures) or not ((figures > 0) & np.isfinite(figures)).all():
        return OverFabrics(np.nan, np.nan, np.nan)
    logarithms = np.log(figures)
    mean = float(np.exp(logarithms.mean()))
    if len(figures) < 2:
        return OverFabrics(mean, np.nan, np.nan)
    reach = float(stats.t.ppf(0.975, len(figures) - 1) * stats.sem(logarithms))
    return OverFabrics(mean, mean * np.exp(-reach), mean * np.exp(reach))


def over_unseen(row: Any) -> bool:
    """Return whether a row of `summary.error_table` is of several unseen fabrics and has an interval over them."""
    return row.role == "unseen" and math.isfinite(row.ratio_fabrics_low)


def columns_over_fabrics(errors: pd.DataFrame, base: pd.DataFrame) -> dict[str, float]:
    """Return the columns of a method that are means over fabrics.

    Parameters
    ----------
    errors : DataFrame
        One row a fabric, with the columns `fabric` and `ERRORS`.
    base : DataFrame
        The same of point sampling at 2 points, or no rows.

    Returns
    -------
    dict
        For `ratio` (MSE of 2 points over the method's on the same fabric) and each of `ERRORS` the geometric mean
        <name>_fabrics and the ends of its 95 % interval, <name>_fabrics_low and <name>_fabrics_high.
    """
    other = base.set_index("fabric")["mse"].reindex(errors["fabric"])
    figures = {"ratio": other.to_numpy() / errors["mse"].to_numpy()}
    # A component that is nowhere seen on a fabric has no error there.
    figures |= {name: errors[name].dropna().to_numpy() for name in ERRORS if name in errors}
    found = {name: over_fabrics(figures.get(name, ())) for name in ("ratio", *ERRORS)}
    return {
        f"{name}_fabrics{end}": number
        for name, three in found.items()
        for end, number in zip(("", "_low", "_high"), three, strict=True)
    }
