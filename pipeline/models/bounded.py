"""Energy bound: the answers of any method, limited to those of the soft nodes without shadows.

The soft nodes (pipeline.analytic.soft_nodes.features) also give each component without shadows of the light: a mean of
the point model over nodes whose weights do not depend on wi. For every node the diffuse lobe (w_d <i.n_p> + (1 - w_d)
i_z) / pi integrates to at most 1 over the viewer's side, and so does any mean of them. Hence

    answer <= bound  for every wi   implies   integral of C_warp + C_weft over wi <= 1

whatever the network has learnt. The specular bounds, scattered once, integrate to less than one half of the light that
meets the layer. The bound costs one evaluation of the soft nodes, about a microsecond a query; `selvage` evaluates them
anyway, and is bounded from the start.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from pipeline.analytic.soft_nodes.features import read_queries
from pipeline.analytic.soft_nodes.nodes import tabulate
from pipeline.models.method import CHUNK, Method
from pipeline.models.per_fabric import PerFabric
from pipeline.models.plain import refuse_other
from pipeline.models.selvage.model import Selvage
from pipeline.truth.query import Queries
from weaves.fabric import Fabric

BOUNDED, UNBOUNDED = "bounded", "unbounded"
"""Settings of the methods that `counterpart` returns."""


class Bounded:
    """A method's answers, each component at most that of the soft nodes without shadows.

    Parameters
    ----------
    method : Method
        Anything that answers for flat cloth lit from the viewer's side.
    """

    def __init__(self, method: Method) -> None:
        self._method = method
        self.name, self.setting = method.name, " ".join(filter(None, (method.setting, BOUNDED)))
        self._tables = PerFabric(tabulate)

    def covers(self, fabric: Fabric) -> bool:
        """Return whether the method covers the fabric."""
        return self._method.covers(fabric)

    def prepare(self, fabric: Fabric) -> None:
        """Prepare the method, and tabulate the fabric."""
        self._method.prepare(fabric)
        self._tables.of(fabric)

    def predict(self, fabric: Fabric, queries: Queries, seed: int = 0) -> npt.NDArray[np.float32]:
        """Answer N queries, float32 (N, 4). BadInput for queries that the method or the soft nodes do not know."""
        refuse_other(queries, self.name, stretch=True)
        result, table = self._method.predict(fabric, queries, seed), self._tables.of(fabric)
        for start in range(0, len(result), CHUNK):
            rows = slice(start, start + CHUNK)
            result[rows] = np.minimum(result[rows], read_queries(table, queries.take(rows)).bounds)
        return result

    def bytes_stored(self, fabric: Fabric) -> int:
        """Return the method's bytes and those of the table."""
        return self._method.bytes_stored(fabric) + self._tables.of(fabric).nbytes


def counterpart(method: Method) -> Method:
    """Return the method under the bound; of `selvage`, which is bounded, the same network without it."""
    if isinstance(method, Selvage) and method.bound:
        return method.with_bound(False)
    return Bounded(method)
