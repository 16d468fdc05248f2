"""Alternative texts of the plots, for screen readers: the words of `tables.toml`, and the lowest and highest values."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import pandas as pd

from reports.record import TRUTH
from reports.tables.number_format import display, listed, percent, plain, scientific, significant
from reports.tables.summary import parts_of, rows
from reports.tables.table import WORDS


def alt_texts(tables: Mapping[str, pd.DataFrame]) -> dict[str, str]:
    """Return the alternative text of every plot by its name, from the frames of a page."""
    tradeoff, timing, scenes = tables["tradeoff"], tables["timing"], tables["scenes"]
    flicker = tables["aliasing"].assign(distance=tables["aliasing"]["flicker"].abs())
    values = {
        "error-against-time": _fronts(tradeoff, "front"),
        "error-against-bytes": _fronts(tradeoff, "front_bytes"),
        "errors": _by_role(tables["errors"], "mse", scientific),
        "error-by-size": _ends(tables["by_size"], "colour", percent),
        "scenes": "".join(
            _ends(part, "mse", scientific, f" in {plain(name)}") for name, part in parts_of(scenes, "scene")
        ),
        "aliasing-against-time": _fronts(tradeoff, "front_flicker"),
        "aliasing": _by_role(flicker, "distance", scientific, " distance of the flicker"),
        "timing": _ends(timing[timing["method"] != TRUTH], "median_ns", lambda value: f"{significant(value)} ns"),
    }
    return {name: words["alt"] + values.get(name, "") for name, words in WORDS["plots"].items()}


def _fronts(table: pd.DataFrame, column: str) -> str:
    """Return the methods on a front, the cheapest first, in a sentence for each role."""
    sentences = []
    for role, group in parts_of(table, "role"):
        names = [display(row.method, row.setting) for row in rows(group[group[column].astype(bool)].sort_values("ns"))]
        if names:
            sentences.append(f" On the front, {role} fabrics: {listed(names)}.")
    return "".join(sentences)


def _by_role(table: pd.DataFrame, column: str, worded: Callable[[float], str], of: str = "") -> str:
    """Return the lowest and the highest value in a sentence for each role."""
    return "".join(_ends(group, column, worded, f"{of}, {role} fabrics") for role, group in parts_of(table, "role"))


def _ends(table: pd.DataFrame, column: str, worded: Callable[[float], str], where: str = "") -> str:
    """Return the lowest and the highest value of a column with their methods in a sentence; empty without values."""
    measured = table[table[column].notna()] if len(table) else table
    if measured.empty:
        return ""
    ordered = list(rows(measured.sort_values(column, kind="stable")))
    ends = [f"{display(row.method, row.setting)} ({worded(getattr(row, column))})" for row in (ordered[0], ordered[-1])]
    return f" Lowest{where}: {ends[0]}; highest: {ends[1]}."
