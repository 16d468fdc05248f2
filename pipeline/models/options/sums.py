"""Options of `sums`: nothing to choose but the name."""

from __future__ import annotations

from typing import ClassVar, Literal

from pipeline.models.options.base import Name, Options


class SumsOptions(Options):
    """The sums of `selvage` without its network; nothing is trained."""

    learns: ClassVar[bool] = False
    seconds: ClassVar[tuple[float, float]] = (0.0, 1.2e-6)

    model: Literal["sums"] = "sums"
    """Which file of `pipeline.models` implements it."""
    name: Name = "sums"
    """Name in tables."""
    footprint: Literal["gaussian"] = "gaussian"
    """Kernel of the sums; must be the kernel of the truth."""

    @property
    def kinds(self) -> frozenset[str]:
        """Footprints of any shape."""
        return frozenset({"stretch"})
