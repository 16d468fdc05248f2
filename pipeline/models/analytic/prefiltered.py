"""Prefiltered normals: MIP maps of normal and tangent, one point model a query and family, no shadows.

The formulas are in pipeline.analytic.prefiltered. The method ignores that points hide one another, and that the mean of
a product is not the product of the means.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar, Literal

from pipeline.models.analytic.adapter import Analytic, AnalyticOptions
from pipeline.per_fabric import PerFabric

if TYPE_CHECKING:
    from pipeline.analytic.prefiltered import PrefilteredMaps


class PrefilteredOptions(AnalyticOptions):
    """MIP maps of normals and tangents, one point model a query and family; nothing is trained."""

    seconds: ClassVar[tuple[float, float]] = (0.0, 5e-7)
    prepare_seconds: ClassVar[float] = 0.3

    model: Literal["prefiltered"] = "prefiltered"

    def methods(self) -> list[Analytic[PrefilteredMaps]]:
        """Return the one method."""
        from pipeline.analytic.prefiltered import answer, tabulate

        def stored(tables: PrefilteredMaps) -> int:
            return tables.maps.texels.nbytes + self.parallax * tables.heights.maps.texels.nbytes

        tables = PerFabric(lambda fabric: tabulate(fabric, self.parallax))
        return [Analytic(self, None, tables, lambda tables, queries, _: answer(tables, queries), stored)]
