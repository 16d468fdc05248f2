"""Gauss-Legendre nodes on every piece of yarn, k across it: the patch integral by a fixed rule.

Single precision, folded by the cloth's periodicity; see pipeline.analytic.gauss_nodes. The error comes from parts that
are not smooth: the line where a yarn turns away from the light, shadows, taken as ramps as wide as horizons spread over
a node, and highlights narrower than a node's box.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from pipeline.analytic.gauss_nodes.answer import GaussNodesTable
from pipeline.models.gauss_nodes.options import GaussNodesOptions
from pipeline.models.per_fabric import PerFabric
from pipeline.models.plain import refuse_other
from pipeline.truth.query import Queries
from weaves.fabric import Fabric


class GaussNodes:
    """The rule with a fixed number of nodes.

    Parameters
    ----------
    nodes : int
        Nodes across a yarn.
    options : GaussNodesOptions
        The design.
    """

    def __init__(self, nodes: int, options: GaussNodesOptions) -> None:
        self.name, self.setting = options.name, f"k = {nodes}"
        self._nodes, self._options = nodes, options
        self._rules = PerFabric(self._tabulate)

    def covers(self, fabric: Fabric) -> bool:
        """Return True: nothing is learnt."""
        return True

    def prepare(self, fabric: Fabric) -> None:
        """Tabulate nodes and horizons, once."""
        self._rules.of(fabric)

    def predict(self, fabric: Fabric, queries: Queries, seed: int = 0) -> npt.NDArray[np.float32]:
        """Answer N queries, float32 (N, 4); `seed` is not used. BadInput for queries that are not plain."""
        refuse_other(queries, self.name, stretch=True)
        return self._rules.of(fabric).answer(queries)

    def bytes_stored(self, fabric: Fabric) -> int:
        """Return the bytes of nodes and horizons."""
        return self._rules.of(fabric).bytes_stored()

    def _tabulate(self, fabric: Fabric) -> GaussNodesTable:
        options = self._options
        return GaussNodesTable(
            fabric,
            self._nodes,
            max(2, round(options.along * self._nodes)),
            options.shadows != "none",
            options.shadows == "soft",
            options.horizon_nodes,
            options.azimuths,
        )


def restore(options: GaussNodesOptions, trained: Sequence[tuple[dict[str, Any], Any]]) -> list[GaussNodes]:
    """Return one method for each number of nodes."""
    return [GaussNodes(nodes, options) for nodes in options.nodes]
