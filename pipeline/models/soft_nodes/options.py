"""Options of `soft_nodes`: nothing to choose but the name."""

from __future__ import annotations

from typing import ClassVar, Literal

from pipeline.models.options import Name, Options


class SoftNodesOptions(Options):
    """Soft nodes, as in `selvage`, without a network; nothing is trained."""

    learns: ClassVar[bool] = False
    turns: ClassVar[bool] = True
    seconds: ClassVar[tuple[float, float]] = (0.0, 1.2e-6)

    model: Literal["soft_nodes"] = "soft_nodes"
    """Name of its folder in `pipeline.models`."""
    name: Name = "soft_nodes"
    """Name in tables."""
    footprint: Literal["gaussian"] = "gaussian"
    """Kernel of the soft nodes; must be the kernel of the truth."""

    @property
    def kinds(self) -> frozenset[str]:
        """Footprints of any shape, and light from behind."""
        return frozenset({"stretch", "behind"})
