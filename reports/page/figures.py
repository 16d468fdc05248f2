"""Plots of errors, aliasing, spectra and times: `plot(scheme, data) -> Figure`, for `render`; and their style.

Plots of errors against costs are in `reports.page.front_figures`. A method has one colour and one mark in all plots.
Filled marks are fabrics seen in training, open marks unseen ones.
"""

import io
import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Final

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, NullFormatter, NullLocator

from reports.measure.aliasing import HALF_NYQUIST
from reports.page.colours import Marker, Scheme
from reports.record import TRUTH
from reports.tables.number_format import display
from reports.tables.summary import BASELINE, rows

DPI: Final = 200
NARROWEST_PLOT: Final = 7.6  # inches: the legend needs it
ROW: Final = 0.22  # height of a method's row, in inches
SHOWN_ROLES: Final = ("seen", "unseen")
_MOST_DECADES: Final = 5  # whose labels fit under half a figure
_MARK_EVERY: Final = 9  # points of a spectrum; one curve's marks are shifted against the next one's


def render(plot: Callable[..., Figure], scheme: Scheme, *data: Any) -> bytes:
    """Return what ``plot(scheme, *data)`` draws, as PNG bytes on a transparent ground; equal data give equal bytes."""
    buffer = io.BytesIO()
    with mpl.rc_context(_parameters(scheme)):
        plot(scheme, *data).savefig(buffer, format="png", transparent=True, metadata={"Software": None})
    return buffer.getvalue()


def new_figure(
    width: float, height: float, columns: int = 1, sharey: bool = False, lines: int = 1
) -> tuple[Figure, list[Axes]]:
    """Return a figure of `columns` axes side by side in `lines`, `width` by `height` inches; `sharey` of a line."""
    figure = Figure(figsize=(width, height), dpi=DPI, layout="constrained")
    axes = figure.subplots(lines, columns, sharey="row" if sharey else False, squeeze=False)
    return figure, list(axes.ravel())


def _parameters(scheme: Scheme) -> dict[Any, Any]:
    ticks = {"color": scheme.line, "labelcolor": scheme.ink, "minor.size": 0}
    return {
        "font.size": 10, "text.color": scheme.ink, "legend.frameon": False,
        "axes.labelcolor": scheme.muted, "axes.edgecolor": scheme.line, "axes.grid": True, "axes.axisbelow": True,
        "axes.spines.top": False, "axes.spines.right": False, "grid.color": scheme.line, "grid.linewidth": 0.6,
        "axes.titlecolor": scheme.ink, "axes.titlesize": 11, "axes.titleweight": "bold", "axes.titlelocation": "left",
        "axes.titlepad": 10, **{f"{axis}tick.{name}": look for axis in "xy" for name, look in ticks.items()},
    }  # fmt: skip


def errors(scheme: Scheme, table: pd.DataFrame, fabrics: pd.DataFrame) -> Figure:
    """Draw the MSE of every method: each fabric as a faint dot, the mean of a role with its 95 % interval.

    A broad bar is the range of that mean over trainings. The frames are from `summary.error_table` and
    `summary.fabric_table`.
    """
    roles = [role for role in SHOWN_ROLES if role in set(table["role"])]
    places, width = _places(table), max(4.6 * len(roles), NARROWEST_PLOT)
    figure, panels = new_figure(width, 1.1 + ROW * _height(places), len(roles), sharey=True)
    colours = scheme.colours(table["method"])
    for axes, role in zip(panels, roles, strict=True):
        for (method, setting), row in places.items():
            column = fabrics.reindex(columns=[f"{method} {setting}".strip()]).iloc[:, 0]
            single = column[fabrics["role"] == role].dropna()
            axes.scatter(single, np.full(len(single), row), s=16, color=colours[method], alpha=0.3, linewidths=0)
            own = table[(table["method"] == method) & (table["setting"] == setting) & (table["role"] == role)]
            for mean in rows(own):
                if mean.mse_least < mean.mse_most:
                    ends = [mean.mse_least, mean.mse_most]
                    axes.plot(ends, [row, row], lw=7, alpha=0.3, color=colours[method], solid_capstyle="butt")
                spread = _bounds(mean.mse, mean.low, mean.high)
                _mark(axes, mean.mse, row, colours[method], role, scheme.marker(method), xerr=spread)
        noise = table.loc[table["role"] == role, "truth_noise"].mean()
        axes.axvline(noise, color=scheme.muted, linewidth=0.9, linestyle=(0, (4, 3)))
        # Above the first row no mark can lie.
        _remark(axes, scheme, "noise of the truth (subtracted)", (noise, 1.0), (4, -2))
        axes.set(title=f"{role.capitalize()} fabrics", xlabel="MSE, linear RGB", xscale="log")
        axes.grid(axis="y", visible=False)
    _name_rows(panels[0], places, above=0.5)
    return figure


