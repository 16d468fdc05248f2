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

from collections.abc import Sequence
from typing import Any

from pipeline.analytic.summed_area.answer import answer
from pipeline.analytic.summed_area.tables import tabulate
from pipeline.compiled.arrays import Float32
from pipeline.models.per_fabric import PerFabric
from pipeline.models.plain import refuse_other
from pipeline.models.summed_area.options import SummedAreaOptions
from pipeline.truth.query import Queries
from weaves.fabric import Fabric


class SummedArea:
    """Tables of k clusters.

    Parameters
    ----------
    clusters : int
        Clusters of both families, k: a multiple of 8.
    name : str
        Name of the method.
    """

    def __init__(self, clusters: int, name: str = "summed_area") -> None:
        self.name, self.setting = name, f"k = {clusters}"
        self._tables = PerFabric(lambda fabric: tabulate(fabric, clusters))

    def covers(self, fabric: Fabric) -> bool:
        """Return True: any fabric can be tabulated."""
        return True

    def prepare(self, fabric: Fabric) -> None:
        """Tabulate the fabric, once."""
        self._tables.of(fabric)

    def predict(self, fabric: Fabric, queries: Queries, seed: int = 0) -> Float32:
        """Answer N queries, float32 (N, 4); `seed` is not used. BadInput for kinds of queries that it does not know."""
        refuse_other(queries, self.name, stretch=True)
        return answer(self._tables.of(fabric), queries)

    def bytes_stored(self, fabric: Fabric) -> int:
        """Return the bytes of the tables."""
        return self._tables.of(fabric).nbytes


def restore(options: SummedAreaOptions, trained: Sequence[tuple[dict[str, Any], Any]]) -> list[SummedArea]:
    """Return one method for each number of clusters."""
    return [SummedArea(clusters, options.name) for clusters in options.clusters]
