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

from collections.abc import Sequence
from math import gcd
from typing import Annotated, Literal

import numpy as np
from pydantic import BeforeValidator, Field, StrictInt

from weaves.draft import LARGEST_REPEAT, Draft, Family
from weaves.errors import BadInput

MOST_WIDTH = LARGEST_REPEAT // 2  # most ends of a stripe of a herringbone, which has two


Steps = Annotated[
    tuple[Annotated[StrictInt, Field(ge=1, le=64)], ...],
    BeforeValidator(lambda value: (value,) if isinstance(value, int) else value),  # one step needs no brackets
    Field(min_length=1, max_length=16),
]


class Plain(Family):
    """Over one, under one."""

    family: Literal["plain"] = "plain"

    def build(self) -> Draft:
        """Weave it."""
        return _blocks(1, 1, "plain")


class Rib(Family):
    """Plain weave with groups in one direction: `picks` together make a warp rib, `ends` together a weft rib."""

    family: Literal["rib"] = "rib"
    ends: StrictInt = Field(default=1, ge=1, le=16)  # ends that move together
    picks: StrictInt = Field(default=2, ge=1, le=16)  # picks that lie together

    def build(self) -> Draft:
        """Weave it; BadInput unless exactly one of the two numbers is 1."""
        if (self.ends == 1) == (self.picks == 1):
            allowed = f"one of ends and picks is 1 and the other is more; ends is {self.ends}"
            raise BadInput("rib", "picks", self.picks, allowed)
        return _blocks(self.ends, self.picks, f"rib {self.ends}x{self.picks}")


class Basket(Family):
    """Plain weave with groups in both directions, of `ends` and of `picks`."""

    family: Literal["basket"] = "basket"
    ends: StrictInt = Field(default=2, ge=2, le=16)
    picks: StrictInt = Field(default=2, ge=2, le=16)

    def build(self) -> Draft:
        """Weave it."""
        return _blocks(self.ends, self.picks, f"basket {self.ends}x{self.picks}")


def _blocks(ends: int, picks: int, name: str) -> Draft:
    pick, end = np.ogrid[: 2 * picks, : 2 * ends]
    return Draft((pick // picks + end // ends) % 2 == 0, name)


class _Stepped(Family):
    """A weave all of whose ends take the same steps."""

    over: Steps  # picks each end passes over: one number, or one a step
    under: Steps  # picks it then passes under

    def one_end(self) -> list[bool]:
        """Follow one end through a repeat: True where it is over the pick."""
        over, under = list(self.over), list(self.under)
        if len(over) != len(under):
            raise BadInput("twill", "under", under, f"as many steps as over are needed, which has {len(over)}")
        if sum(over) + sum(under) > LARGEST_REPEAT:
            raise BadInput("twill", "over", over, f"at most {LARGEST_REPEAT} picks, with under, are allowed")
        return [side for up, down in zip(over, under, strict=True) for side in (True,) * up + (False,) * down]

    def shifted(self, kind: str, shifts: Sequence[int]) -> Draft:
        """Lay the same end side by side, end i moved up by `shifts[i]` picks."""
        end = np.array(self.one_end())
        pick = np.arange(len(end))[:, None]
        steps = " ".join(f"{up}/{down}" for up, down in zip(self.over, self.under, strict=True))
        return Draft(end[(pick - np.array(shifts)) % len(end)], f"{kind} {steps}")


class Twill(_Stepped):
    """A straight twill, or a broken one, which turns round after half a repeat: of 4 ends it takes 0, 1, 3, 2."""

    family: Literal["twill", "broken_twill"] = "twill"
    direction: Literal["right", "left"] = "right"
    """Side to which the diagonal rises, of a broken twill that of the first half."""

    def build(self) -> Draft:
        """Weave it; BadInput for steps that do not pair up or are too many, and if nothing is left to break."""
        shifts = list(range(len(self.one_end())))
        if self.family == "broken_twill":
            if len(shifts) < 4:
                allowed = f"a repeat of at least 4 picks is needed, this one has {len(shifts)}"
                raise BadInput("broken twill", "over", list(self.over), allowed)
            half = len(shifts) // 2
            shifts[half:] = reversed(shifts[half:])
        draft = self.shifted(self.family.replace("_", " "), shifts)
        return draft if self.direction == "right" else Draft(draft.warp_over[:, ::-1], f"{draft.name} left")


class Herringbone(_Stepped):
    """Stripes of right-hand and left-hand twill."""

    family: Literal["herringbone"] = "herringbone"
    width: StrictInt | None = Field(default=None, ge=2, le=MOST_WIDTH)
    """Ends of a stripe; one repeat of the twill if left out."""

    def build(self) -> Draft:
        """Weave it; BadInput as `Twill.build`."""
        picks = len(self.one_end())
        width = picks if self.width is None else self.width
        if width > MOST_WIDTH:
            raise BadInput("herringbone", "width", width, f"stripes of 2 to {MOST_WIDTH} ends are possible")
        turn = width - 1 + picks // 2
        draft = self.shifted("herringbone", [*range(width), *range(turn, turn - width, -1)])
        return draft if width == picks else Draft(draft.warp_over, f"{draft.name} width {width}")


def valid_moves(ends: int) -> list[int]:
    """Return the moves that make a satin of `ends` ends: coprime to it, and neither 1 nor ends - 1."""
    return [move for move in range(2, ends - 1) if gcd(move, ends) == 1]


class Satin(Family):
    """A satin, which shows the warp, or a sateen, which shows the weft."""

    family: Literal["satin", "sateen"] = "satin"
    ends: StrictInt = Field(default=5, ge=5, le=LARGEST_REPEAT)  # ends, and picks, of the repeat
    move: StrictInt = 2  # ends from one binding point to that of the next pick

    def build(self) -> Draft:
        """Weave it; BadInput if the move makes no satin, with those that would."""
        ends, move = self.ends, self.move
        if move not in (moves := valid_moves(ends)):
            listed = f"{ends} ends allow {', '.join(map(str, moves))}" if moves else f"{ends} ends allow none"
            others = [str(other) for other in (ends - 1, ends + 1) if valid_moves(other)]
            hint = "" if moves else f"; try {' or '.join(others)} ends"
            allowed = f"a move shares no factor with the ends and is not 1 or ends - 1: {listed}{hint}"
            raise BadInput(self.family, "move", move, allowed)
        pick, end = np.ogrid[:ends, :ends]
        bound = end == pick * move % ends
        return Draft(bound if self.family == "sateen" else ~bound, f"{self.family} {ends}/{move}")
