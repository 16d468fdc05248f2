"""Energy bound: the answers of any method, limited to those of the soft nodes without shadows.

The soft nodes (analytic.soft_nodes.components) also give each component without shadows of the light: a mean of the
point model over nodes whose weights do not depend on wi. For every node the diffuse lobe (w_d <i.n_p> + (1 - w_d)
i_z) / pi integrates to at most 1 over the viewer's side, and so does any mean of them. Hence

    answer <= bound  for every wi   implies   integral of C_warp + C_weft over wi <= 1

whatever the network has learnt. With wi behind, the transmitted lobe takes the place of the diffuse one, and integrates
to at most 1 as well. The specular bounds, reflected and transmitted, integrate together to what a white layer scatters
once. So in the colours of any fabric (weaves.yarn) the four together, and what goes straight through, are at most 1.

The bound costs one evaluation of the soft nodes, about a microsecond a query.

A component above its bound gives the excess to the same component of the other yarn, as far as its bound allows. On
unseen cloth networks predict the sum of both yarns better than the share of each: their errors in warp and weft have
opposite signs, and a bound that only cuts removes one of the two.
"""

from functools import partial

import numpy as np

from pipeline.analytic.soft_nodes.components import read_behind, read_queries
from pipeline.analytic.soft_nodes.groups import USUAL
from pipeline.analytic.soft_nodes.nodes import SoftNodeTable
from pipeline.compiled.arrays import Float32, nbytes
from pipeline.models.analytic.soft_nodes import soft_tables
from pipeline.models.domain import Domain
from pipeline.models.method import Around, Method, in_chunks, refuse_other, row_by_row
from pipeline.truth.query import Queries
from weaves.fabric import Fabric

_BELOW = -1e3  # a horizon that hides nothing
_OTHER_YARN = [1, 0, 3, 2]  # of each component, the same one of the other yarn


class Bounded(Around):
    """Answers of a method for flat cloth, each component at most that of the soft nodes without shadows (`limited`)."""

    def __init__(self, method: Method) -> None:
        super().__init__(method, "bounded")
        domain: Domain | None = getattr(method, "domain", None)
        self._tables = soft_tables(USUAL, False, False, domain.rims if domain else True)

    def prepare(self, fabric: Fabric) -> None:
        """Prepare the method, and tabulate the fabric."""
        self.method.prepare(fabric)
        self._tables.of(fabric)

    def predict(self, fabric: Fabric, queries: Queries, seed: int = 0) -> Float32:
        """Answer N queries, float32 (N, 4). BadInput for queries that the method or the soft nodes do not know."""
        refuse_other(queries, f"the method {self.name} answers", ("stretch", "behind"))
        result, table = self.method.predict(fabric, queries, seed), self._tables.of(fabric)
        bounds = row_by_row(
            queries,
            queries.wi[:, 2] < 0.0,
            lambda part: _read_behind(table, part)[:, :4],
            lambda part: in_chunks(part, lambda rows: read_queries(table, rows).bounds),
        )
        return limited(result, bounds)

    def transparency(self, fabric: Fabric, looks: Queries, seed: int = 0) -> Float32:
        """Return the transparency of N footprints by the soft nodes, float32 (N,); any other could exceed the bound."""
        return _read_behind(self._tables.of(fabric), looks._replace(wi=-looks.wo))[:, 4]

    def bytes_stored(self, fabric: Fabric) -> int:
        """Return the method's bytes and those of the table."""
        return self.method.bytes_stored(fabric) + nbytes(self._tables.of(fabric))


def _read_behind(table: SoftNodeTable, queries: Queries) -> Float32:
    """Return what a table of the front answers from behind without shadows of the light, as `read_behind` does."""
    low = np.full_like(table.mean, _BELOW)
    open_back = table._replace(behind_mean=low, behind_sharpness=table.sharpness, behind_grid=np.zeros_like(table.grid))
    return in_chunks(queries, partial(read_behind, open_back), 5)


def limited(components: Float32, bounds: Float32) -> Float32:
    """Return components (N, 4), at most their bounds (N, 4), both >= 0; the other yarn's receive the excess."""
    kept = np.minimum(components, bounds)
    return np.minimum(kept + (components - kept)[:, _OTHER_YARN], bounds)
