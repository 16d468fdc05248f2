"""Style of plots: fonts, grid, size, and PNG bytes on a transparent ground at twice a screen's resolution."""

from __future__ import annotations

import io
from collections.abc import Callable
from typing import Any, Final

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from reports.page.colours import Scheme

DPI: Final = 200
NARROWEST: Final = 8.6
"""Least width of plots in inches: the page shows every plot as wide as its column."""


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
    return {
        "font.size": 10,
        "text.color": scheme.ink,
        "axes.labelcolor": scheme.muted,
        "axes.titlecolor": scheme.ink,
        "axes.titlesize": 11,
        "axes.titleweight": "bold",
        "axes.titlelocation": "left",
        "axes.titlepad": 10,
        "axes.edgecolor": scheme.line,
        "axes.grid": True,
        "axes.axisbelow": True,
        "axes.spines.top": False,
        "axes.spines.right": False,
        "grid.color": scheme.line,
        "grid.linewidth": 0.6,
        "xtick.color": scheme.line,
        "ytick.color": scheme.line,
        "xtick.labelcolor": scheme.ink,
        "ytick.labelcolor": scheme.ink,
        "xtick.minor.size": 0,
        "ytick.minor.size": 0,
        "legend.frameon": False,
    }
