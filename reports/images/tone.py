"""Tone curves: from linear light to the 8-bit values of a screen.

    srgb        x cut at 1; as on the page
    reinhard    x / (1 + L), L the luminance: nothing is cut but saturated colours [Reinhard2002Tone, equation 3]

x is the linear RGB times `EXPOSURE` 2^exposure, so an exposure of 0 stops is that of the page. The sRGB encoding
follows.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final, Literal

import numpy as np
import numpy.typing as npt

from reports.images.tiles import EXPOSURE, Bytes8, encoded
from weaves.colour import LUMINANCE

Tone = Literal["srgb", "reinhard"]
"""Name of a tone curve."""

STOPS: Final = 20.0
"""Largest exposure in either direction, in stops."""


def _reinhard(rgb: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    return np.asarray(rgb / (1.0 + (rgb @ np.array(LUMINANCE))[..., None]))


_CURVES: Final[dict[Tone, Callable[[npt.NDArray[np.float64]], npt.NDArray[np.float64]]]] = {
    "srgb": lambda rgb: rgb,
    "reinhard": _reinhard,
}


def displayed(linear: npt.NDArray[np.floating], tone: Tone = "srgb", exposure: float = 0.0) -> Bytes8:
    """Return linear RGB (…, 3) as sRGB codes.

    Parameters
    ----------
    linear : float (…, 3)
        Linear RGB, at least 0.
    tone : str
        Name of the curve.
    exposure : float
        Stops above the exposure of the page.
    """
    return encoded(_CURVES[tone](EXPOSURE * 2.0**exposure * np.asarray(linear, np.float64)))
