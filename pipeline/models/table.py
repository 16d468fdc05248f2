"""The ground truth's own table as a method: a sum over nodes with exact horizons, k nodes a yarn spacing.

What the estimator `table` answers with 12 to 32 nodes and states an error of; here the number is the knob, and the
error that is stated along with every answer is not asked for (`pipeline.truth.nodes` computes it all the same).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from pipeline.models.options import TableOptions
from pipeline.models.per_fabric import PerFabric
from pipeline.models.plain import refuse_other
from pipeline.truth.cloth import Model, columns_of, model_of
from pipeline.truth.nodes import sum_rows
from pipeline.truth.oblique import COARSE_LINE
from pipeline.truth.options import TruthOptions
from pipeline.truth.query import Queries
from pipeline.truth.table import Table, tabulate
from weaves.fabric import Fabric


class Tabulated:
    """Tables of one resolution.

    Parameters
    ----------
    nodes : int
        Nodes a yarn spacing.
    azimuths : int
        Directions in which horizons are known.
    name : str
        Name of the method.
    """

    def __init__(self, nodes: int, azimuths: int, name: str) -> None:
        self.name, self.setting = name, f"k = {nodes}"
        self._nodes, self._azimuths = nodes, azimuths
        self._tables = PerFabric(self._tabulate)

    def covers(self, fabric: Fabric) -> bool:
        """Say yes: nothing is learnt."""
        return True

    def prepare(self, fabric: Fabric) -> None:
        """Tabulate the fabric, once."""
        self._tables.of(fabric)

    def predict(self, fabric: Fabric, queries: Queries, seed: int = 0) -> npt.NDArray[np.float32]:
        """Answer N queries, float32 (N, 4); `seed` is not used. BadInput for queries that are not plain."""
        refuse_other(queries, self.name, stretch=True)
        model, table = self._tables.of(fabric)
        rows = np.arange(len(queries.u))
        # An error without bound: nothing is sampled again.
        means, _, _ = sum_rows(model, table, columns_of(queries), rows, 1.0, np.inf, np.uint64(seed), COARSE_LINE)
        return np.maximum(means[:, :4], 0.0).astype(np.float32)

    def bytes_stored(self, fabric: Fabric) -> int:
        """Return the bytes of the table."""
        return sum(array.nbytes for array in self._tables.of(fabric)[1] if isinstance(array, np.ndarray))

    def _tabulate(self, fabric: Fabric) -> tuple[Model, Table]:
        model = model_of(fabric, TruthOptions())
        return model, tabulate(model.front, model.back, False, nodes=self._nodes, azimuths=self._azimuths)


def restore(options: TableOptions, trained: Sequence[tuple[dict[str, Any], Any]]) -> list[Tabulated]:
    """Return one method for each number of nodes."""
    return [Tabulated(nodes, options.azimuths, options.name) for nodes in options.nodes]
