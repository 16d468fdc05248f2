"""Trade-off of error against time and bytes: methods on the front, and the cheapest within a limit."""

from typing import Any, Final, Literal

import pandas as pd

from reports.over_seeds import LEAST, MOST
from reports.record import TRUTH
from reports.tables.summary import front, rows

Fault = Literal["error", "flicker"]  # relative RMSE of the colour, and distance of the flicker from the truth's

LIMITS: Final = (0.10, 0.05, 0.02, 0.01)
FAULTS: Final[dict[Fault, tuple[float, ...]]] = {"error": LIMITS, "flicker": (0.1, 0.01, 0.001)}
"""Limits that the page names the cheapest method for."""

_FRONTS: Final = {
    "front": ("ns", "error"),
    "front_flicker": ("ns", "flicker"),
    "front_bytes": ("bytes_stored", "error"),
}


def tradeoff_table(errors: pd.DataFrame, timing: pd.DataFrame, aliasing: pd.DataFrame | None = None) -> pd.DataFrame:
    """Return cost and faults of every method that answers for all fabrics of a role, and which fronts it is on.

    The frames are from `summary.error_table`, `summary.timing_table` and `summary.aliasing_table`.

    Columns: role, method, setting, fabrics; ns (median, a query of the fabrics with a name; of unseen fabrics on these
    alone, if any method was timed on them), error (relative RMSE of the colour, mean over fabrics; NaN where it is lost
    in the noise of the truth), error_least and error_most (range over trainings), bytes_stored, flicker (distance from
    the truth's); front (of error and time), front_flicker (of flicker and time), front_bytes (of error and bytes).
    """
    columns = ["role", "method", "setting", "fabrics", "ns", "error", "error_least", "error_most", "bytes_stored"]
    columns += ["flicker", *_FRONTS]
    if errors.empty or timing.empty:
        return pd.DataFrame(columns=columns)
    keys = ["method", "setting", "role"]
    names = {"median_ns": "ns"} | {f"colour_rrmse{end}": f"error{end}" for end in ("", LEAST, MOST)}
    moving = aliasing if aliasing is not None and len(aliasing) else pd.DataFrame(columns=[*keys, "flicker"])
    parts: list[pd.DataFrame] = []
    for role, group in errors.groupby("role", sort=False):
        whole = group[group["fabrics"] == group["fabrics"].max()]
        part = whole.merge(timing[timing["method"] != TRUTH], on=["method", "setting"])
        if role == "unseen" and part["unseen_ns"].notna().any():
            part["median_ns"] = part["unseen_ns"]
        part = part.merge(moving[[*keys, "flicker"]], on=keys, how="left").rename(columns=names)
        part["error"] = part["error"].where(part["error"] > 0)
        part["flicker"] = part["flicker"].astype(float).abs()
        parts.append(part.assign(**{name: front(part, *costs) for name, costs in _FRONTS.items()}).loc[:, columns])
    return pd.concat(parts, ignore_index=True)


def cheapest(table: pd.DataFrame, cost: str, **limits: float) -> Any | None:
    """Return the row of least cost whose columns are within all `limits`; None if there is none.

    Of equal costs the least of the limited columns counts, in their order.
    """
    within = table[table[cost].notna() & (table[[*limits]] <= pd.Series(limits)).all(axis=1)]
    return next(rows(within.sort_values([cost, *limits], kind="stable")), None)
