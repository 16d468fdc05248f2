"""Options of `soft_nodes`: its levels of detail."""

from __future__ import annotations

from typing import ClassVar, Literal

from pydantic import Field

from pipeline.models.options import Name, Options

Level = Literal[1, 2, 4, 8]
"""A level of detail."""


class SoftNodesOptions(Options):
    """Soft nodes, as in `selvage`, without a network; nothing is trained."""

    learns: ClassVar[bool] = False
    turns: ClassVar[bool] = True
    parameter: ClassVar[str] = "levels"
    seconds: ClassVar[tuple[float, float]] = (0.0, 2.5e-7)

    model: Literal["soft_nodes"] = "soft_nodes"
    """Name of its folder in `pipeline.models`."""
    name: Name = "soft_nodes"
    """Name in tables."""
    levels: list[Level] = Field(default=[1, 2, 4, 8], min_length=1, max_length=4)
    """Levels of detail k, from few nodes to many; each is a row of the tables."""
    footprint: Literal["gaussian"] = "gaussian"
    """Kernel of the soft nodes; must be the kernel of the truth."""

    @property
    def kinds(self) -> frozenset[str]:
        """Footprints of any shape, light from behind, and curved cloth."""
        return frozenset({"stretch", "behind", "curvature"})
