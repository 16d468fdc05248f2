"""Cloth of thin cylinders seen from afar [Sadeghi2013Microcylinder]; nothing is trained.

The formulas are in pipeline.analytic.microcylinder. Of each fabric it is fitted to what soft nodes answer far away. It
ignores where a footprint is and how large.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar, Final, Literal

import numpy as np

from pipeline.models.analytic.adapter import Analytic, AnalyticOptions
from pipeline.models.analytic.soft_nodes import soft_tables
from pipeline.per_fabric import PerFabric
from pipeline.shards.queries import QueryOptions, draw_queries
from weaves.fabric import Fabric

if TYPE_CHECKING:
    from pipeline.analytic.microcylinder import Cylinders

_FITTED: Final = QueryOptions(sigma=(16.0, 16.0), max_angle=80.0)
_COUNT: Final = 512  # queries of a fit
_LEVEL: Final = 4  # of the soft nodes


class MicrocylinderOptions(AnalyticOptions):
    """A far-field BRDF of cylinders, fitted to each fabric; nothing is trained."""

    seconds: ClassVar[tuple[float, float]] = (0.0, 1.5e-6)
    prepare_seconds: ClassVar[float] = 1.5
    kinds: ClassVar[frozenset[str]] = frozenset({"stretch"})  # it answers alike for all footprints
    departures: ClassVar[tuple[str, ...]] = ("fitted to soft nodes in place of measured threads", "no Fresnel factor")

    model: Literal["microcylinder"] = "microcylinder"
    parallax: Literal[True] = True
    """It is fitted to patches of view rays."""

    def methods(self) -> list[Analytic[Cylinders]]:
        """Return the one method."""
        from pipeline.analytic.microcylinder import answer

        tables = PerFabric(_fitted)
        return [Analytic(self, None, tables, lambda cylinders, queries, _: answer(cylinders, queries))]


def _fitted(fabric: Fabric) -> Cylinders:
    from pipeline.analytic.microcylinder import cylinders_of, fit
    from pipeline.analytic.soft_nodes.components import read_queries

    queries = draw_queries(_FITTED, fabric.weave.repeat, 0, 0, _COUNT)
    far = read_queries(soft_tables(_LEVEL).of(fabric), queries).components
    return fit(cylinders_of(fabric), queries, far.astype(np.float64))
