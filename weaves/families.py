"""Families of weaves that a few numbers describe.

A plain weave alternates yarn by yarn; a rib moves groups of yarns together in one direction, a basket weave in both.

A satin binds each end once in a repeat, and no two neighbouring ends in neighbouring picks. The binding point moves on
by `move` ends from pick to pick. It meets every end once exactly when `move` and the number of ends share no factor,
and 1 or ends - 1 would be a twill: so 6 ends have no regular satin at all. A satin shows the warp, a sateen the weft.

An n/m twill takes each end over n picks and under m; steps may follow each other (over 3, under 1, over 1, under 2).
Every end repeats its neighbour one pick later, so that floats form diagonals. A right-hand twill rises to the right. A
broken twill turns round halfway through the repeat, a herringbone after a whole one; both jump half a repeat where
they turn, which cuts the floats there.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import gcd
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BeforeValidator, Field, StrictInt

from weaves.draft import LARGEST_REPEAT, Draft, Family
from weaves.errors import BadInput

Direction = Literal["right", "left"]


def twill(over: Sequence[int], under: Sequence[int], direction: Direction = "right") -> Draft:
    """Weave a straight twill.

    Parameters
    ----------
    over, under : ints
        Picks that an end passes over, then under, then over …; as many of one as of the other.
    direction : "right" or "left"
        Side to which the diagonal rises.

    Raises
    ------
    BadInput
        If the steps do not pair up, are below 1, or the repeat is too large.
    """
    picks = len(_one_end("twill", over, under))
    suffix = "" if direction == "right" else " left"
    return _shifted("twill", over, under, range(picks), direction, suffix)


def broken_twill(over: Sequence[int], under: Sequence[int], direction: Direction = "right") -> Draft:
    """Weave a twill that turns round after half a repeat: the 4-end broken twill takes its ends as 0, 1, 3, 2.

    Raises
    ------
    BadInput
        As `twill`; also below a repeat of 4, where nothing is left to break.
    """
    picks = len(_one_end("broken twill", over, under))
    if picks < 4:
        raise BadInput(
            "broken twill", "over", list(over), f"a repeat of at least 4 picks is needed, this one has {picks}"
        )
    half = picks // 2
    suffix = "" if direction == "right" else " left"
    return _shifted("broken twill", over, under, [*range(half), *range(picks - 1, half - 1, -1)], direction, suffix)


def herringbone(over: Sequence[int], under: Sequence[int], width: int | None = None) -> Draft:
    """Weave stripes of right-hand and left-hand twill.

    Parameters
    ----------
    over, under : ints
        As for `twill`.
    width : int, optional
        Ends of a stripe; by default one repeat of the twill.

    Raises
    ------
    BadInput
        As `twill`; also for stripes below 2 ends.
    """
    picks = len(_one_end("herringbone", over, under))
    width = picks if width is None else width
    if not 2 <= width <= LARGEST_REPEAT // 2:
        raise BadInput("herringbone", "width", width, f"stripes of 2 to {LARGEST_REPEAT // 2} ends are possible")
    turn = width - 1 + picks // 2
    suffix = "" if width == picks else f" width {width}"
    return _shifted("herringbone", over, under, [*range(width), *range(turn, turn - width, -1)], "right", suffix)


def _one_end(name: str, over: Sequence[int], under: Sequence[int]) -> list[bool]:
    """Follow one end through a repeat: True where it is over the pick."""
    if len(over) != len(under) or not over:
        raise BadInput(name, "under", list(under), f"as many steps as over are needed, which has {len(over)}")
    if min(*over, *under) < 1 or sum(over) + sum(under) > LARGEST_REPEAT:
        raise BadInput(name, "over", list(over), f"steps of at least 1 pick, {LARGEST_REPEAT} with under, are needed")
    return [side for up, down in zip(over, under, strict=True) for side in (True,) * up + (False,) * down]


def _shifted(
    kind: str, over: Sequence[int], under: Sequence[int], shifts: Sequence[int], direction: Direction, suffix: str
) -> Draft:
    """Lay the same end side by side, end i moved up by `shifts[i]` picks."""
    end = np.array(_one_end(kind, over, under))
    pick = np.arange(len(end))[:, None]
    matrix = end[(pick - np.array(shifts)[None, :]) % len(end)]
    steps = " ".join(f"{up}/{down}" for up, down in zip(over, under, strict=True))
    return Draft(matrix if direction == "right" else matrix[:, ::-1], f"{kind} {steps}{suffix}")


def _listed(value: Any) -> Any:
    """Let one step be written without brackets."""
    return (value,) if isinstance(value, int) else value


Steps = Annotated[
    tuple[Annotated[StrictInt, Field(ge=1, le=64)], ...],
    BeforeValidator(_listed),
    Field(min_length=1, max_length=16),
]


class Twill(Family):
    """A straight twill."""

    family: Literal["twill"] = "twill"
    over: Steps
    """Picks each end passes over: one number, or one a step."""
    under: Steps
    """Picks it then passes under."""
    direction: Direction = "right"
    """Side to which the diagonal rises."""

    def build(self) -> Draft:
        """Weave it."""
        return twill(self.over, self.under, self.direction)


class BrokenTwill(Family):
    """A twill that turns round after half a repeat."""

    family: Literal["broken_twill"] = "broken_twill"
    over: Steps
    """Picks each end passes over."""
    under: Steps
    """Picks it then passes under."""
    direction: Direction = "right"
    """Side to which the first half rises."""

    def build(self) -> Draft:
        """Weave it."""
        return broken_twill(self.over, self.under, self.direction)


class Herringbone(Family):
    """Stripes of right-hand and left-hand twill."""

    family: Literal["herringbone"] = "herringbone"
    over: Steps
    """Picks each end passes over."""
    under: Steps
    """Picks it then passes under."""
    width: StrictInt | None = None
    """Ends of a stripe; one repeat of the twill if left out."""

    def build(self) -> Draft:
        """Weave it."""
        return herringbone(self.over, self.under, self.width)


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


Group = Annotated[StrictInt, Field(ge=1, le=16)]


def plain() -> Draft:
    """Weave over one, under one."""
    return _blocks(1, 1, "plain")


def rib(ends: int = 1, picks: int = 2) -> Draft:
    """Weave groups of yarns in one direction only: `picks` together make a warp rib, `ends` together a weft rib.

    Raises
    ------
    BadInput
        Unless exactly one of the two numbers is 1.
    """
    if (ends == 1) == (picks == 1) or min(ends, picks) < 1:
        raise BadInput("rib", "picks", picks, f"one of ends and picks is 1 and the other is more; ends is {ends}")
    return _blocks(ends, picks, f"rib {ends}x{picks}")


def basket(ends: int = 2, picks: int = 2) -> Draft:
    """Weave groups of `ends` warps over groups of `picks` wefts.

    Raises
    ------
    BadInput
        If a group has fewer than two yarns.
    """
    if min(ends, picks) < 2:
        key, value = ("ends", ends) if ends < 2 else ("picks", picks)
        raise BadInput("basket", key, value, "a basket weave groups at least 2 yarns")
    return _blocks(ends, picks, f"basket {ends}x{picks}")


def _blocks(ends: int, picks: int, name: str) -> Draft:
    """Lay a chequerboard of blocks."""
    pick, end = np.ogrid[: 2 * picks, : 2 * ends]
    return Draft((pick // picks + end // ends) % 2 == 0, name)


class Plain(Family):
    """Over one, under one."""

    family: Literal["plain"] = "plain"

    def build(self) -> Draft:
        """Weave it."""
        return plain()


class Rib(Family):
    """Plain weave with groups in one direction."""

    family: Literal["rib"] = "rib"
    ends: Group = 1
    """Ends that move together."""
    picks: Group = 2
    """Picks that lie together."""

    def build(self) -> Draft:
        """Weave it."""
        return rib(self.ends, self.picks)


class Basket(Family):
    """Plain weave with groups in both directions."""

    family: Literal["basket"] = "basket"
    ends: Group = 2
    """Ends that move together."""
    picks: Group = 2
    """Picks that lie together."""

    def build(self) -> Draft:
        """Weave it."""
        return basket(self.ends, self.picks)
