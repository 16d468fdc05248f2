"""Options of `table`: how many nodes, and in how many directions horizons are known."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

from pydantic import Field

from pipeline.models.options.base import Gaussian, Name, Options

Nodes = Annotated[int, Field(ge=4, le=64)]
"""A number of nodes a yarn spacing."""


class TableOptions(Options):
    """The ground truth's own table as a method: sums over k nodes a yarn spacing; nothing is trained."""

    learns: ClassVar[bool] = False
    knob: ClassVar[str] = "nodes"
    seconds: ClassVar[tuple[float, float]] = (0.0, 1.2e-6)

    model: Literal["table"] = "table"
    """Which file of `pipeline.models` implements it."""
    footprint: Gaussian = "gaussian"
    name: Name = "table"
    """Name in tables."""
    nodes: list[Nodes] = Field(default=[8, 12, 16, 24, 32], min_length=1, max_length=16)
    """Numbers k of nodes a yarn spacing; each is a row of the tables."""
    azimuths: int = Field(default=128, ge=8, le=512)
    """Directions in which horizons are known."""

    @property
    def kinds(self) -> frozenset[str]:
        """Footprints of any shape."""
        return frozenset({"stretch"})
