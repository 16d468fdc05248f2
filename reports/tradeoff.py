"""Error against time: which methods nothing beats on both, and the cheapest within an error."""

from __future__ import annotations

from typing import Any, Final

import pandas as pd

from reports.front import front
from reports.record import TRUTH

LIMITS: Final = (0.10, 0.05, 0.02, 0.01)
"""Errors that the page names the cheapest method for."""

COLUMNS: Final = ("role", "method", "setting", "fabrics", "ns", "error", "bytes_stored", "front")


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
