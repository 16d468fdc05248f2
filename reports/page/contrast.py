"""Contrast of two colours: (L1 + .05) / (L2 + .05), L1 the lighter one's relative luminance [Campbell2023WCAG].

Text needs 4.5 (success criterion 1.4.3), marks of a plot 3 (1.4.11).
"""

from __future__ import annotations

from typing import Final

import numpy as np

from weaves.colour import LUMINANCE, linear_rgb

OF_TEXT: Final = 4.5
OF_MARKS: Final = 3.0
STEPS: Final = 20
"""Steps from a colour to the ink in `readable`."""


def contrast(first: str, second: str) -> float:
    """Return the contrast of two colours ``#rrggbb``, 1 … 21."""
    darker, lighter = sorted(float(np.dot(LUMINANCE, linear_rgb(colour))) for colour in (first, second))
    return (lighter + 0.05) / (darker + 0.05)


def readable(colour: str, ground: str, ink: str) -> str:
    """Return the colour nearest to `colour`, on the way to `ink`, in which text on `ground` can be read.

    Parameters
    ----------
    colour, ground, ink : str
        ``#rrggbb``; the contrast of `ink` on `ground` is at least `OF_TEXT`.
    """
    start, end = (np.array([int(code[i : i + 2], 16) for i in (1, 3, 5)], np.float64) for code in (colour, ink))
    for step in range(STEPS + 1):
        mixed = np.rint(start + (end - start) * step / STEPS).astype(int)
        found = "#" + "".join(f"{value:02x}" for value in mixed)
        if contrast(found, ground) >= OF_TEXT:
            break
    return found
