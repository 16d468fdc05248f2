"""Error against time: which methods nothing beats on both, and the cheapest within an error.

A point (time, error) is beaten by another that is nowhere worse and somewhere better. Those that nothing beats are the
front; equal points do not beat each other. What was not measured takes no part.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Final

import pandas as pd

from reports.record import TRUTH

LIMITS: Final = (0.10, 0.05, 0.02, 0.01)
"""Errors that the page names the cheapest method for."""

COLUMNS: Final = ("role", "method", "setting", "fabrics", "ns", "error", "bytes_stored", "front")


def front(points: Sequence[tuple[float, float]]) -> list[bool]:
    """Say which points are on the front.

    Parameters
    ----------
    points : sequence of (float, float)
        Time and error; less is better. Points with NaN or infinity are not on the front and beat nothing.

    Returns
    -------
    list of bool
    """
    on = [False] * len(points)
    measured = sorted((point, index) for index, point in enumerate(points) if all(map(math.isfinite, point)))
    last, lowest = (math.nan, math.nan), math.inf
    # From the fastest on: whatever is not better than all faster ones is beaten by one of them, or equals it.
    for point, index in measured:
        if point[1] < lowest or point == last:
            on[index], last, lowest = True, point, point[1]
    return on


def tradeoff_table(errors: pd.DataFrame, timing: pd.DataFrame) -> pd.DataFrame:
    """Return time and error of every method that answers for all fabrics of a role, and whether it is on the front.

    Parameters
    ----------
    errors, timing : DataFrame
        From `summary.error_table` and `summary.timing_table`.

    Returns
    -------
    DataFrame
        Columns: role, method, setting, fabrics; ns (median, a query), error (relative RMSE of the colour, mean over
        fabrics; NaN where it is lost in the noise of the truth), bytes_stored, front.
    """
    if errors.empty or timing.empty:
        return pd.DataFrame(columns=[*COLUMNS])
    timing = timing[timing["method"] != TRUTH]
    parts: list[pd.DataFrame] = []
    for _, group in errors.groupby("role", sort=False):
        whole = group[group["fabrics"] == group["fabrics"].max()]
        found = whole.merge(timing, on=["method", "setting"])
        found = found.rename(columns={"median_ns": "ns", "colour_rrmse": "error"})
        found["error"] = found["error"].where(found["error"] > 0)
        found["front"] = front(list(zip(found["ns"], found["error"], strict=True)))
        parts.append(found[[*COLUMNS]])
    return pd.concat(parts, ignore_index=True)


def cheapest(table: pd.DataFrame, limit: float) -> Any | None:
    """Return the row of least time among those of an error up to `limit`; None if there is none."""
    within = table[(table["error"] <= limit) & table["ns"].notna()]
    return None if within.empty else next(within.sort_values(["ns", "error"], kind="stable").itertuples())