def aliasing(scheme: Scheme, table: pd.DataFrame) -> Figure:
    """Draw flicker and excess energy of every method; 0 is the truth."""
    places = _places(table)
    figure, panels = new_figure(9.2, 1.1 + ROW * _height(places), 2, sharey=True)
    colours = scheme.colours(table["method"])
    columns = {"flicker": "Flicker", "excess_energy": "Excess energy at high frequencies"}
    for axes, (column, title) in zip(panels, columns.items(), strict=True):
        smallest = float(table[column].abs().replace(0.0, math.nan).min())
        threshold = max(10 ** math.floor(math.log10(smallest)), 1e-5) if math.isfinite(smallest) else 1e-5
        axes.set_xscale("symlog", linthresh=threshold)
        axes.axvline(0, color=scheme.muted, linewidth=1.0)
        for measured in rows(table):
            row = places[measured.method, measured.setting]
            value = getattr(measured, column)
            axes.plot([0, value], [row, row], color=colours[measured.method], linewidth=1.6, alpha=0.35)
            _mark(axes, value, row, colours[measured.method], measured.role, scheme.marker(measured.method))
        axes.set(title=title, xlabel="variance beyond the truth's, over its squared mean")
        axes.xaxis.set_major_locator(FixedLocator(_signed_decades(table[column].dropna().tolist(), threshold)))
        axes.xaxis.set_minor_locator(NullLocator())
        axes.grid(axis="y", visible=False)
    _name_rows(panels[0], places)
    return figure


def spectra(scheme: Scheme, curves: Mapping[tuple[str, str], Sequence[tuple[float, float]]]) -> Figure:
    """Draw the power spectrum of the receding plane by every method beside the truth's.

    Only the last setting of a method and the baseline are drawn.
    """
    last = dict(curves.keys())
    shown = {key: curve for key, curve in curves.items() if key == BASELINE or last[key[0]] == key[1]}
    height = max(3.8, 0.9 + 0.19 * len(shown))
    figure, (axes,) = new_figure(9.2, height)
    colours = scheme.colours(method for method, _ in shown)
    axes.axvspan(HALF_NYQUIST, 0.5, color=scheme.line, alpha=0.35, linewidth=0)
    _remark(axes, scheme, "counted as aliasing where it exceeds the truth", (HALF_NYQUIST, 0.98), (6, 0))
    axes.set(
        xlim=(0, 0.62), yscale="log", xlabel="frequency, cycles a pixel",
        ylabel="power over the truth's squared mean", xticks=[0, 0.1, 0.2, 0.25, 0.3, 0.4, 0.5],
    )  # fmt: skip
    labels: list[tuple[float, str, str]] = []
    for (method, setting), curve in sorted(shown.items(), key=lambda item: item[0][0] == TRUTH):
        points = np.array([point for point in curve if point[1] > 0])
        if not len(points):
            continue
        is_truth = method == TRUTH
        axes.plot(
            *points.T, color=colours[method], linewidth=2.6 if is_truth else 1.3, alpha=1 if is_truth else 0.85,
            marker=scheme.marker(method), markersize=5, markevery=(len(labels) % _MARK_EVERY, _MARK_EVERY),
        )  # fmt: skip
        labels.append((math.log(points[-1][1]), display(method, setting), method))
    labels.sort()
    low, high = (math.log(limit) for limit in axes.get_ylim())
    places = _apart([end for end, _, _ in labels], (high - low) / ((height - 0.9) / 0.17), high)
    for place, (_, label, method) in zip(places, labels, strict=True):
        level, colour = math.exp(place), colours[method]
        axes.plot(0.508, level, color=colour, marker=scheme.marker(method), markersize=5)
        weight = "bold" if method == TRUTH else "normal"
        axes.annotate(label, (0.516, level), va="center", fontsize=8.5, color=scheme.text(colour), fontweight=weight)
    axes.yaxis.set_minor_formatter(NullFormatter())
    return figure


