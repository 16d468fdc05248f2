"""Plots of errors against costs, both logarithmic, with the Pareto front.

The settings of a method are one curve; its first and last are labelled, and so is the baseline. The broad band is the
front, a vertical bar the range over trainings. Where `woven` is drawn, the dashed arrow is the ratio of its paper, from
our baseline: 4.1 times lower MSE, which is 2.0 times lower RMSE, at 0.83 times the time [Chen2024Woven]. Values of 0
have no place on a logarithmic axis and are left out.
"""

import math
import re
from collections.abc import Callable, Mapping
from typing import Final

import numpy as np
import pandas as pd
from adjustText import adjust_text
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patheffects import withStroke
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter, NullLocator

from reports.measure.by_size import SIZES
from reports.page.colours import Scheme
from reports.page.figures import NARROWEST_PLOT, SHOWN_ROLES, new_figure
from reports.tables.number_format import display, size
from reports.tables.summary import OF_PAPER, PAPER, front, of_baseline, parts_of, rows

_LEGEND_COLUMNS: Final = 5
_TIME: Final = "time of a query, ns (one process, side by side)"


def error_against_time(scheme: Scheme, table: pd.DataFrame) -> Figure:
    """Draw the colour's error against the time of a query, with the paper's step, from `tradeoff.tradeoff_table`."""
    table = table.assign(x=table["ns"], y=table["error"], least=table["error_least"], most=table["error_most"])
    return _by_role(scheme, table, _TIME, "relative RMSE of the colour", _percent, paper=True)


def aliasing_against_time(scheme: Scheme, table: pd.DataFrame) -> Figure:
    """Draw the flicker's distance from the truth's against the time of a query, from `tradeoff.tradeoff_table`."""
    table = table.assign(x=table["ns"], y=table["flicker"], front=table["front_flicker"])
    return _by_role(scheme, table, _TIME, "flicker, distance from the truth’s", _plain)


def error_against_bytes(scheme: Scheme, table: pd.DataFrame) -> Figure:
    """Draw the colour's error against what is stored for one fabric, from `tradeoff.tradeoff_table`."""
    table = table.assign(x=table["bytes_stored"], y=table["error"], front=table["front_bytes"])
    figure = _by_role(scheme, table, "bytes stored for one fabric", "relative RMSE of the colour", _percent)
    for axes in figure.axes:
        axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: re.sub(r"\.0+ ", " ", size(value))))
    return figure


def error_by_size(scheme: Scheme, table: pd.DataFrame) -> Figure:
    """Draw error against time for each size of footprints: colour above, its specular part below.

    The frame is from `equal_time.size_table`.
    """
    table = table.rename(columns={"ns": "time", "size": "panel"})
    panels = {size: f"sigma {size}" for size in SIZES if size in set(table["panel"])}
    measures = {name: f"relative RMSE, {name}" for name in ("colour", "specular")}
    return _against_time(scheme, table, panels, measures, "time of a query, ns", _percent)


def scenes(scheme: Scheme, table: pd.DataFrame) -> Figure:
    """Draw MSE, HDR-FLIP and the flicker's distance from the truth's against the time of a frame, a column a scene.

    The frame is from `summary.scene_table`.
    """
    table = table.rename(columns={"frame_time": "time", "scene": "panel"}).assign(distance=table["flicker"].abs())
    panels = {name: name for name in dict.fromkeys(table["panel"])}
    measures = {"mse": "MSE", "flip_hdr": "HDR-FLIP", "distance": "flicker, distance"}
    return _against_time(scheme, table, panels, measures, "time of a frame, ms", _plain, paper="mse")


