"""Options of `summed_area`: how many clusters."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

from pydantic import Field

from pipeline.models.options import Gaussian, Name, Options

Clusters = Annotated[int, Field(ge=16, le=512, multiple_of=8)]
"""A number of clusters of both families: a multiple of 8, the parts across a yarn."""


class SummedAreaOptions(Options):
    """Tables of the visible area of clusters, ours after the idea of Zhu et al. (2024); nothing is trained."""

    learns: ClassVar[bool] = False
    parameter: ClassVar[str] = "clusters"
    seconds: ClassVar[tuple[float, float]] = (0.0, 1e-8)

    model: Literal["summed_area"] = "summed_area"
    """Name of its folder in `pipeline.models`."""
    name: Name = "summed_area"
    """Name in tables."""
    footprint: Gaussian = "gaussian"
    clusters: list[Clusters] = Field(default=[32, 64, 128], min_length=1, max_length=16)
    """Numbers k of clusters of both families; each is a row of the tables."""

    @property
    def kinds(self) -> frozenset[str]:
        """Footprints of any shape: a long one is the mean of round ones along its longer axis."""
        return frozenset({"stretch"})
