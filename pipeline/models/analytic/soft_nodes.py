"""Sums over few nodes with soft shadows; nothing is trained.

A cloth's table holds some tens to hundreds of nodes with normals, tangents and softened horizons
(pipeline.analytic.soft_nodes); a query becomes one sum over them. Time and error depend on the level of detail; a wide
footprint has less of both than a narrow one. Light from behind and transparency need the horizons of the back too, and
curved cloth those of some curvatures: they are tabulated at the first such query.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar, Final, Literal
from weakref import WeakValueDictionary

from pydantic import Field

from pipeline.compiled.arrays import Float32
from pipeline.models.analytic.adapter import Analytic, AnalyticOptions
from pipeline.models.method import in_chunks, row_by_row
from pipeline.per_fabric import PerFabric
from pipeline.truth.options import Walls
from pipeline.truth.query import Queries
from weaves.fabric import Fabric

if TYPE_CHECKING:
    from pipeline.analytic.soft_nodes.nodes import SoftNodeTable

Level = Literal[0, 1, 2, 4, 8]  # a level of detail

_SHARED: Final[WeakValueDictionary[tuple[object, ...], PerFabric[SoftNodeTable]]] = WeakValueDictionary()


def soft_tables(level: int, behind: bool = False, curved: bool = False, rims: bool = True) -> PerFabric[SoftNodeTable]:
    """Return the tables of fabrics at a level of detail, which all methods at hand share."""
    from pipeline.analytic.soft_nodes.nodes import tabulate

    tables = PerFabric(lambda fabric: tabulate(fabric, False, behind, level, curved, rims))
    return _SHARED.setdefault((level, behind, curved, rims), tables)


class SoftNodesOptions(AnalyticOptions):
    """Sums over soft nodes; nothing is trained."""

    turns: ClassVar[bool] = True
    kinds: ClassVar[frozenset[str]] = frozenset({"stretch", "behind", "curvature"})
    parameter: ClassVar[str] = "levels"
    seconds: ClassVar[tuple[float, float]] = (0.0, 1e-6)
    prepare_seconds: ClassVar[float] = 1.2

    model: Literal["soft_nodes"] = "soft_nodes"
    levels: list[Level] = Field(default=[0, 1, 2, 4, 8], min_length=1, max_length=5)
    """Levels of detail k, from few nodes to many, 0 without nodes of a footprint's own; each is a row of the tables."""
    parallax: Literal[True] = True
    """Footprints are patches of view rays."""
    walls: Walls = "rim"
    """Meaning of a view ray that meets a wall; must be that of the truth."""

    def methods(self) -> list[SoftNodes]:
        """Return one method for each level."""
        return [SoftNodes(level, self.name, self.walls) for level in self.levels]


class SoftNodes(Analytic["SoftNodeTable"]):
    """Soft nodes of one level of `pipeline.analytic.soft_nodes.groups.DETAILS`; rays that meet a wall see `walls`."""

    turns: ClassVar[bool] = SoftNodesOptions.turns

    def __init__(self, level: int = 2, name: str = "soft_nodes", walls: Walls = "rim") -> None:
        from pipeline.analytic.soft_nodes.components import read_queries

        def read(table: SoftNodeTable, queries: Queries, seed: int) -> Float32:
            return in_chunks(queries, lambda part: read_queries(table, part).components)

        rims = walls == "rim"
        super().__init__(SoftNodesOptions(name=name), level, soft_tables(level, False, False, rims), read)
        self._both_sides = soft_tables(level, True, False, rims)
        self._curved = soft_tables(level, True, True, rims)

    def behind(self, fabric: Fabric, queries: Queries) -> Float32:
        """Answer N queries with the light behind: components and transparency, float32 (N, 5)."""
        from pipeline.analytic.soft_nodes.components import read_behind

        table = self.table_for(fabric, queries)
        return in_chunks(queries, lambda part: read_behind(table, part), 5)

    def transparency(self, fabric: Fabric, looks: Queries, seed: int = 0) -> Float32:
        """Return the transparency of N footprints, float32 (N,), of a viewer in front; no light changes it."""
        return self.behind(fabric, looks._replace(wi=-looks.wo))[:, 4]

    def coverage(self, fabric: Fabric, looks: Queries) -> Float32:
        """Return the share of view rays that do not leave curved cloth again, float32 (N,)."""
        from pipeline.analytic.coverage import quick_coverage

        return quick_coverage(fabric, looks)

    def table_for(self, fabric: Fabric, queries: Queries) -> SoftNodeTable:
        """Return the smallest table that knows all queries; every table answers what it knows by the same bits."""
        if (queries.curvature > 0.0).any():
            return self._curved.of(fabric)
        return (self._both_sides if (queries.wi[:, 2] < 0.0).any() else self._tables).of(fabric)

    def _answer(self, fabric: Fabric, queries: Queries, seed: int) -> Float32:
        """Answer queries lit from either side."""
        return row_by_row(
            queries,
            queries.wi[:, 2] < 0.0,
            lambda part: self.behind(fabric, part)[:, :4],
            lambda part: self._read(self.table_for(fabric, part), part, seed),
        )
