"""Sums over few nodes with soft shadows: `selvage` without its network.

A cloth's table holds some tens to hundreds of nodes with normals, tangents and softened horizons
(pipeline.analytic.soft_nodes); a query becomes one sum over them and costs from half a microsecond to two, by the level
of detail. The error is one to three per cent of the answer for a wide footprint, and more for a narrow one. Light from
behind and transparency need the horizons of the back too, and curved cloth those of some curvatures: they are
tabulated at the first such query.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt

from pipeline.analytic.soft_nodes.behind import read_behind
from pipeline.analytic.soft_nodes.detail import USUAL
from pipeline.analytic.soft_nodes.features import read_queries
from pipeline.analytic.soft_nodes.nodes import Table, tabulate
from pipeline.models.method import CHUNK
from pipeline.models.per_fabric import PerFabric
from pipeline.models.plain import refuse_other
from pipeline.models.soft_nodes.options import SoftNodesOptions
from pipeline.truth.query import Queries
from weaves.fabric import Fabric

Read = Callable[[Table, Queries], npt.NDArray[np.float32]]
"""Reads queries from a table."""


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
            return self._by_curvature(self._tables, fabric, queries, _in_front, 4)
        result = np.empty((len(behind), 4), np.float32)
        result[behind] = self.behind(fabric, queries.take(behind))[:, :4]
        result[~behind] = self._by_curvature(self._tables, fabric, queries.take(~behind), _in_front, 4)
        return result

    def behind(self, fabric: Fabric, queries: Queries) -> npt.NDArray[np.float32]:
        """Answer N queries with the light behind: components and transparency, float32 (N, 5)."""
        return self._by_curvature(self._behind, fabric, queries, read_behind, 5)

    def transparency(self, fabric: Fabric, looks: Queries) -> npt.NDArray[np.float32]:
        """Return the transparency of N footprints, float32 (N,), of a viewer in front; no light changes it."""
        return self.behind(fabric, looks._replace(wi=-looks.wo))[:, 4]

    def _by_curvature(
        self, tables: PerFabric[Table], fabric: Fabric, queries: Queries, read: Read, width: int
    ) -> npt.NDArray[np.float32]:
        """Answer N queries, (N, width): those about flat cloth by one table, others by that of curved cloth."""
        curved = queries.curvature > 0.0
        if not curved.any():
            return _in_chunks(tables.of(fabric), queries, read, width)
        if curved.all():
            return _in_chunks(self._curved.of(fabric), queries, read, width)
        result = np.empty((len(curved), width), np.float32)
        result[curved] = _in_chunks(self._curved.of(fabric), queries.take(curved), read, width)
        result[~curved] = _in_chunks(tables.of(fabric), queries.take(~curved), read, width)
        return result

    def bytes_stored(self, fabric: Fabric) -> int:
        """Return the bytes of the table; light from behind doubles it, curved cloth makes it five times as large."""
        return self._tables.of(fabric).nbytes


def _in_front(table: Table, queries: Queries) -> npt.NDArray[np.float32]:
    """Return the components of N queries with the light in front, (N, 4)."""
    return read_queries(table, queries).components


def _in_chunks(table: Table, queries: Queries, read: Read, width: int) -> npt.NDArray[np.float32]:
    """Return what `read` finds, (N, width)."""
    result = np.empty((len(queries.u), width), np.float32)
    for start in range(0, len(result), CHUNK):
        rows = slice(start, start + CHUNK)
        result[rows] = read(table, queries.take(rows))
    return result


def restore(options: SoftNodesOptions, trained: Sequence[tuple[dict[str, Any], Any]]) -> list[SoftNodes]:
    """Return one method for each level."""
    return [SoftNodes(level, options.name) for level in options.levels]
