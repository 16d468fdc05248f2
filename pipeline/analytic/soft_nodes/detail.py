"""Levels of detail of the soft nodes: how many nodes a cloth and a footprint have, k from few to many."""

from __future__ import annotations

from typing import Final, NamedTuple


class Detail(NamedTuple):
    """How fine the nodes of a table are.

    Attributes
    ----------
    most : int
        Nodes of all groups of pieces on top above which groups are merged; half as many beneath.
    along : float
        Nodes along a yarn, as a multiple of those at level 2.
    parts : int
        Parts of a yarn across, each with nodes of its own.
    legendre : int
        Most nodes along each axis of a piece that a narrow footprint covers in part.
    narrow : float
        Deviation, in yarn spacings, below which a footprint places its nodes; at most `NARROW`.
    """

    most: int
    along: float
    parts: int
    legendre: int
    narrow: float


DETAILS: Final = {
    1: Detail(most=64, along=0.5, parts=1, legendre=5, narrow=0.15),
    2: Detail(most=256, along=1.0, parts=1, legendre=6, narrow=0.25),
    4: Detail(most=1024, along=1.0, parts=2, legendre=6, narrow=0.25),
    8: Detail(most=2048, along=2.0, parts=2, legendre=6, narrow=0.25),
}
"""The details of every level k."""

USUAL: Final = 2
"""The level unless another one is named."""
