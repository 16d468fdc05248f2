"""How plots look: one colour a method, a light and a dark scheme, transparent ground, twice a screen's resolution."""

from __future__ import annotations

import io
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Final

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from reports.record import TRUTH

DPI: Final = 200
NO_BREAK: Final = "\N{NO-BREAK SPACE}"


@dataclass(frozen=True)
class Scheme:
    """Colours of a plot on a light or a dark page."""

    name: str
    ink: str
    muted: str
    line: str
    ground: str
    methods: Mapping[str, str]
    others: tuple[str, ...]

    def colours(self, methods: Iterable[str]) -> dict[str, str]:
        """Return a colour for each method; names that are not known take the spare ones in their order."""
        result: dict[str, str] = {}
        spare = iter(self.others)
        for method in dict.fromkeys(methods):
            result[method] = self.methods.get(method) or next(spare, self.muted)
        return result


LIGHT: Final = Scheme(
    name="light",
    ink="#23252b",
    muted="#6b7080",
    line="#dcd8d0",
    ground="#fbfaf7",
    methods={TRUTH: "#23252b", "woven": "#3d55cc", "neumip": "#0b8f77", "point_sampled": "#d9622b"},
    others=("#8e44ad", "#b8860b", "#c2366b", "#5a7d1f"),
)
DARK: Final = Scheme(
    name="dark",
    ink="#ecebe6",
    muted="#9a9daa",
    line="#383b44",
    ground="#17181c",
    methods={TRUTH: "#ecebe6", "woven": "#8fa2ff", "neumip": "#45d0b0", "point_sampled": "#ff9a5c"},
    others=("#d29bf0", "#e3bf4e", "#f58ab4", "#b3d46a"),
)


def display(method: str, setting: str = "") -> str:
    """Return what a person calls a method."""
    known = {"neumip": "NeuMIP", "point_sampled": "points"}
    name = known.get(method, method.replace("_", " "))
    return f"{name}, {setting.replace(' ', NO_BREAK)}" if setting else name


def render(plot: Callable[..., Figure], scheme: Scheme, *data: Any) -> bytes:
    """Return what ``plot(scheme, *data)`` draws, as PNG bytes on a transparent ground; equal data give equal bytes."""
    buffer = io.BytesIO()
    with mpl.rc_context(_parameters(scheme)):
        plot(scheme, *data).savefig(buffer, format="png", transparent=True, metadata={"Software": None})
    return buffer.getvalue()


def new_figure(width: float, height: float, columns: int = 1, sharey: bool = False) -> tuple[Figure, list[Axes]]:
    """Return a figure of `columns` axes side by side, `width` by `height` inches."""
    figure = Figure(figsize=(width, height), dpi=DPI, layout="constrained")
    return figure, list(figure.subplots(1, columns, sharey=sharey, squeeze=False)[0])


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