def _by_role(
    scheme: Scheme, table: pd.DataFrame, cost: str, error: str, worded: Callable[[float], str], paper: bool = False
) -> Figure:
    """Draw `y` against `x` with the front of each role, a panel a role."""
    table = table[(table["x"] > 0) & (table["y"] > 0)]
    roles = [role for role in SHOWN_ROLES if role in set(table["role"])]
    colours = scheme.colours(table["method"])
    paper = paper and _with_paper(table)
    height = 4.5 + 0.2 * -(-len(colours) // _LEGEND_COLUMNS)
    figure, panels = new_figure(max(4.9 * len(roles), NARROWEST_PLOT), height, len(roles), sharey=True)
    for axes, role in zip(panels, roles, strict=True):
        own = table[table["role"] == role]
        _band(axes, scheme, own[own["front"]].sort_values("x"))
        for method, settings in parts_of(own, "method"):
            _curve(axes, scheme, method, settings, colours[method], role)
        for row in rows(own[of_baseline(own)]) if paper else ():
            _paper_arrow(axes, scheme, (row.x, row.y), math.sqrt(PAPER[0]))
        axes.set(title=f"{role.capitalize()} fabrics", xlabel=cost, xscale="log", yscale="log")
        _tick(axes.yaxis, axes.get_ylim(), worded, 9)
        axes.margins(0.12)
        _tick(axes.xaxis, axes.get_xlim(), lambda value: f"{value:,.0f}", 7)
    panels[0].set_ylabel(error)
    _legend(figure, scheme, colours, math.sqrt(PAPER[0]) if paper else math.nan)
    figure.draw_without_rendering()  # the layout moves the axes
    for axes in panels:
        _spread_labels(axes, scheme)
    figure.set_layout_engine("none")
    return figure


def _spread_labels(axes: Axes, scheme: Scheme) -> None:
    """Move labels until none covers another or a mark, alike for equal figures; lines join those away from theirs."""
    labels = [text for text in axes.texts if text.get_text()]
    marks = [line.get_xydata() for line in axes.lines if line.get_marker() != "None"]
    arrow = {"arrowstyle": "-", "color": scheme.muted, "linewidth": 0.7, "shrinkB": 4}
    if labels:
        x, y = np.concatenate(marks).T
        adjust_text(labels, x, y, ax=axes, expand=(1.5, 1.9), max_move=None, iter_lim=500, arrowprops=arrow)


def _against_time(
    scheme: Scheme,
    table: pd.DataFrame,
    panels: Mapping[str, str],
    measures: Mapping[str, str],
    axis: str,
    worded: Callable[[float], str],
    paper: str = "",
) -> Figure:
    """Draw measures (a line each) against `time` in panels (a column each); in that named `paper` the paper's step."""
    table = table[(table["time"] > 0) & (table[[*measures]] > 0).any(axis=1)]
    panels = {panel: title for panel, title in panels.items() if panel in set(table["panel"])}
    measures = {name: label for name, label in measures.items() if (table[name] > 0).any()}
    colours = scheme.colours(table["method"])
    height = 0.6 + 2.4 * len(measures) + 0.2 * -(-len(colours) // _LEGEND_COLUMNS)
    width = max(2.3 * len(panels), NARROWEST_PLOT)
    figure, flat = new_figure(width, height, len(panels), sharey=True, lines=len(measures))
    grid = np.asarray(flat).reshape(len(measures), len(panels))
    for place, ((measure, label), line) in enumerate(zip(measures.items(), grid, strict=True)):
        for axes, (panel, title) in zip(line, panels.items(), strict=True):
            own = table[(table["panel"] == panel) & (table[measure] > 0)]
            own = own.assign(x=own["time"], y=own[measure])
            _band(axes, scheme, own[front(own, "x", "y")].sort_values("x"), 5.0)
            for method, settings in parts_of(own, "method"):
                settings = settings.sort_values("x")
                axes.plot(
                    settings["x"], settings["y"], color=colours[method], marker=scheme.marker(method), markersize=4.5,
                    linewidth=1.1,
                )  # fmt: skip
            for row in rows(own[of_baseline(own)]) if measure == paper and _with_paper(table) else ():
                _paper_arrow(axes, scheme, (row.x, row.y), PAPER[0])
            axes.set(xscale="log", yscale="log", title="" if place else title)
            _tick(axes.yaxis, axes.get_ylim(), worded, 8)
            axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:,.0f}"))
            axes.xaxis.set_minor_formatter(NullFormatter())
        line[0].set_ylabel(label)
    grid[-1, len(panels) // 2].set_xlabel(axis)
    _legend(figure, scheme, colours, PAPER[0] if paper and _with_paper(table) else math.nan)
    return figure


def _percent(value: float) -> str:
    return f"{100 * value:.3g} %"


def _plain(value: float) -> str:
    return f"{value:.3g}".replace("e-0", "e−")


def _tick(axis: Axis, limits: tuple[float, float], worded: Callable[[float], str], most: int) -> None:
    """Label a logarithmic axis at 1, 2 and 5 of every decade; at its powers alone where those are more than `most`."""
    low, high = limits
    subs = (1.0, 2.0, 5.0) if 3.0 * math.log10(high / low) < most else (1.0,)
    axis.set_major_locator(LogLocator(subs=subs, numticks=most))
    axis.set_major_formatter(FuncFormatter(lambda value, _: worded(value)))
    axis.set_minor_locator(NullLocator())


def _with_paper(table: pd.DataFrame) -> bool:
    """Return whether the method of the paper is drawn, and the baseline from which its arrow starts."""
    return OF_PAPER in set(table["method"]) and bool(of_baseline(table).any())


def _legend(figure: Figure, scheme: Scheme, colours: Mapping[str, str], lower: float) -> None:
    """Draw one legend for all panels: colour and mark of every method, and the paper's arrow unless it is NaN."""
    handles = [Line2D([], [], color=colours[name], marker=scheme.marker(name), label=display(name)) for name in colours]
    if math.isfinite(lower):
        step = f"{display(OF_PAPER)} in its paper: {lower:.1f}× lower at {PAPER[1]}× the time"
        handles.append(Line2D([], [], color=scheme.muted, linestyle=(0, (3, 2)), label=step))
    figure.legend(handles=handles, loc="outside lower center", ncols=min(_LEGEND_COLUMNS, len(handles)), fontsize=9)


def _band(axes: Axes, scheme: Scheme, best: pd.DataFrame, width: float = 7.0) -> None:
    axes.plot(best["x"], best["y"], color=scheme.line, linewidth=width, zorder=1, solid_capstyle="round")


def _curve(axes: Axes, scheme: Scheme, method: str, settings: pd.DataFrame, colour: str, role: str) -> None:
    """Draw the settings of a method as one curve, with labels at the first, the last and the baseline."""
    face = colour if role == "seen" else scheme.ground
    axes.plot(
        settings["x"], settings["y"], color=colour, marker=scheme.marker(method), markersize=7, markerfacecolor=face,
        markeredgewidth=1.6, linewidth=1.3, zorder=3,
    )  # fmt: skip
    for row in rows(settings) if "least" in settings else ():
        if 0 < row.least < row.most:
            axes.plot([row.x, row.x], [row.least, row.most], color=colour, linewidth=4, alpha=0.3, zorder=2)
    ends = {settings["setting"].iloc[0], settings["setting"].iloc[-1]}
    for row in rows(settings[settings["setting"].isin(ends) | of_baseline(settings)]):
        if row.setting:
            label = axes.text(row.x, row.y, row.setting.removeprefix("k = "), fontsize=8, color=scheme.text(colour))
            label.set(zorder=6, in_layout=False, path_effects=[withStroke(linewidth=2.5, foreground=scheme.ground)])


def _paper_arrow(axes: Axes, scheme: Scheme, start: tuple[float, float], lower: float) -> None:
    """Draw the paper's ratios of time and error from a start."""
    target = (start[0] * PAPER[1], start[1] / lower)
    axes.scatter(*target, alpha=0.0)  # an arrow alone does not widen the axes
    axes.annotate(
        "", target, xytext=start, zorder=5,
        arrowprops={"arrowstyle": "-|>", "color": scheme.muted, "linestyle": (0, (3, 2)), "shrinkA": 6, "shrinkB": 0},
    )  # fmt: skip
