"""Published BRDFs of cloth seen from afar, for comparison; nothing is trained.

The formulas are in pipeline.analytic.irawan and .microcylinder. Each is fitted to what soft nodes answer of the fabric
far away. It ignores where a footprint is and how large.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar, Final, Literal

import numpy as np

from pipeline.compiled.arrays import nbytes
from pipeline.models.analytic.adapter import Analytic, AnalyticOptions
from pipeline.models.analytic.soft_nodes import soft_tables
from pipeline.per_fabric import PerFabric
from pipeline.shards.queries import QueryOptions, draw_queries
from weaves.fabric import Fabric

if TYPE_CHECKING:
    from pipeline.analytic.far_field import FarField

_FITTED: Final = QueryOptions(sigma=(16.0, 16.0), max_angle=80.0)
_COUNT: Final = 512  # queries of a fit
_LEVEL: Final = 4  # of the soft nodes


class _FarField(AnalyticOptions):
    """A BRDF of cloth seen from afar, fitted to each fabric."""

    prepare_seconds: ClassVar[float] = 1.5
    kinds: ClassVar[frozenset[str]] = frozenset({"stretch"})  # it answers alike for all footprints

    parallax: Literal[True] = True
    """It is fitted to patches of view rays."""

    def methods(self) -> list[Analytic[FarField]]:
        """Return the one method."""
        read, stored = lambda far, queries, _: far.answer(queries), lambda far: nbytes((*far.threads, *far))
        return [Analytic(self, None, PerFabric(self._fitted), read, stored)]

    def _fitted(self, fabric: Fabric) -> FarField:
        from pipeline.analytic.soft_nodes.components import read_queries

        queries = draw_queries(_FITTED, fabric.weave.repeat, 0, 0, _COUNT)
        far = read_queries(soft_tables(_LEVEL).of(fabric), queries).components
        return self._threads(fabric).fitted(queries, far.astype(np.float64))

    def _threads(self, fabric: Fabric) -> FarField:
        raise NotImplementedError


class MicrocylinderOptions(_FarField):
    """The BRDF of thin cylinders [Sadeghi2013Microcylinder], fitted to each fabric; nothing is trained."""

    seconds: ClassVar[tuple[float, float]] = (0.0, 1.5e-6)
    departures: ClassVar[tuple[str, ...]] = ("fitted to soft nodes", "no Fresnel factor", "tangents of visible slopes")

    model: Literal["microcylinder"] = "microcylinder"

    def _threads(self, fabric: Fabric) -> FarField:
        from pipeline.analytic.microcylinder import microcylinder

        return microcylinder(fabric)


class IrawanOptions(_FarField):
    """The BRDF of highlights along yarns [Irawan2012Woven], fitted to each fabric; nothing is trained."""

    seconds: ClassVar[tuple[float, float]] = (0.0, 5e-7)
    departures: ClassVar[tuple[str, ...]] = (
        "fitted to soft nodes in place of measured cloth",
        "the far field alone, one highlight across a yarn",
        "spines are circles, no smoothed ends of filaments, no noise",
    )

    model: Literal["irawan"] = "irawan"

    def _threads(self, fabric: Fabric) -> FarField:
        from pipeline.analytic.irawan import irawan

        return irawan(fabric)
