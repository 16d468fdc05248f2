"""Sums over few nodes with soft shadows: `selvage` without its network.

A cloth's table holds some tens to hundreds of nodes with normals, tangents and softened horizons
(pipeline.analytic.soft_nodes); a query becomes one sum over them and costs from half a microsecond to two, by the level
of detail. The error is one to three per cent of the answer for a wide footprint, and more for a narrow one. Light from
behind and transparency need the horizons of the back too, and curved cloth those of some curvatures: they are
tabulated at the first such query.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt

from pipeline.analytic.soft_nodes.features import read_behind, read_queries
from pipeline.analytic.soft_nodes.groups import USUAL
from pipeline.analytic.soft_nodes.nodes import SoftNodeTable, tabulate
from pipeline.models.method import CHUNK
from pipeline.models.per_fabric import PerFabric
from pipeline.models.plain import refuse_other
from pipeline.models.soft_nodes.options import SoftNodesOptions
from pipeline.truth.query import Queries
from weaves.fabric import Fabric


class SoftNodes:
    """Soft nodes without a network; nothing is learnt.

    Parameters
    ----------
    level : int
        Level of detail, one of DETAILS.
    name : str
        Name of the method.
    """

    turns: ClassVar[bool] = SoftNodesOptions.turns

    def __init__(self, level: int = USUAL, name: str = "soft_nodes") -> None:
        self.name, self.setting = name, f"k = {level}"
        self._tables = PerFabric(lambda fabric: tabulate(fabric, level=level))
        self._behind = PerFabric(lambda fabric: tabulate(fabric, behind=True, level=level))
        self._curved = PerFabric(lambda fabric: tabulate(fabric, behind=True, level=level, curved=True))

    def covers(self, fabric: Fabric) -> bool:
        """Return True: any fabric can be tabulated."""
        return True

    def prepare(self, fabric: Fabric) -> None:
        """Tabulate the fabric, once."""
        self._tables.of(fabric)

    def predict(self, fabric: Fabric, queries: Queries, seed: int = 0) -> npt.NDArray[np.float32]:
        """Answer N queries, float32 (N, 4); `seed` is not used. BadInput for kinds of queries that it does not know."""
        refuse_other(queries, self.name, stretch=True, behind=True, curvature=True)
        behind = queries.wi[:, 2] < 0.0
        if not behind.any():
            return self._front(fabric, queries)
        result = np.empty((len(behind), 4), np.float32)
        result[behind] = self.behind(fabric, queries.take(behind))[:, :4]
        result[~behind] = self._front(fabric, queries.take(~behind))
        return result

    def behind(self, fabric: Fabric, queries: Queries) -> npt.NDArray[np.float32]:
        """Answer N queries with the light behind: components and transparency, float32 (N, 5)."""
        table, result = self.table_for(fabric, queries), np.empty((len(queries.u), 5), np.float32)
        for start in range(0, len(result), CHUNK):
            rows = slice(start, start + CHUNK)
            result[rows] = read_behind(table, queries.take(rows))
        return result

    def transparency(self, fabric: Fabric, looks: Queries, seed: int = 0) -> npt.NDArray[np.float32]:
        """Return the transparency of N footprints, float32 (N,), of a viewer in front; no light changes it."""
        return self.behind(fabric, looks._replace(wi=-looks.wo))[:, 4]

    def table_for(self, fabric: Fabric, queries: Queries) -> SoftNodeTable:
        """Return the smallest table that knows all queries; every table answers what it knows by the same bits."""
        if (queries.curvature > 0.0).any():
            return self._curved.of(fabric)
        return (self._behind if (queries.wi[:, 2] < 0.0).any() else self._tables).of(fabric)

    def _front(self, fabric: Fabric, queries: Queries) -> npt.NDArray[np.float32]:
        """Answer N queries with the light in front."""
        table, result = self.table_for(fabric, queries), np.empty((len(queries.u), 4), np.float32)
        for start in range(0, len(result), CHUNK):
            rows = slice(start, start + CHUNK)
            result[rows] = read_queries(table, queries.take(rows)).components
        return result

    def bytes_stored(self, fabric: Fabric) -> int:
        """Return the bytes of the table; light from behind doubles it, curved cloth makes it five times as large."""
        return self._tables.of(fabric).nbytes


def restore(options: SoftNodesOptions, trained: Sequence[tuple[dict[str, Any], Any]]) -> list[SoftNodes]:
    """Return one method for each level."""
    return [SoftNodes(level, options.name) for level in options.levels]
