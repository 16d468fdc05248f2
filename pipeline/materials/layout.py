"""Layout of tiling maps: how many yarns a map shows, and in how many texels.

A map shows whole repeats of weave and colours, so that it tiles. Its sides are powers of two, so that mip levels are
exact. Among these layouts the texels are square within 1 % where that is possible, else as square as possible; then
a yarn has as many texels as possible; then the map is as small as possible.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

from weaves.errors import BadInput
from weaves.fabric import Fabric

SMALLEST: Final = 64
"""Shortest longer side, in texels."""

LARGEST: Final = 4096
"""Longest side, in texels: the sums of such a map take 1.5 GB."""

TEXELS_PER_YARN: Final = 4
"""Fewest texels along a yarn spacing."""

_SQUARE: Final = 0.01
"""Difference of the sides of a texel that counts as none."""

_COPIES: Final = 16
"""Most repeats along the shorter side."""


class Layout(NamedTuple):
    """Extent of a map.

    Attributes
    ----------
    ends, picks : int
        Yarns along x and along y: whole repeats.
    width, height : int
        Texels along x and along y: powers of two.
    """

    ends: int
    picks: int
    width: int
    height: int

    @property
    def texels_per_yarn(self) -> float:
        """Texels along a yarn spacing, in the direction that has fewer."""
        return min(self.width / self.ends, self.height / self.picks)


def layout(fabric: Fabric, size: int) -> Layout:
    """Return the layout of a fabric's maps.

    Parameters
    ----------
    fabric : Fabric
        The cloth.
    size : int
        Texels of the longer side.

    Raises
    ------
    BadInput
        If the size is no power of two from `SMALLEST` to `LARGEST`, or too small for the repeat.
    """
    if not SMALLEST <= size <= LARGEST or size & (size - 1):
        raise BadInput("export", "size", size, f"must be a power of two from {SMALLEST} to {LARGEST}")
    found = min(_candidates(fabric.repeat, size), key=_order)
    if found.texels_per_yarn < TEXELS_PER_YARN:
        needed = size
        while needed * found.texels_per_yarn / size < TEXELS_PER_YARN:
            needed *= 2
        ends, picks = fabric.repeat
        allowed = f"the repeat of {ends} ends and {picks} picks needs {needed}"
        if needed > LARGEST:
            allowed += f", and at most {LARGEST} are possible"
        raise BadInput("export", "size", size, allowed)
    return found


def _candidates(repeat: tuple[int, int], size: int) -> list[Layout]:
    """Return layouts whose longer side has `size` texels."""
    found = []
    for halvings in range(4):
        for width, height in ((size, size >> halvings), (size >> halvings, size)):
            for copies in range(1, _COPIES + 1):
                # As many repeats along the other side as make texels nearly square.
                rows = max(1, round(copies * repeat[0] * height / (width * repeat[1])))
                columns = max(1, round(copies * repeat[1] * width / (height * repeat[0])))
                found.append(Layout(copies * repeat[0], rows * repeat[1], width, height))
                found.append(Layout(columns * repeat[0], copies * repeat[1], width, height))
    return found


def _order(candidate: Layout) -> tuple[float, float, int]:
    """Return the key by which the best layout is the least."""
    aspect = abs(math.log(candidate.width * candidate.picks / (candidate.height * candidate.ends)))
    return max(aspect, _SQUARE), -candidate.texels_per_yarn, candidate.width * candidate.height
