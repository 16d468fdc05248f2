"""Colours and marks of a page, light and dark: of its text, of its grounds and of every method.

A method is known by its name in the recipe: two models of one kind are two methods. The names that models have by
default keep their colours on every page; others take the spare ones in the order of the page (`Scheme.naming`).

Text needs a contrast of 4.5 (success criterion 1.4.3), marks of a plot 3 (1.4.11) [Campbell2023WCAG].
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Final, Literal

import numpy as np

from reports.record import TRUTH
from weaves.colour import LUMINANCE, linear_rgb

Marker = str | tuple[int, Literal[0, 1, 2], int]
"""Of matplotlib: a name, or (number of corners, 0 for a polygon and 1 for a star, angle)."""

METHODS: Final[Mapping[str, tuple[Marker, str, str]]] = {
    TRUTH: ("X", "#23252b", "#ecebe6"),
    "woven": ("o", "#3d55cc", "#8fa2ff"),
    "neumip": ("v", "#0b8f77", "#45d0b0"),
    "triple_plane": ((3, 0, 0), "#2f7f9e", "#7cc8e6"),
    "hierarchical": ((4, 0, 45), "#14707a", "#5fd0dc"),
    "selvage": ("*", "#1a86bd", "#62c3f5"),
    "curved": ("<", "#5a7d1f", "#b3d46a"),
    "curved_grazing": ("d", "#848f0c", "#dde26a"),
    "unified_btf": ("h", "#8a5a2b", "#cf9a66"),
    "btf_autoencoder": ("p", "#a87947", "#e6c6a3"),
    "universal": ((5, 0, 0), "#7a4a1c", "#dfb07f"),
    "point_sampled": ("s", "#d9622b", "#ff9a5c"),
    "r2_points": ("D", "#a67806", "#e3bf4e"),
    "prefiltered": ("P", "#6f7484", "#a7adbd"),
    "microcylinder": ((7, 0, 0), "#6b4fb3", "#b9a5f0"),
    "irawan": ((3, 0, 180), "#4a6b2a", "#a9c98a"),
    "map_material": ((8, 1, 0), "#b3263f", "#ff8fa3"),
    "soft_nodes": (">", "#d24fa2", "#f9a8d8"),
}
"""Mark and colours, light and dark, of each method. No two marks are alike: no method is known by colour alone."""

MARKS: Final[tuple[Marker, ...]] = ((4, 1, 0), (5, 0, 180), (3, 1, 0), (6, 1, 0), "H")
"""Marks of methods that are not known, one after the other; their number and that of spare colours share no factor."""

OF_TEXT: Final = 4.5


def contrast(first: str, second: str) -> float:
    """Return (L1 + .05) / (L2 + .05) of two colours ``#rrggbb``, L1 the lighter one's relative luminance: 1 … 21."""
    darker, lighter = sorted(float(np.dot(LUMINANCE, linear_rgb(colour))) for colour in (first, second))
    return (lighter + 0.05) / (darker + 0.05)


def readable(colour: str, ground: str, ink: str) -> str:
    """Return the colour nearest to `colour`, on the way to `ink`, in which text on `ground` can be read.

    All are ``#rrggbb``; the contrast of `ink` on `ground` is at least `OF_TEXT`.
    """
    start, end = (np.array([int(code[i : i + 2], 16) for i in (1, 3, 5)], np.float64) for code in (colour, ink))
    for step in range(21):
        mixed = np.rint(start + (end - start) * step / 20).astype(int)
        code = "#" + "".join(f"{value:02x}" for value in mixed)
        if contrast(code, ground) >= OF_TEXT:
            break
    return code


@dataclass(frozen=True)
class Scheme:
    """Colours of a plot on a light or a dark page."""

    name: str
    ink: str
    muted: str
    line: str
    ground: str
    card: str  # ground of tables and cards
    tint: str  # ground of the baseline's row
    focus: str  # outline of what the keyboard has reached
    methods: Mapping[str, str]
    others: tuple[str, ...]
    marks: Mapping[str, Marker] = field(default_factory=dict)

    def marker(self, method: str) -> Marker:
        """Return a method's mark in plots."""
        return self.marks.get(method, "o")

    def colours(self, methods: Iterable[str]) -> dict[str, str]:
        """Return a colour for each method; names that are not known take the spare ones in their order."""
        names = list(dict.fromkeys(methods))
        spare = itertools.cycle(self.others)
        return {name: self.methods.get(name) or next(spare) for name in names}

    def text(self, colour: str) -> str:
        """Return a colour of text on `ground` that recalls `colour`."""
        return readable(colour, self.ground, self.ink)

    def naming(self, methods: Iterable[str]) -> Scheme:
        """Return the scheme in which these names have their colours for good, whichever of them a plot shows."""
        names = list(dict.fromkeys(methods))
        strangers = [name for name in names if name not in self.methods]
        marks = {name: MARKS[index % len(MARKS)] for index, name in enumerate(strangers)}
        return replace(self, methods={**self.methods, **self.colours(names)}, marks={**self.marks, **marks})


_MARKERS: Final = {name: marker for name, (marker, _, _) in METHODS.items()}

LIGHT: Final = Scheme(
    name="light",
    ink="#23252b",
    muted="#646978",
    line="#dcd8d0",
    ground="#fbfaf7",
    card="#ffffff",
    tint="#f1eee7",
    focus="#2340b8",
    methods={name: light for name, (_, light, _) in METHODS.items()},
    marks=_MARKERS,
    others=("#7a5cf0", "#148f4a", "#a3352b", "#0e7c9b", "#b97400", "#9c4f86"),
)
DARK: Final = Scheme(
    name="dark",
    ink="#ecebe6",
    muted="#9a9daa",
    line="#383b44",
    ground="#17181c",
    card="#1f2126",
    tint="#24262c",
    focus="#a9b8ff",
    methods={name: dark for name, (_, _, dark) in METHODS.items()},
    marks=_MARKERS,
    others=("#b3a1ff", "#5fd58f", "#f08a80", "#5cc6e0", "#f0b54a", "#dba0c8"),
)
