"""The point model at k points of the footprint, as in a renderer without prefiltering [Jin2022Woven].

The points are independent draws from the footprint's kernel, or the R2 sequence with one random shift a query
[Roberts2018R2]; the answer is the ratio of the sums over points (pipeline.truth.scattering.point), as [Chen2024Woven]
modified the baseline. Cheap at k = 1; the error falls as k^(-1/2), with R2 somewhat faster, and what is left shows as
aliasing. Visibility is exact, by a march through the cloth in double precision, or looked up in a horizon map in single
precision, at a tenth of the time and with a bias that more points do not lower
(pipeline.analytic.horizon_points.sampler).
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

from pydantic import Field, model_validator

from pipeline.compiled.arrays import Float32, nbytes
from pipeline.models.analytic.adapter import Analytic, AnalyticOptions
from pipeline.models.method import Method
from pipeline.per_fabric import PerFabric
from pipeline.truth.options import TruthOptions, Walls, with_usual_walls
from pipeline.truth.query import Queries
from weaves.fabric import Fabric

if TYPE_CHECKING:
    from pipeline.analytic.horizon_points.horizon_map import HorizonMap
    from pipeline.truth.cloth import ClothSide  # noqa: F401 - read by the type checker in a base class

Count = Annotated[int, Field(ge=1, le=4096)]
"""A number of random points per query."""


class PointSampledOptions(AnalyticOptions):
    """The point model at k random points of the footprint [Jin2022Woven]; nothing is trained."""

    parameter: ClassVar[str] = "counts"
    seconds: ClassVar[tuple[float, float]] = (0.0, 4e-7)
    fixed: ClassVar[tuple[str, ...]] = ("horizon_nodes", "azimuths")

    model: Literal["point_sampled"] = "point_sampled"
    counts: list[Count] = Field(default=[1, 2, 3, 4, 8, 16, 64], min_length=1, max_length=16)
    """Numbers k of points a query; each is a row of the tables."""
    footprint: Literal["gaussian", "box"] = "gaussian"  # type: ignore[assignment]
    """Kernel the points are drawn from; must be the kernel of the truth."""
    sequence: Literal["random", "r2"] = "random"
    """Independent points, or the R2 sequence with one random shift a query."""
    visibility: Literal["exact", "horizon", "soft_horizon"] = "exact"
    """A march through the cloth in double precision, or a look-up of tabulated horizons in single precision, as steps
    or as ramps."""

    walls: Walls = "rim"
    """Meaning of a view ray that meets a wall; must be that of the truth."""

    horizon_nodes: ClassVar[int] = 32
    """Nodes of the horizon map on each piece of yarn in a cell, across and along; the nearest is taken."""
    azimuths: ClassVar[int] = 64
    """Directions of the horizon map; linear between them."""

    @model_validator(mode="before")
    @classmethod
    def _usual_walls(cls, options: Any) -> Any:
        return with_usual_walls(options)

    @model_validator(mode="after")
    def _horizons_of_gaussians(self) -> PointSampledOptions:
        if self.visibility != "exact" and self.footprint != "gaussian":
            raise ValueError(f"visibility = {self.visibility!r} needs footprint = 'gaussian'")
        if self.visibility != "exact" and self.parallax:
            raise ValueError(f"visibility = {self.visibility!r} knows no view rays: parallax needs 'exact'")
        return self

    @property
    def kinds(self) -> frozenset[str]:
        """All, with exact visibility; without, footprints of any shape."""
        return frozenset({"behind", "stretch", "curvature"} if self.visibility == "exact" else {"stretch"})

    def methods(self) -> Sequence[Method]:
        """Return one method for each number of points."""
        if self.visibility == "exact":
            return [ExactPoints(self, k) for k in self.counts]
        from pipeline.analytic.horizon_points.sampler import sample_horizons, tabulate

        r2, soft = self.sequence == "r2", self.visibility == "soft_horizon"
        maps = PerFabric(lambda fabric: tabulate(fabric, self.horizon_nodes, self.azimuths))

        def read(count: int, table: HorizonMap, queries: Queries, seed: int) -> Float32:
            return sample_horizons(table, queries, count, r2, seed, soft)

        return [Analytic(self, k, maps, partial(read, k)) for k in self.counts]


class ExactPoints(Analytic["ClothSide"]):
    """Point sampling with exact visibility.

    Parameters
    ----------
    options : PointSampledOptions
        The design.
    count : int
        Points a query, k.
    """

    def __init__(self, options: PointSampledOptions, count: int) -> None:
        from pipeline.analytic.exact_points import sample_points
        from pipeline.truth.cloth import cloth_side

        truth = TruthOptions(footprint=options.footprint, parallax=options.parallax, walls=options.walls)
        self._count, self._r2 = count, options.sequence == "r2"
        super().__init__(
            options,
            count,
            PerFabric(lambda fabric: cloth_side(fabric, truth)),
            lambda cloth, queries, seed: sample_points(cloth, queries, count, seed, self._r2),
            lambda cloth: nbytes(cloth.front),
        )

    def transparency(self, fabric: Fabric, looks: Queries, seed: int = 0) -> Float32:
        """Return the transparency of N footprints, float32 (N,), of the points that `predict` has with this seed."""
        from pipeline.analytic.exact_points import sample_transparency

        return sample_transparency(self._tables.of(fabric), looks, self._count, seed, self._r2)
