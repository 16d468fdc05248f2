"""Fabrics that were fitted: numbers with intervals, errors, sentences on what is assumed and what is not known."""

from collections.abc import Mapping, Sequence
from typing import Any, Final, NamedTuple

from weaves.fabric import Fabric

DRAFTS: Final[Mapping[str, Mapping[str, Any]]] = {
    "plain": {"family": "plain"},
    "rib 1x2": {"family": "rib", "ends": 1, "picks": 2},
    "rib 2x1": {"family": "rib", "ends": 2, "picks": 1},
    "basket": {"family": "basket"},
    "twill 2/2": {"family": "twill", "over": 2, "under": 2},
    "twill 2/1": {"family": "twill", "over": 2, "under": 1},
    "twill 1/2": {"family": "twill", "over": 1, "under": 2},
    "twill 3/1": {"family": "twill", "over": 3, "under": 1},
    "twill 1/3": {"family": "twill", "over": 1, "under": 3},
    "broken twill 3/1": {"family": "broken_twill", "over": 3, "under": 1},
    "broken twill 1/3": {"family": "broken_twill", "over": 1, "under": 3},
    "satin": {"family": "satin"},
    "sateen": {"family": "sateen"},
}
"""Drafts that a fit tries: a name, and the table of a fabric file."""

LEAST_THICKNESS: Final = 8.0
"""Optical thickness that is assumed if the data state no larger one: nothing goes straight through a yarn."""


class Interval(NamedTuple):
    """A number with its interval."""

    value: float
    low: float
    high: float


class Fitted(NamedTuple):
    """A fabric that was fitted."""

    fabric: Fabric  # with grey colours
    numbers: Mapping[str, Interval]  # by their keys in a fabric file
    errors: Mapping[str, float]  # of what was fitted, relative to its mean
    drafts: Mapping[str, float]  # error of each draft that was tried, in units of a laboratory's; the chosen one first
    assumed: Sequence[str]
    unknown: Sequence[str]
    """Sentences on what was assumed, and on what the data do not determine."""


def cloth(draft: str, widths: Sequence[float], bends: Sequence[float], reliefs: Sequence[float]) -> Fabric:
    """Return a cloth of `DRAFTS` with opaque yarns; the three numbers are those of warp and weft."""
    yarns = {
        name: {"width": float(width), "bend": float(bend), "relief": float(relief), "roughness": 0.4}
        for name, width, bend, relief in zip(("warp", "weft"), widths, bends, reliefs, strict=True)
    }
    return Fabric.model_validate({"name": "fit", "draft": DRAFTS[draft], "optical_thickness": LEAST_THICKNESS, **yarns})
