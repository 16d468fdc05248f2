"""Options of `gauss_nodes`: the rule's nodes and their shadows."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

from pydantic import Field

from pipeline.models.options import Gaussian, Name, Options

Nodes = Annotated[int, Field(ge=2, le=16)]
"""A number of nodes across a yarn."""


class GaussNodesOptions(Options):
    """Gauss-Legendre rules on every piece of yarn, k nodes across it; nothing is trained."""

    learns: ClassVar[bool] = False
    parameter: ClassVar[str] = "nodes"
    seconds: ClassVar[tuple[float, float]] = (0.0, 3e-7)

    model: Literal["gauss_nodes"] = "gauss_nodes"
    """Name of its folder in `pipeline.models`."""
    footprint: Gaussian = "gaussian"
    name: Name = "gauss_nodes"
    """Name in tables."""
    nodes: list[Nodes] = Field(default=[2, 4, 6, 8, 12, 16], min_length=1, max_length=15)
    """Numbers k of nodes across a yarn; each is a row of the tables."""
    along: float = Field(default=0.5, ge=0.125, le=1)
    """Nodes along a cell as a share of those across; at least 2. Equal numbers cost twice the time and gain nothing."""
    shadows: Literal["soft", "hard", "none"] = "soft"
    """True if horizons hide nodes: by a ramp as wide as the horizon spreads over the node, by a step, or not at all."""
    horizon_nodes: int = Field(default=16, ge=4, le=128)
    """Nodes of the horizon map on each piece of yarn in a cell, across and along."""
    azimuths: int = Field(default=32, ge=8, le=512)
    """Directions of the horizon map; linear between them."""

    @property
    def kinds(self) -> frozenset[str]:
        """Footprints of any shape."""
        return frozenset({"stretch"})
