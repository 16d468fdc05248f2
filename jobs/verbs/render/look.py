"""Options of `twillight render` that say how a picture is made and shown."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Final

from pipeline.scenes.options import SceneOptions
from pipeline.scenes.picture import MOST_SAMPLES
from reports.images.tiles import STOPS, Tone
from weaves.errors import BadInput
from weaves.validation import validated

WHERE: Final = "render"
"""Name of the verb in messages."""

MOST_PIXELS: Final = 16_384
"""Longest side of a picture."""


@dataclass(frozen=True)
class RenderLook:
    """How a picture is made and shown.

    Attributes
    ----------
    size : tuple of int or None
        Width and height; None for those of the film.
    side : int
        Rays along each side of a pixel.
    options : SceneOptions
        How the scene becomes queries.
    tone, exposure : str, float
        Tone curve, and stops above the exposure of the page.
    """

    size: tuple[int, int] | None
    side: int
    options: SceneOptions
    tone: Tone
    exposure: float


def look(size: str, samples: int, directions: int, tone: Tone, exposure: float) -> RenderLook:
    """Return how a picture is made, from the command line; BadInput if a value cannot be used."""
    if samples not in (squares := [side**2 for side in range(1, MOST_SAMPLES + 1)]):
        raise BadInput(WHERE, "--samples", samples, f"must be one of {', '.join(map(str, squares))}")
    try:
        options = validated(SceneOptions, {"environment_directions": directions}, WHERE)
    except BadInput as error:
        raise BadInput(WHERE, "--directions", directions, error.allowed) from error
    if not -STOPS <= exposure <= STOPS:
        raise BadInput(WHERE, "--exposure", exposure, f"must be from {-STOPS:g} to {STOPS:g} stops")
    return RenderLook(size_of(size) if size else None, round(samples**0.5), options, tone, exposure)


def size_of(text: str) -> tuple[int, int]:
    """Return width and height from a text such as ``640x480``; BadInput if it is none."""
    found = re.fullmatch(r"([0-9]{1,9})x([0-9]{1,9})", text)
    if not found or not all(1 <= int(side) <= MOST_PIXELS for side in found.groups()):
        raise BadInput(WHERE, "--size", text, f"must be WIDTHxHEIGHT, such as 1024x1024, each from 1 to {MOST_PIXELS}")
    return int(found[1]), int(found[2])