def _remark(axes: Axes, scheme: Scheme, words: str, at: tuple[float, float], offset: tuple[float, float]) -> None:
    """Write on a panel; the place is in data and in shares of the panel's height, the offset in points."""
    axes.annotate(
        words, at, xytext=offset, xycoords=("data", "axes fraction"), textcoords="offset points", va="top", fontsize=8,
        color=scheme.muted,
    )  # fmt: skip


def _signed_decades(values: Sequence[float], smallest: float) -> list[float]:
    """Return ticks for values of both signs: 0 and, outwards from `smallest`, powers of ten; few enough to be read."""
    first = round(math.log10(smallest))
    reach = {sign: max((sign * value for value in values), default=0.0) for sign in (-1, 1)}
    last = {sign: math.floor(math.log10(top) + 1e-9) if top > 0 else first - 1 for sign, top in reach.items()}
    step = max(-(-sum(max(end - first + 1, 0) for end in last.values()) // _MOST_DECADES), 1)
    return sorted([0.0, *(sign * 10.0**e for sign, end in last.items() for e in range(end, first - 1, -step))])


def _apart(places: Sequence[float], step: float, high: float) -> list[float]:
    """Move ascending places up until `step` lies between neighbours, and down again where they passed `high`."""
    result: list[float] = []
    for place in places:
        result.append(max(place, result[-1] + step) if result else place)
    for index in reversed(range(len(result))):
        result[index] = min(result[index], high - step * (len(result) - 1 - index))
    return result


def timing(scheme: Scheme, table: pd.DataFrame) -> Figure:
    """Draw the time of a query: median and quartiles."""
    places = _places(table)
    figure, (axes,) = new_figure(9.2, 1.0 + ROW * _height(places))
    colours = scheme.colours(table["method"])
    for measured in rows(table):
        colour, row = colours[measured.method], places[measured.method, measured.setting]
        median = measured.median_ns
        spread = _bounds(median, measured.first_quartile_ns, measured.third_quartile_ns)
        _mark(axes, median, row, colour, "seen", scheme.marker(measured.method), xerr=spread)
        text = f"{median:,.0f} ns" if median < 1e4 else f"{median / 1e3:,.1f} µs"
        beside: dict[str, Any] = {"xytext": (8, 0), "textcoords": "offset points", "va": "center", "fontsize": 9}
        axes.annotate(text, (measured.third_quartile_ns, row), color=scheme.muted, **beside)
    axes.set(xscale="log", xlabel="time of a query, ns: median and quartiles of interleaved calls")
    axes.margins(x=0.12)
    axes.grid(axis="y", visible=False)
    _name_rows(axes, places)
    return figure


def _places(table: pd.DataFrame) -> dict[tuple[str, str], float]:
    """Return the height of every method's row, downwards; settings of one method lie closer together."""
    keys = list(dict.fromkeys(zip(table["method"], table["setting"], strict=True)))
    order = [method for method, _ in keys]
    keys.sort(key=lambda key: order.index(key[0]))
    places: dict[tuple[str, str], float] = {}
    place, before = 0.0, keys[0] if keys else ("", "")
    for key in keys:
        if places:
            place += 1.0 if (not key[1] and not before[1]) or key[0] == before[0] else 1.5
        places[key], before = place, key
    return places


def _height(places: Mapping[tuple[str, str], float]) -> float:
    return max(places.values(), default=0.0) + 1.0


def _name_rows(axes: Axes, places: Mapping[tuple[str, str], float], above: float = 0.0) -> None:
    """Label the rows; only the first of a method's rows has its name."""
    labels, before = [], ""
    for method, setting in places:
        labels.append(display("", setting).removeprefix(", ") if method == before else display(method, setting))
        before = method
    axes.set_yticks(list(places.values()), labels)
    axes.set_ylim(_height(places) - 0.4, -0.6 - above)
    axes.tick_params(axis="y", length=0)


def _mark(axes: Axes, x: float, y: float, colour: str, role: str, shape: Marker, **bars: Any) -> None:
    """Put a method's mark: filled where seen, open where unseen."""
    looks: dict[str, Any] = {"marker": shape, "markersize": 7, "markeredgewidth": 1.6, "elinewidth": 1.6} | bars
    axes.errorbar(x, y, color=colour, markerfacecolor=colour if role == "seen" else "none", **looks)


def _bounds(value: float, low: float, high: float) -> list[list[float]]:
    return [[max(value - low, 0.0)], [max(high - value, 0.0)]]
