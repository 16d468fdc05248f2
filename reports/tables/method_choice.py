"""Which method a scene should be rendered with: what each would err and take there, from what was measured.

Errors and times by the size of footprints (`reports.measure.by_size`) hold for any scene: with shares p of its
questions in classes of size,

    error^2 = sum p error_size^2,   time = questions (sum p ns_size + share of others' questions * ns of quadrature)

and so a scene that no benchmark has rendered has a front of its own. Questions that a method does not know fall back to
quadrature, whose error is taken as it is measured on the scene's own questions. What a method errs because it takes
ellipses for round and curved cloth for flat is not in this prediction; where a scene was rendered by the benchmark
(`reports.measure.scene.scene_errors`), what was measured there takes its place.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import pandas as pd

from reports.measure.by_size import WHOLE
from reports.tables.pareto_front import front
from reports.tables.summary import rows

COLUMNS = ("method", "setting", "error", "ms", "fallback", "known")

MEASURED, PREDICTED = "measured here", "from its footprints"
"""How the numbers of a row are known."""


def predictions(
    sizes: pd.DataFrame,
    shares: Mapping[str, float],
    questions: int,
    fallback: Mapping[str, float],
    quadrature: tuple[float, float],
) -> pd.DataFrame:
    """Return what every method would err and take in a scene.

    Parameters
    ----------
    sizes : DataFrame
        From `equal_time.size_table`.
    shares : mapping
        Share of the scene's questions in each class of footprints.
    questions : int
        Questions of a frame.
    fallback : mapping
        Share of the questions that each method leaves to quadrature; methods without an entry are left out.
    quadrature : (float, float)
        Error of the quadrature and its nanoseconds a question.

    Returns
    -------
    DataFrame
        Columns: method, setting; error (relative RMSE of the colour), ms (a frame on one thread), fallback, known,
        front. Methods that were not measured in a class that occurs are left out.
    """
    asked = {size: share for size, share in shares.items() if share > 0}
    lines = []
    for (method, setting), group in sizes[sizes["size"] != WHOLE].groupby(["method", "setting"], sort=False):
        by_size = {row.size: row for row in rows(group)}
        if method not in fallback or not set(asked) <= set(by_size):
            continue
        left, (error, ns) = fallback[str(method)], quadrature
        squared = sum(share * by_size[size].colour ** 2 for size, share in asked.items())
        own = sum(share * by_size[size].ns for size, share in asked.items())
        total = math.sqrt((1.0 - left) * squared + left * error**2)
        time = 1e-6 * questions * ((1.0 - left) * own + left * ns)
        lines.append((method, setting, total, time, left, PREDICTED))
    return _with_front(pd.DataFrame(lines, columns=list(COLUMNS)))


def with_measured(table: pd.DataFrame, scenes: pd.DataFrame, scene: str) -> pd.DataFrame:
    """Return predictions with what was measured in the scene itself in their place, from `summary.scene_table`."""
    here = scenes[(scenes["scene"] == scene) & scenes["colour_rrmse"].notna() & scenes["frame_time"].notna()]
    names = {"colour_rrmse": "error", "frame_time": "ms", "fallback_share": "fallback"}
    measured = here.rename(columns=names).assign(known=MEASURED)[list(COLUMNS)]
    known = set(zip(measured["method"], measured["setting"], strict=True))
    others = [key not in known for key in zip(table["method"], table["setting"], strict=True)]
    parts = [part for part in (measured, table.loc[others, list(COLUMNS)]) if len(part)]
    return _with_front(pd.concat(parts, ignore_index=True) if parts else table)


def _with_front(table: pd.DataFrame) -> pd.DataFrame:
    """Add the column `front` and sort by time."""
    found = table.assign(front=front(list(zip(table["ms"], table["error"], strict=True))))
    return found.sort_values("ms", kind="stable", ignore_index=True)


def of_method(table: pd.DataFrame, method: str) -> pd.DataFrame:
    """Return the rows of one method, which is on its own front."""
    return _with_front(table.loc[table["method"] == method, list(COLUMNS)])


def cheapest(table: pd.DataFrame, error: float = math.inf, ms: float = math.inf) -> Any | None:
    """Return the row that meets a wish: within both limits, of least time; of least error if only time is limited.

    None if there is none.
    """
    within = table[(table["error"] <= error) & (table["ms"] <= ms)]
    if within.empty:
        return None
    order = ["error", "ms"] if math.isinf(error) else ["ms", "error"]
    return next(rows(within.sort_values(order, kind="stable")))


def nearest(table: pd.DataFrame, error: float, ms: float) -> pd.DataFrame:
    """Return the points of the front on either side of a wish that cannot be met: fast enough, and exact enough."""
    best = table[table["front"]]
    fast = best[best["ms"] <= ms].nsmallest(1, "error")
    exact = best[best["error"] <= error].nsmallest(1, "ms")
    found = pd.concat([fast, exact]).drop_duplicates()
    return found if len(found) else pd.concat([best.nsmallest(1, "ms"), best.nsmallest(1, "error")]).drop_duplicates()
