"""Random gloss: a factor of the specular colour for every float, because real cloth glitters [Jin2022Woven].

The factors are log-normal with mean 1; their spread is chosen here, because the published form is not stated. A cloth
that varies is a larger cloth that repeats: the draft is tiled, so that every float of the tile has a factor of its own
and nothing else of the method changes.
"""

from __future__ import annotations

import math

import numpy as np

from pipeline.truth.options import Variation


def gloss(
    variation: Variation,
    family: int,
    side: int,
    pick: int,
    end: int,
    offset: float,
    length: float,
    repeat: tuple[int, int],
) -> float:
    """Return the factor of a float, named by its family, its yarn and twice the position of its centre.

    Parameters
    ----------
    variation : Variation
        Spread, seed and period of the factors.
    family, side : int
        Family of the float; 0 if it lies on top here, 1 if it lies beneath.
    pick, end : int
        The cell.
    offset, length : float
        Centre of the cell minus centre of the float, along the yarn's own axis, and the float's length.
    repeat : tuple of int
        Ends and picks of the tiled draft.
    """
    ends, picks = repeat
    centre = round(2 * (pick - offset)) % (2 * picks) if family == 0 else round(2 * (end - offset)) % (2 * ends)
    if not math.isfinite(length):
        # A yarn that never changes side is one float.
        centre = 0
    line = end if family == 0 else pick
    normal = np.random.default_rng([variation.seed, family, side, line, centre]).standard_normal()
    return math.exp(variation.spread * normal - 0.5 * variation.spread**2)
