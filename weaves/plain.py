"""Plain, rib and basket weaves: neighbouring yarns or groups are on opposite sides.

A plain weave alternates yarn by yarn; a rib moves groups of yarns together in one direction, a basket weave in both.
"""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from pydantic import Field, StrictInt

from weaves.draft import Draft, Family
from weaves.errors import BadInput

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
