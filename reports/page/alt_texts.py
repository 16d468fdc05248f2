"""Alternative texts of the plots, for screen readers: kind of plot, axes, and the lowest and highest values."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Final

import pandas as pd

from reports.record import TRUTH
from reports.tables.number_format import display, listed, percent, plain, scientific, significant
from reports.tables.summary import rows

PLOT_TITLES: Final = {
    "error-against-time": "error of the colour against time",
    "error-against-bytes": "error of the colour against bytes stored",
    "errors": "mean squared error",
    "error-by-size": "error against time by size of the footprint",
    "scenes": "errors in scenes against time",
    "aliasing-against-time": "flicker against time",
    "aliasing": "flicker and excess energy",
    "spectra": "power spectrum of the receding plane",
    "timing": "time of a query",
}
"""Name of every plot."""


def alt_texts(tables: Mapping[str, pd.DataFrame]) -> dict[str, str]:
    """Return the alternative text of every plot by its name, from the tables of a page."""
    tradeoff, errors, timing = tables["tradeoff"], tables["errors"], tables["timing"]
    aliasing, scenes = tables["aliasing"], tables["scenes"]
    by_size, flicker = tables["by_size"], aliasing.assign(distance=aliasing["flicker"].abs())
    timed = timing[timing["method"] != TRUTH]
    return {
        "error-against-time": "Curves of the relative RMSE of the colour over the time of a query, both logarithmic."
        + _fronts(tradeoff, "front"),
        "error-against-bytes": "Curves of the relative RMSE of the colour over the bytes stored for one fabric, both "
        "logarithmic." + _fronts(tradeoff, "front_bytes"),
        "errors": "Mean squared error of every method with its 95 % interval, and of every fabric as a faint mark; "
        "a broad bar is the range over trainings." + _by_role(errors, "mse", scientific),
        "error-by-size": "Curves of the relative RMSE over the time of a query, a column for each size of the "
        "footprint; colour above, specular part below." + _ends(by_size, "colour", percent),
        "scenes": "MSE, HDR-FLIP and distance of the flicker over the time of a frame, a column for each scene."
        + "".join(
            _ends(group, "mse", scientific, f" in {plain(str(scene))}") for scene, group in _groups(scenes, "scene")
        ),
        "aliasing-against-time": "Curves of the flicker’s distance from the truth over the time of a query, both "
        "logarithmic." + _fronts(tradeoff, "front_flicker"),
        "aliasing": "Flicker and excess energy of every method beyond the truth; the truth is the line at 0."
        + _by_role(flicker, "distance", scientific, " distance of the flicker"),
        "spectra": "Power of the receding plane over the frequency in cycles a pixel, one curve a method; the truth is "
        "the broad curve. Power above the truth’s beyond .25 cycles a pixel counts as aliasing.",
        "timing": "Median time of a query by every method, with quartiles."
        + _ends(timed, "median_ns", lambda value: f"{significant(value)} ns"),
    }


def _groups(table: pd.DataFrame, column: str) -> list[tuple[Any, pd.DataFrame]]:
    return list(table.groupby(column, sort=False)) if len(table) else []


def _fronts(table: pd.DataFrame, column: str) -> str:
    """Return the methods on a front, the cheapest first, in a sentence for each role."""
    sentences = []
    for role, group in _groups(table, "role"):
        names = [display(row.method, row.setting) for row in rows(group[group[column].astype(bool)].sort_values("ns"))]
        if names:
            sentences.append(f" On the front, {role} fabrics: {listed(names)}.")
    return "".join(sentences)


def _by_role(table: pd.DataFrame, column: str, worded: Callable[[float], str], of: str = "") -> str:
    """Return the lowest and the highest value in a sentence for each role."""
    return "".join(_ends(group, column, worded, f"{of}, {role} fabrics") for role, group in _groups(table, "role"))


def _ends(table: pd.DataFrame, column: str, worded: Callable[[float], str], where: str = "") -> str:
    """Return the lowest and the highest value of a column with their methods in a sentence; empty without values."""
    measured = table[table[column].notna()] if len(table) else table
    if measured.empty:
        return ""
    ordered = list(rows(measured.sort_values(column, kind="stable")))
    ends = [f"{display(row.method, row.setting)} ({worded(getattr(row, column))})" for row in (ordered[0], ordered[-1])]
    return f" Lowest{where}: {ends[0]}; highest: {ends[1]}."
