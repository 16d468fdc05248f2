"""Choice of a method for a scene: predicted error and time of each method, from measurements.

Errors and times by the size of footprints (`reports.measure.by_size`) hold for any scene. With the shares p of its
queries in classes of size and the fallback share q of the method,

    error^2 = (1 - q) sum p error_size^2 + q error_fallback^2
    time = queries ((1 - q) sum p ns_size + q ns_fallback)

and so there is a front of methods for a scene that no benchmark has rendered. Error and time of the fallback are
measured on the scene's own queries. The error of a method that takes ellipses for round and curved cloth for flat is
not in this prediction. If the benchmark rendered the scene (`reports.measure.scene.scene_errors`), its measurements
replace the prediction.
"""

import math
from collections.abc import Mapping

import pandas as pd

from reports.measure.by_size import WHOLE
from reports.tables.summary import front, rows

_COLUMNS = ("method", "setting", "error", "ms", "fallback", "known")

MEASURED, PREDICTED = "measured here", "from its footprints"  # how the numbers of a row are known


def predictions(
    sizes: pd.DataFrame,
    shares: Mapping[str, float],
    queries: int,
    fallback_shares: Mapping[str, float],
    fallback_cost: tuple[float, float],
) -> pd.DataFrame:
    """Return the predicted error and time of every method in a scene.

    `sizes` is from `equal_time.size_table`, `shares` are those of the scene's queries in each class of footprints,
    `queries` those of a frame. `fallback_cost` is the error of the fallback and its nanoseconds a query. Left out are
    methods without a fallback share, and those that were not measured in a class that occurs.

    Columns: method, setting; error (relative RMSE of the colour), ms (a frame on one thread), fallback, known, front.
    """
    present = {size: share for size, share in shares.items() if share > 0}
    lines = []
    for (method, setting), group in sizes[sizes["size"] != WHOLE].groupby(["method", "setting"], sort=False):
        by_size = {row.size: row for row in rows(group)}
        if method not in fallback_shares or not set(present) <= set(by_size):
            continue
        left, (error, ns) = fallback_shares[str(method)], fallback_cost
        squared = sum(share * by_size[size].colour ** 2 for size, share in present.items())
        own = sum(share * by_size[size].ns for size, share in present.items())
        total = math.sqrt((1.0 - left) * squared + left * error**2)
        time = 1e-6 * queries * ((1.0 - left) * own + left * ns)
        lines.append((method, setting, total, time, left, PREDICTED))
    return _with_front(pd.DataFrame(lines, columns=list(_COLUMNS)))


def with_measured(table: pd.DataFrame, scenes: pd.DataFrame, scene: str) -> pd.DataFrame:
    """Return predictions, replaced by measurements in the scene itself where there are any (`summary.scene_table`)."""
    here = scenes[(scenes["scene"] == scene) & scenes["colour_rrmse"].notna() & scenes["frame_time"].notna()]
    names = {"colour_rrmse": "error", "frame_time": "ms", "fallback_share": "fallback"}
    measured = here.rename(columns=names).assign(known=MEASURED)[list(_COLUMNS)]
    known = set(zip(measured["method"], measured["setting"], strict=True))
    others = [key not in known for key in zip(table["method"], table["setting"], strict=True)]
    parts = [part for part in (measured, table.loc[others, list(_COLUMNS)]) if len(part)]
    return _with_front(pd.concat(parts, ignore_index=True) if parts else table)


def _with_front(table: pd.DataFrame) -> pd.DataFrame:
    """Add the column `front` and sort by time."""
    marked = table.assign(front=front(table, "ms", "error"))
    return marked.sort_values("ms", kind="stable", ignore_index=True)


def of_method(table: pd.DataFrame, method: str) -> pd.DataFrame:
    """Return the rows of one method, which is on its own front."""
    return _with_front(table.loc[table["method"] == method, list(_COLUMNS)])


def nearest(table: pd.DataFrame, error: float, ms: float) -> pd.DataFrame:
    """Return the points of the front nearest to limits that no method meets: fast enough, and exact enough."""
    best = table[table["front"]]
    fast = best[best["ms"] <= ms].nsmallest(1, "error")
    exact = best[best["error"] <= error].nsmallest(1, "ms")
    points = pd.concat([fast, exact]).drop_duplicates()
    return points if len(points) else pd.concat([best.nsmallest(1, "ms"), best.nsmallest(1, "error")]).drop_duplicates()
