"""Colours and marks of methods on a light and a dark page.

A method is known by its name in the recipe: two models of one kind are two methods. The names that models have by
default keep their colours on every page; others take the spare ones in the order of the page (`Scheme.naming`).
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Final

from reports.record import TRUTH

MARKERS: Final = {
    "point_sampled": "s",
    "r2_points": "D",
    "gauss_nodes": "^",
    "soft_nodes": ">",
    "prefiltered": "P",
    "unified_btf": "h",
    "btf_autoencoder": "H",
}
"""Marks of methods in plots; the others are round."""

MARKS: Final = ("o", "s", "D", "^", "v")
"""Marks of methods that are not known, one after the other."""


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
    marks: Mapping[str, str] = field(default_factory=dict)

    def marker(self, method: str) -> str:
        """Return a method's mark in plots."""
        return self.marks.get(method, "o")

    def colours(self, methods: Iterable[str]) -> dict[str, str]:
        """Return a colour for each method; names that are not known take the spare ones in their order."""
        names = list(dict.fromkeys(methods))
        spare = itertools.cycle(self.others)
        return {name: self.methods.get(name) or next(spare) for name in names}

    def naming(self, methods: Iterable[str]) -> Scheme:
        """Return the scheme in which these names have their colours for good, whichever of them a plot shows."""
        names = list(dict.fromkeys(methods))
        strangers = [name for name in names if name not in self.methods]
        # When the spare colours are through, they come again with the next mark.
        marks = {name: MARKS[index // len(self.others) % len(MARKS)] for index, name in enumerate(strangers)}
        return replace(self, methods={**self.methods, **self.colours(names)}, marks={**self.marks, **marks})


LIGHT: Final = Scheme(
    name="light",
    ink="#23252b",
    muted="#6b7080",
    line="#dcd8d0",
    ground="#fbfaf7",
    methods={
        TRUTH: "#23252b",
        "woven": "#3d55cc",
        "neumip": "#0b8f77",
        "selvage": "#1f9ad6",
        "curved": "#5a7d1f",
        "curved_grazing": "#9aa60f",
        "unified_btf": "#8a5a2b",
        "btf_autoencoder": "#b98a5e",
        "point_sampled": "#d9622b",
        "r2_points": "#b8860b",
        "prefiltered": "#6f7484",
        "gauss_nodes": "#8e44ad",
        "soft_nodes": "#e05fb0",
    },
    marks=MARKERS,
    others=("#7a5cf0", "#148f4a", "#a3352b", "#0e7c9b", "#c07a00", "#9c4f86"),
)
DARK: Final = Scheme(
    name="dark",
    ink="#ecebe6",
    muted="#9a9daa",
    line="#383b44",
    ground="#17181c",
    methods={
        TRUTH: "#ecebe6",
        "woven": "#8fa2ff",
        "neumip": "#45d0b0",
        "selvage": "#62c3f5",
        "curved": "#b3d46a",
        "curved_grazing": "#dde26a",
        "unified_btf": "#cf9a66",
        "btf_autoencoder": "#e6c6a3",
        "point_sampled": "#ff9a5c",
        "r2_points": "#e3bf4e",
        "prefiltered": "#a7adbd",
        "gauss_nodes": "#d29bf0",
        "soft_nodes": "#f9a8d8",
    },
    marks=MARKERS,
    others=("#b3a1ff", "#5fd58f", "#f08a80", "#5cc6e0", "#f0b54a", "#dba0c8"),
)
