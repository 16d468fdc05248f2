"""Sentences that sum up a table: the cheapest method within a limit, rivals at equal time, methods off the front."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import pandas as pd

from reports.measure.by_size import SIZES, WHOLE
from reports.tables.number_format import NO_BREAK, display, listed, significant
from reports.tables.summary import rows
from reports.tables.tradeoff import FLICKER_LIMITS, LIMITS, cheapest


def cheapest_sentences(table: pd.DataFrame, limits: Sequence[float] = LIMITS) -> list[str]:
    """Return for each role the cheapest method within each error, from `tradeoff.tradeoff_table`.

    Errors with the same cheapest method are named together.
    """
    return [
        f"{str(role).capitalize()} fabrics, error of the colour: {_for_errors(group, limits, 'ns')}."
        for role, group in table.groupby("role", sort=False)
    ]


def least_flicker_sentences(table: pd.DataFrame) -> list[str]:
    """Return for each role the cheapest method within each distance of the flicker from the truth's."""
    return [
        f"{str(role).capitalize()} fabrics, flicker: {_for_flicker(group, 'ns')}."
        for role, group in table.groupby("role", sort=False)
        if group["flicker"].notna().any()
    ]


def scene_sentences(table: pd.DataFrame) -> dict[str, list[str]]:
    """Return for each scene the cheapest methods within errors of the colour and of flicker, and errors in the noise.

    Parameters
    ----------
    table : DataFrame
        From `summary.scene_table`.
    """
    result = {}
    # An error in the noise may be as large as the upper end of its interval.
    lost = table["colour_rrmse"] == 0
    error = table["colour_rrmse"].where(~lost, table["colour_rrmse_high"])
    table = table.assign(flicker=table["flicker"].abs(), error=error, lost=lost)
    for scene, group in table.groupby("scene", sort=False) if len(table) else ():
        timed, found = group[group["frame_time"].notna()], []
        if len(timed):
            within = _for_errors(timed, LIMITS[:3], "frame_time")
            found.append(f"Error of the colour: {within}.")
        if timed["flicker"].notna().any():
            found.append(f"Flicker: {_for_flicker(timed, 'frame_time')}.")
        names = [display(row.method, row.setting) for row in rows(group[group["lost"]])]
        if names:
            found.append(f"In the noise of the truth: the error of {listed(names)}.")
        result[str(scene)] = found
    return result


def _for_errors(table: pd.DataFrame, limits: Sequence[float], cost: str) -> str:
    """Return the cheapest method within each `error`."""
    return _cheapest(table, {limit: f"{100 * limit:g} %" for limit in limits}, cost, "error", "{}")


def _for_flicker(table: pd.DataFrame, cost: str) -> str:
    """Return the cheapest method within each distance of `flicker` from the truth's."""
    named = {limit: f"{limit:g}".removeprefix("0") for limit in FLICKER_LIMITS}
    return _cheapest(table, named, cost, "flicker", "{} of the truth")


def _cheapest(table: pd.DataFrame, limits: Mapping[float, str], cost: str, fault: str, where: str) -> str:
    """Return the cheapest method within each limit; limits with the same method are named together."""
    said: dict[str, list[str]] = {}
    for limit, name in limits.items():
        best = cheapest(table, limit, cost, fault)
        text = f"{display(best.method, best.setting)} ({_cost(getattr(best, cost), cost)})" if best else ""
        said.setdefault(text, []).append(name)
    parts = [f"cheapest within {where.format(listed(found))}: {text}" for text, found in said.items() if text]
    if missed := said.get(""):
        parts.append(f"no method reaches {where.format(' or '.join(missed))}")
    return "; ".join(parts)


def _cost(value: float, cost: str) -> str:
    """Return the time of a query or of a frame."""
    return f"{value:,.0f}{NO_BREAK}ns" if cost == "ns" else f"{significant(value)}{NO_BREAK}ms"


def equal_time_sentences(table: pd.DataFrame, measure: str = "colour") -> list[str]:
    """Return for each method the rivals with a lower error in the same time, and where, from `equal_time_table`."""
    result = []
    found = table[(table["measure"] == measure) & table["ratio"].notna()]
    for (method, setting), group in found.groupby(["method", "setting"], sort=False):
        name, lost = display(str(method), str(setting)), group[group["ratio"] < 1.0]
        if len(lost):
            parts = [_where(str(rival), part) for rival, part in lost.groupby("rival", sort=False)]
            result.append(f"{name}: rivals with a lower error in the same time: {'; '.join(parts)}.")
        else:
            (closest,) = rows(group.nsmallest(1, "ratio"))
            near = f"{display(closest.rival)} with {closest.ratio:.2f}× its error {_size(closest.size)}"
            result.append(f"{name}: no rival has a lower error in the same time at any size; the closest is {near}.")
    return result


def _where(rival: str, lost: pd.DataFrame) -> str:
    """Return the sizes at which a rival has a lower error, and its lowest ratio."""
    sizes = [size for size in lost["size"] if size != WHOLE]
    places = (
        "at every size"
        if len(sizes) == len(SIZES)
        else f"at footprints {listed(sizes)}"
        if sizes
        else "over all sizes together"
    )
    return f"{display(rival)} {places} (ratio down to {lost['ratio'].min():.2f}×)"


def _size(name: str) -> str:
    return "over all sizes" if name == WHOLE else f"at footprints {name}"


def beaten(table: pd.DataFrame) -> dict[str, list[str]]:
    """Return for each role the methods without a setting on the front."""
    result = {}
    for role, group in table.groupby("role", sort=False):
        best = set(group.loc[group["front"], "method"])
        result[str(role)] = [display(name) for name in dict.fromkeys(group["method"]) if name not in best]
    return result
