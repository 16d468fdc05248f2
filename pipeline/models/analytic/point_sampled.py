"""The point model at k points of the footprint, as in a renderer without prefiltering [Jin2022Woven].

The points are independent draws from the footprint's kernel, or the R2 sequence with one random shift a query
[Roberts2018R2]; the answer is the ratio of the sums over points (pipeline.truth.scattering.point). Cheap at k = 1; the
error falls as k^(-1/2), with R2 somewhat faster, and what is left shows as aliasing. With parallax a point is the first
one that a view ray meets, without, a point of the fabric plane, as [Chen2024Woven] modified the baseline.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal

from pydantic import Field

from pipeline.compiled.arrays import Float32, nbytes
from pipeline.models.analytic.adapter import Analytic, AnalyticOptions
from pipeline.models.method import Method
from pipeline.per_fabric import PerFabric
from pipeline.truth.options import TruthOptions, UsualWalls, Walls
from pipeline.truth.query import Queries
from weaves.fabric import Fabric

if TYPE_CHECKING:
    from pipeline.truth.cloth import ClothSide  # noqa: F401 - read by the type checker in a base class

_Count = Annotated[int, Field(ge=1, le=4096)]  # of points


class PointSampledOptions(UsualWalls, AnalyticOptions):
    """The point model at k random points of the footprint [Jin2022Woven]; nothing is trained."""

    parameter: ClassVar[str] = "counts"
    seconds: ClassVar[tuple[float, float]] = (0.0, 4e-7)
    kinds: ClassVar[frozenset[str]] = frozenset({"behind", "stretch", "curvature"})

    model: Literal["point_sampled"] = "point_sampled"
    counts: list[_Count] = Field(default=[1, 2, 3, 4, 8, 16, 64], min_length=1, max_length=16)
    """Numbers k of points a query; each is a row of the tables."""
    footprint: Literal["gaussian", "box"] = "gaussian"  # type: ignore[assignment]
    """Kernel the points are drawn from; must be the kernel of the truth."""
    sequence: Literal["random", "r2"] = "random"
    """Independent points, or the R2 sequence with one random shift a query."""
    walls: Walls = "rim"
    """Meaning of a view ray that meets a wall; must be that of the truth."""

    def methods(self) -> Sequence[Method]:
        """Return one method for each number of points."""
        return [ExactPoints(self, k) for k in self.counts]


class ExactPoints(Analytic["ClothSide"]):
    """Point sampling with exact visibility, `count` points a query."""

    def __init__(self, options: PointSampledOptions, count: int) -> None:
        from pipeline.analytic.exact_points import sample_points
        from pipeline.truth.cloth import cloth_side

        truth = TruthOptions(footprint=options.footprint, parallax=options.parallax, walls=options.walls)
        self._count, self._r2 = count, options.sequence == "r2"
        super().__init__(
            options,
            count,
            PerFabric(lambda fabric: cloth_side(fabric, truth)),
            lambda cloth, queries, seed: sample_points(cloth, queries, count, seed, self._r2)[:, :4].copy(),
            lambda cloth: nbytes(cloth.front),
        )

    def transparency(self, fabric: Fabric, looks: Queries, seed: int = 0) -> Float32:
        """Return the transparency of N footprints, float32 (N,), of the points that `predict` has with this seed."""
        from pipeline.analytic.exact_points import sample_points

        return sample_points(self._tables.of(fabric), looks, self._count, seed, self._r2)[:, 4]
