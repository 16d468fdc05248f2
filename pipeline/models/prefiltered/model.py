"""Prefiltered normals: MIP maps of normal and tangent, one point model a query and family, no shadows.

The formulas are in pipeline.analytic.prefiltered. The method ignores that points hide one another, and that the mean of
a product is not the product of the means.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from pipeline.analytic.prefiltered import WIDENINGS, PrefilteredMaps
from pipeline.models.per_fabric import PerFabric
from pipeline.models.plain import refuse_other
from pipeline.models.prefiltered.options import PrefilteredOptions
from pipeline.truth.query import Queries
from weaves.fabric import Fabric


class Prefiltered:
    """Averaged maps.

    Parameters
    ----------
    options : PrefilteredOptions
        The design.
    """

    def __init__(self, options: PrefilteredOptions) -> None:
        self.name, self.setting = options.name, ""
        self._widening = WIDENINGS[options.widening]
        self._maps = PerFabric(lambda fabric: PrefilteredMaps(fabric, options.texels_per_yarn))

    def covers(self, fabric: Fabric) -> bool:
        """Return True: nothing is learnt."""
        return True

    def prepare(self, fabric: Fabric) -> None:
        """Average the fabric's maps, once."""
        self._maps.of(fabric)

    def predict(self, fabric: Fabric, queries: Queries, seed: int = 0) -> npt.NDArray[np.float32]:
        """Answer N queries, float32 (N, 4); `seed` is not used. BadInput for queries that are not plain."""
        refuse_other(queries, self.name)
        return self._maps.of(fabric).answer(queries, self._widening)

    def bytes_stored(self, fabric: Fabric) -> int:
        """Return the bytes of all levels."""
        return self._maps.of(fabric).bytes_stored()


def restore(options: PrefilteredOptions, trained: Sequence[tuple[dict[str, Any], Any]]) -> list[Prefiltered]:
    """Return the one method."""
    return [Prefiltered(options)]
