"""Tables of the visible area of clusters of normals and fibre directions, summed over footprints.

This is ours after the idea of Zhu et al. (2024), whose text we could not read: not their method, and its numbers say
nothing about theirs. The idea: parts of the repeat that have alike normals and fibres are clusters; tables tell how
much of a cluster a viewer sees within a footprint; the point model is evaluated once a cluster. Ours are the choice of
clusters (k-means of inclinations and horizons), Gaussian windows in place of boxes, and horizons as ramps, which give
the area that both viewer and light reach (pipeline.analytic.summed_area). Corrections by sampled points, which belong
to that idea, did not help: reports/LOG.md. Footprints smaller than the finest tables are answered as those are: a
sixteenth of a yarn spacing, an eighth for cloth of many different cells.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal

from pydantic import Field

from pipeline.models.analytic.adapter import Analytic, AnalyticOptions
from pipeline.per_fabric import PerFabric

if TYPE_CHECKING:
    from pipeline.analytic.summed_area.tables import ClusterTables

Clusters = Annotated[int, Field(ge=16, le=512, multiple_of=8)]
"""A number of clusters of both families: a multiple of 8, the parts across a yarn."""


class SummedAreaOptions(AnalyticOptions):
    """Tables of the visible area of clusters, ours after the idea of Zhu et al. (2024); nothing is trained."""

    parameter: ClassVar[str] = "clusters"
    seconds: ClassVar[tuple[float, float]] = (0.0, 3e-8)
    prepare_seconds: ClassVar[float] = 1.8

    model: Literal["summed_area"] = "summed_area"
    clusters: list[Clusters] = Field(default=[32, 64, 128], min_length=1, max_length=16)
    """Numbers k of clusters of both families; each is a row of the tables."""

    @property
    def kinds(self) -> frozenset[str]:
        """Footprints of any shape: a long one is the mean of round ones along its longer axis."""
        return frozenset({"stretch"})

    def methods(self) -> list[Analytic[ClusterTables]]:
        """Return one method for each number of clusters."""
        from pipeline.analytic.summed_area.answer import answer
        from pipeline.analytic.summed_area.tables import tabulate

        tables = {k: PerFabric(partial(tabulate, clusters=k, parallax=self.parallax)) for k in self.clusters}
        return [Analytic(self, k, tables[k], lambda table, queries, _: answer(table, queries)) for k in self.clusters]
