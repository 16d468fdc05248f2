"""Options of `point_sampled`: how many points, which ones, and how their shadows are found."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

from pydantic import Field, model_validator

from pipeline.models.options import Name, Options

Count = Annotated[int, Field(ge=1, le=4096)]
"""A number of random points per query."""


class PointSampledOptions(Options):
    """The point model at k random points of the footprint [Jin2022Woven]; nothing is trained."""

    learns: ClassVar[bool] = False
    parameter: ClassVar[str] = "counts"
    seconds: ClassVar[tuple[float, float]] = (0.0, 4e-7)

    model: Literal["point_sampled"] = "point_sampled"
    """Name of its folder in `pipeline.models`."""
    name: Name = "point_sampled"
    """Name in tables."""
    counts: list[Count] = Field(default=[1, 2, 3, 4, 8, 16, 64], min_length=1, max_length=16)
    """Numbers k of points a query; each is a row of the tables."""
    footprint: Literal["gaussian", "box"] = "gaussian"
    """Kernel the points are drawn from; must be the kernel of the truth."""
    sequence: Literal["random", "r2"] = "random"
    """Independent points, or the R2 sequence with one random shift a query."""
    visibility: Literal["exact", "horizon", "soft_horizon"] = "exact"
    """A march through the cloth in double precision, or a look-up of tabulated horizons in single precision, as steps
    or as ramps."""
    horizon_nodes: int = Field(default=32, ge=4, le=128)
    """Nodes of the horizon map on each piece of yarn in a cell, across and along; the nearest is taken."""
    azimuths: int = Field(default=64, ge=8, le=512)
    """Directions of the horizon map; linear between them."""

    @model_validator(mode="after")
    def _horizons_of_gaussians(self) -> PointSampledOptions:
        if self.visibility != "exact" and self.footprint != "gaussian":
            raise ValueError(f"visibility = {self.visibility!r} needs footprint = 'gaussian'")
        return self

    @property
    def kinds(self) -> frozenset[str]:
        """All, with exact visibility; without, footprints of any shape."""
        return frozenset({"behind", "stretch", "curvature"} if self.visibility == "exact" else {"stretch"})
