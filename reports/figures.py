"""The plots of a page, one function each: `plot(scheme, data) -> Figure`, drawn by `reports.style.render`.

A method has one colour everywhere. Filled marks are fabrics seen in training, open ones unseen.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke
from matplotlib.ticker import NullFormatter, NullLocator

from reports.aliasing import HALF_NYQUIST
from reports.record import TRUTH
from reports.style import Scheme, display, new_figure
from reports.summary import PAPER, of_baseline, rows

_ROLES: Final = ("seen", "unseen")


def errors(scheme: Scheme, table: pd.DataFrame, fabrics: pd.DataFrame) -> Figure:
    """Draw the MSE of every method: each fabric as a faint dot, the mean of a role with its 95 % interval.

    Parameters
    ----------
    table : DataFrame
        From `summary.error_table`.
    fabrics : DataFrame
        From `summary.fabric_table`.
    """
    roles = [role for role in _ROLES if role in set(table["role"])]
    methods = _methods(table)
    figure, panels = new_figure(4.6 * len(roles), 1.1 + 0.3 * len(methods), len(roles), sharey=True)
    colours = scheme.colours(table["method"])
    for axes, role in zip(panels, roles, strict=True):
        for row, (method, setting) in enumerate(methods):
            single = _values(fabrics, role, method, setting)
            axes.scatter(single, np.full(len(single), row), s=16, color=colours[method], alpha=0.3, linewidths=0)
            found = table[(table["method"] == method) & (table["setting"] == setting) & (table["role"] == role)]
            for mean in rows(found):
                _mark(axes, mean.mse, row, colours[method], role, xerr=_bounds(mean.mse, mean.low, mean.high))
        noise = table.loc[table["role"] == role, "truth_noise"].mean()
        axes.axvline(noise, color=scheme.muted, linewidth=0.9, linestyle=(0, (4, 3)))
        axes.annotate(
            "noise of the truth, subtracted",
            (noise, 1.0),
            xytext=(4, -2),
            xycoords=("data", "axes fraction"),
            textcoords="offset points",
            va="top",
            fontsize=8,
            color=scheme.muted,
        )
        axes.set(title=f"{role.capitalize()} fabrics", xlabel="MSE, linear RGB", xscale="log")
        axes.grid(axis="y", visible=False)
    _name_rows(panels[0], methods)
    return figure


def error_against_time(scheme: Scheme, table: pd.DataFrame, timing: pd.DataFrame) -> Figure:
    """Draw MSE against the time of a query, both logarithmic, with the front of methods that nothing beats on both.

    The arrow is the paper's own ratio, from our 2 points: 4.1 times lower MSE at 0.83 times the time.
    """
    roles = [role for role in _ROLES if role in set(table["role"])]
    figure, panels = new_figure(4.8 * len(roles), 4.2, len(roles), sharey=True)
    colours = scheme.colours(table["method"])
    for axes, role in zip(panels, roles, strict=True):
        joined = table[table["role"] == role].merge(timing, on=["method", "setting"])
        joined = joined[joined["mse"] > 0]
        costs = list(zip(joined["median_ns"], joined["mse"], strict=True))
        front = sorted(p for p in costs if not any(q != p and q[0] <= p[0] and q[1] <= p[1] for q in costs))
        axes.plot(*zip(*front, strict=True), color=scheme.muted, linewidth=1.0, zorder=1) if front else None
        for row in rows(joined):
            spread = _bounds(row.median_ns, row.first_quartile_ns, row.third_quartile_ns)
            _mark(axes, row.median_ns, row.mse, colours[row.method], role, xerr=spread)
            points = row.setting.startswith("k = ")
            axes.annotate(
                row.setting.removeprefix("k = ") if points else display(row.method, row.setting),
                (row.median_ns, row.mse), xytext=(-8, -8) if points else (6, 6), textcoords="offset points",
                ha="right" if points else "left", va="top" if points else "bottom", fontsize=9,
                fontweight="normal" if points else "bold", color=colours[row.method],
                path_effects=[withStroke(linewidth=2.5, foreground=scheme.ground)],
            )  # fmt: skip
        for row in rows(joined[of_baseline(joined)]):
            _paper_arrow(axes, scheme, row.median_ns, row.mse)
        axes.set(
            title=f"{role.capitalize()} fabrics", xlabel="time of a query, ns (one process, side by side)",
            xscale="log", yscale="log",
        )  # fmt: skip
        axes.margins(0.16)
    panels[0].set_ylabel("MSE, linear RGB")
    return figure


def aliasing(scheme: Scheme, table: pd.DataFrame) -> Figure:
    """Draw flicker and excess energy of every method; 0 is the truth."""
    methods = _methods(table)
    figure, panels = new_figure(9.2, 1.1 + 0.3 * len(methods), 2, sharey=True)
    colours = scheme.colours(table["method"])
    columns = {"flicker": "Flicker", "excess_energy": "Excess energy at high frequencies"}
    for axes, (column, title) in zip(panels, columns.items(), strict=True):
        smallest = float(table[column].abs().replace(0.0, math.nan).min())
        threshold = 10 ** math.floor(math.log10(smallest)) if math.isfinite(smallest) else 1e-6
        axes.set_xscale("symlog", linthresh=max(threshold, 1e-5))
        axes.axvline(0, color=scheme.muted, linewidth=1.0)
        for found in rows(table):
            row = methods.index((found.method, found.setting))
            value = getattr(found, column)
            axes.plot([0, value], [row, row], color=colours[found.method], linewidth=1.6, alpha=0.35)
            _mark(axes, value, row, colours[found.method], found.role)
        axes.set(title=title, xlabel="variance beyond the truth's, over its squared mean")
        axes.xaxis.set_minor_locator(NullLocator())
        axes.grid(axis="y", visible=False)
    _name_rows(panels[0], methods)
    return figure


def spectra(scheme: Scheme, curves: Mapping[tuple[str, str], Sequence[tuple[float, float]]]) -> Figure:
    """Draw the power spectrum of the receding plane by every method beside the truth's."""
    figure, (axes,) = new_figure(9.2, 3.8)
    colours = scheme.colours(method for method, _ in curves)
    axes.axvspan(HALF_NYQUIST, 0.5, color=scheme.line, alpha=0.35, linewidth=0)
    axes.annotate(
        "counted as aliasing where it exceeds the truth", (HALF_NYQUIST, 0.98), xytext=(6, 0),
        xycoords=("data", "axes fraction"), textcoords="offset points", va="top", fontsize=8, color=scheme.muted,
    )  # fmt: skip
    labels = []
    for (method, setting), curve in sorted(curves.items(), key=lambda item: item[0][0] == TRUTH):
        points = np.array([point for point in curve if point[1] > 0])
        if not len(points):
            continue
        is_truth = method == TRUTH
        axes.plot(*points.T, color=colours[method], linewidth=2.6 if is_truth else 1.3, alpha=1 if is_truth else 0.85)
        labels.append((points[-1][1], setting.removeprefix("k = ") or display(method), method))
    # Labels stand at the ends of their curves, moved up where they would touch.
    lowest, step = 0.0, (max(end for end, _, _ in labels) / min(end for end, _, _ in labels)) ** (1 / 22)
    for end, label, method in sorted(labels):
        lowest = max(end, lowest * step)
        weight = "bold" if method == TRUTH else "normal"
        axes.annotate(label, (0.505, lowest), va="center", fontsize=8.5, color=colours[method], fontweight=weight)
    axes.set(
        xlim=(0, 0.55), yscale="log", xlabel="frequency, cycles a pixel",
        ylabel="power over the truth's squared mean", xticks=[0, 0.1, 0.2, 0.25, 0.3, 0.4, 0.5],
    )  # fmt: skip
    axes.yaxis.set_minor_formatter(NullFormatter())
    return figure


