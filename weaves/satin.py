"""Satins: each end is bound once in a repeat, and no two neighbouring ends in neighbouring picks.

The binding point moves on by `move` ends from pick to pick. It meets every end once exactly when `move` and the number
of ends share no factor, and 1 or ends - 1 would be a twill: so 6 ends have no regular satin at all. A satin shows the
warp, a sateen the weft.
"""

from __future__ import annotations

from math import gcd
from typing import Literal

import numpy as np
from pydantic import StrictInt

from weaves.draft import LARGEST_REPEAT, Draft, Family
from weaves.errors import BadInput


def valid_moves(ends: int) -> list[int]:
    """Return the moves that make a satin of `ends` ends: coprime to it, and neither 1 nor ends - 1."""
    return [move for move in range(2, ends - 1) if gcd(move, ends) == 1]


def satin(ends: int = 5, move: int = 2) -> Draft:
    """Weave a warp-faced satin.

    Raises
    ------
    BadInput
        If the ends or the move make no satin; the sentence lists what would.
    """
    return Draft(~_bindings("satin", ends, move), f"satin {ends}/{move}")


def sateen(ends: int = 5, move: int = 2) -> Draft:
    """Weave a weft-faced satin.

    Raises
    ------
    BadInput
        As `satin`.
    """
    return Draft(_bindings("sateen", ends, move), f"sateen {ends}/{move}")


def _bindings(kind: str, ends: int, move: int) -> np.ndarray[tuple[int, int], np.dtype[np.bool_]]:
    """Mark the one end at which each pick is bound."""
    if not 5 <= ends <= LARGEST_REPEAT:
        raise BadInput(kind, "ends", ends, f"5 to {LARGEST_REPEAT} ends are possible")
    if move not in (moves := valid_moves(ends)):
        listed = f"{ends} ends allow {', '.join(map(str, moves))}" if moves else f"{ends} ends allow none"
        others = [other for other in (ends - 1, ends + 1) if valid_moves(other)]
        hint = "" if moves else f"; try {' or '.join(map(str, others))} ends"
        raise BadInput(
            kind, "move", move, f"a move shares no factor with the ends and is not 1 or ends - 1: {listed}{hint}"
        )
    pick, end = np.ogrid[:ends, :ends]
    bound: np.ndarray[tuple[int, int], np.dtype[np.bool_]] = end == pick * move % ends
    return bound


class Satin(Family):
    """A warp-faced satin."""

    family: Literal["satin"] = "satin"
    ends: StrictInt = 5
    """Ends, and picks, of the repeat."""
    move: StrictInt = 2
    """Ends from one binding point to that of the next pick."""

    def build(self) -> Draft:
        """Weave it."""
        return satin(self.ends, self.move)


class Sateen(Family):
    """A weft-faced satin."""

    family: Literal["sateen"] = "sateen"
    ends: StrictInt = 5
    """Ends, and picks, of the repeat."""
    move: StrictInt = 2
    """Ends from one binding point to that of the next pick."""

    def build(self) -> Draft:
        """Weave it."""
        return sateen(self.ends, self.move)
