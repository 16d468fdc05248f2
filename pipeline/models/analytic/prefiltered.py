"""Prefiltered normals: MIP maps of normal and tangent, one point model a query and family, no shadows.

The formulas are in pipeline.analytic.prefiltered. The method ignores that points hide one another, and that the mean of
a product is not the product of the means.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar, Literal

from pydantic import Field

from pipeline.models.analytic.adapter import Analytic, AnalyticOptions
from pipeline.per_fabric import PerFabric

if TYPE_CHECKING:
    from pipeline.analytic.prefiltered import PrefilteredMaps


class PrefilteredOptions(AnalyticOptions):
    """MIP maps of normals and tangents, one point model a query and family; nothing is trained."""

    seconds: ClassVar[tuple[float, float]] = (0.0, 5e-7)
    prepare_seconds: ClassVar[float] = 0.3

    model: Literal["prefiltered"] = "prefiltered"
    texels_per_yarn: int = Field(default=16, ge=1, le=128)
    """Texels of the finest level along one yarn spacing, at least; a repeat's sides are powers of two."""
    widening: Literal["none", "toksvig", "lean"] = "lean"
    """Source of the widened roughness: none, the mean tangent's length, or the half vector's variance."""

    def methods(self) -> list[Analytic[PrefilteredMaps]]:
        """Return the one method."""
        from pipeline.analytic.prefiltered import WIDENINGS, answer, tabulate

        def stored(tables: PrefilteredMaps) -> int:
            return tables.maps.texels.nbytes + self.parallax * tables.heights.maps.texels.nbytes

        widening = WIDENINGS[self.widening]
        tables = PerFabric(lambda fabric: tabulate(fabric, self.texels_per_yarn, self.parallax))
        return [Analytic(self, None, tables, lambda tables, queries, _: answer(tables, queries, widening), stored)]