def timing(scheme: Scheme, table: pd.DataFrame) -> Figure:
    """Draw the time of a query: median and quartiles."""
    methods = _methods(table)
    figure, (axes,) = new_figure(9.2, 1.0 + 0.3 * len(methods))
    colours = scheme.colours(table["method"])
    for row, found in enumerate(rows(table)):
        colour = colours[found.method]
        spread = _bounds(found.median_ns, found.first_quartile_ns, found.third_quartile_ns)
        _mark(axes, found.median_ns, row, colour, "seen", xerr=spread)
        axes.annotate(
            _nanoseconds(found.median_ns), (found.third_quartile_ns, row), xytext=(8, 0), textcoords="offset points",
            va="center", fontsize=9, color=scheme.muted,
        )  # fmt: skip
    axes.set(xscale="log", xlabel="time of a query, ns: median and quartiles of interleaved calls")
    axes.margins(x=0.12)
    axes.grid(axis="y", visible=False)
    _name_rows(axes, methods)
    return figure


def _methods(table: pd.DataFrame) -> list[tuple[str, str]]:
    return list(dict.fromkeys(zip(table["method"], table["setting"], strict=True)))


def _values(fabrics: pd.DataFrame, role: str, method: str, setting: str) -> pd.Series[float]:
    """Return a method's MSE on each fabric of a role that it covers."""
    label = f"{method} {setting}".strip()
    if label not in fabrics:
        return pd.Series(dtype=float)
    return fabrics.loc[fabrics["role"] == role, label].dropna()


def _name_rows(axes: Axes, methods: Sequence[tuple[str, str]]) -> None:
    axes.set_yticks(range(len(methods)), [display(*method) for method in methods])
    axes.set_ylim(len(methods) - 0.4, -0.6)
    axes.tick_params(axis="y", length=0)


def _mark(axes: Axes, x: float, y: float, colour: str, role: str, **bars: Any) -> None:
    """Put a method's mark: filled where seen, open where unseen."""
    face = colour if role == "seen" else "none"
    axes.errorbar(
        x, y, fmt="o", markersize=7, color=colour, markerfacecolor=face, markeredgewidth=1.6, elinewidth=1.6, **bars
    )


def _bounds(value: float, low: float, high: float) -> list[list[float]]:
    return [[max(value - low, 0.0)], [max(high - value, 0.0)]]


def _paper_arrow(axes: Axes, scheme: Scheme, time: float, mse: float) -> None:
    """Draw what the paper's ratios would mean from here."""
    lower, faster = PAPER
    target = (time * faster, mse / lower)
    axes.annotate(
        "", target, xytext=(time, mse),
        arrowprops={"arrowstyle": "-|>", "color": scheme.muted, "linestyle": (0, (3, 2)), "shrinkA": 6, "shrinkB": 0},
    )  # fmt: skip
    axes.annotate(
        f"the paper's network:\n{lower}× lower at {faster}× the time", target, xytext=(-4, -5),
        textcoords="offset points", ha="center", va="top", fontsize=8, color=scheme.muted,
    )  # fmt: skip


def _nanoseconds(value: float) -> str:
    return f"{value:,.0f} ns" if value < 1e4 else f"{value / 1e3:,.1f} µs"
