"""A method for the queries of real scenes: what it does not know is asked in the nearest form it knows, or not of it.

Footprints are ellipses and cloth is curved; many methods know round footprints and flat cloth only, and a renderer that
had nothing else would ask them so: the ellipse becomes the round footprint of equal area (or of its major axis, which
blurs and never aliases), the curvature is left out. Nothing stands in for light from behind, nor for yarns unlike those
that a network was trained on, such as open cloth where it saw solid cloth alone, nor for footprints and directions
beyond the ranges that it was trained on (`pipeline.models.domain`): such a query is answered by the truth's own
quadrature (`pipeline.models.fallback_table`) and never guessed at. How many those are is part of every result.
"""

from __future__ import annotations

from collections.abc import Collection

import numpy as np
import numpy.typing as npt

from pipeline.models.domain import Domain
from pipeline.models.fallback_table import stand_in
from pipeline.models.method import Method
from pipeline.models.options import RoundFootprint
from pipeline.truth.query import Queries
from weaves.fabric import Fabric


class Fallback:
    """A method that answers any query.

    Parameters
    ----------
    method : Method
        What answers wherever it can.
    kinds : collection of str
        Which of `behind`, `stretch` and `curvature` it knows.
    footprint : str
        Round footprint in place of an ellipse that it does not know: ``geometric_mean`` of the axes, or ``major``.
    """

    def __init__(self, method: Method, kinds: Collection[str], footprint: RoundFootprint = "geometric_mean") -> None:
        self.name, self.setting = method.name, method.setting
        self._method, self._footprint = method, footprint
        self._domain: Domain | None = getattr(method, "domain", None)
        # What it could know it may not have been taught: a scene's own recipe leaves out what never occurs there.
        taught = self._domain.kinds | getattr(method, "untaught", frozenset()) if self._domain else frozenset(kinds)
        self._kinds = frozenset(kinds) & taught

    def covers(self, fabric: Fabric) -> bool:
        """Tell whether the method covers the fabric."""
        return self._method.covers(fabric)

    def prepare(self, fabric: Fabric) -> None:
        """Prepare the method."""
        self._method.prepare(fabric)

    def predict(self, fabric: Fabric, queries: Queries, seed: int = 0) -> npt.NDArray[np.float32]:
        """Answer N queries of any kind, float32 (N, 4)."""
        strange = self.strange(fabric, queries)
        if not strange.any():
            return self._method.predict(fabric, self._known(fabric, queries), seed)
        result = np.empty((len(strange), 4), np.float32)
        result[strange] = stand_in(fabric, queries.take(strange), seed)
        if not strange.all():
            result[~strange] = self._method.predict(fabric, self._known(fabric, queries.take(~strange)), seed)
        return result

    def bytes_stored(self, fabric: Fabric) -> int:
        """Return the method's bytes; what stands in for it has tables that all methods share."""
        return self._method.bytes_stored(fabric)

    def strange(self, fabric: Fabric, queries: Queries) -> npt.NDArray[np.bool_]:
        """Say which queries about a fabric are not the method's but the quadrature's, (N,)."""
        # Seen from behind, cloth is another cloth: no method but the truth turns it over.
        behind = queries.wo[:, 2] < 0.0 if "behind" in self._kinds else queries.behind
        return behind if self._domain is None else behind | self._domain.strange(fabric, self._nearest(queries))

    def _known(self, fabric: Fabric, queries: Queries) -> Queries:
        """Return queries as the method is asked: in the nearest form, no larger than where it learnt the average."""
        nearest = self._nearest(queries)
        return nearest if self._domain is None else self._domain.within(fabric, nearest)

    def _nearest(self, queries: Queries) -> Queries:
        """Return queries in the nearest form that the method knows."""
        if "stretch" not in self._kinds:
            size = queries.sigma
            if self._footprint == "geometric_mean":
                size = np.sqrt(queries.sigma * queries.sigma_minor)
            queries = queries._replace(sigma=size, sigma_minor=size, angle=np.zeros_like(size))
        if "curvature" not in self._kinds:
            queries = queries._replace(curvature=np.zeros_like(queries.curvature))
        return queries
