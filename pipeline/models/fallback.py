"""A method for the queries of real scenes: what it does not know is asked in the nearest form it knows, or not of it.

Footprints are ellipses and cloth is curved; many methods know round footprints and flat cloth only, and a renderer that
had nothing else would ask them so: the ellipse becomes the round footprint of equal area (or of its major axis, which
blurs and never aliases), the curvature is left out, or cut at the steepest that was taught. Nothing stands in for light
from behind, nor for yarns unlike those that a network was trained on, such as open cloth where it saw solid cloth
alone: such a query is answered by the truth's `quadrature`, at `ERROR`, and never guessed at. How many those are is
part of every result.
"""

from __future__ import annotations

from collections.abc import Collection
from typing import Final, Protocol, runtime_checkable

import numpy as np
import numpy.typing as npt

from pipeline.models.domain import Domain
from pipeline.models.method import Method
from pipeline.models.options.base import RoundFootprint
from pipeline.truth.estimator import estimate
from pipeline.truth.options import TruthOptions
from pipeline.truth.query import Queries
from weaves.fabric import Fabric

ERROR: Final = 0.1
"""Relative error stated by the quadrature that steps in: typically 2 % off, at a tenth of a millisecond a query."""

QUADRATURE: Final = TruthOptions(estimator="quadrature", relative_error=ERROR)
"""What steps in."""


@runtime_checkable
class Limited(Protocol):
    """A method that knows curved cloth, but not however steep."""

    def steepest(self, fabric: Fabric) -> float:
        """Return the largest curvature that it answers for, in 1/yarn spacings."""


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
        self._method, self._kinds, self._footprint = method, frozenset(kinds), footprint

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
            return self._method.predict(fabric, self._nearest(fabric, queries), seed)
        result = np.empty((len(strange), 4), np.float32)
        result[strange] = estimate(fabric, queries.take(strange), QUADRATURE, seed).mean
        if not strange.all():
            result[~strange] = self._method.predict(fabric, self._nearest(fabric, queries.take(~strange)), seed)
        return result

    def bytes_stored(self, fabric: Fabric) -> int:
        """Return the method's bytes; the quadrature needs none that the fabric itself does not."""
        return self._method.bytes_stored(fabric)

    def strange(self, fabric: Fabric, queries: Queries) -> npt.NDArray[np.bool_]:
        """Say which queries about a fabric are not the method's but the quadrature's, (N,)."""
        domain: Domain | None = getattr(self._method, "domain", None)
        if domain is not None and not domain.knows(fabric):
            return np.ones(len(queries.u), np.bool_)
        # Seen from behind, cloth is another cloth: no method but the truth turns it over.
        return queries.wo[:, 2] < 0.0 if "behind" in self._kinds else queries.behind

    def _nearest(self, fabric: Fabric, queries: Queries) -> Queries:
        """Return queries in the nearest form that the method knows."""
        if "stretch" not in self._kinds:
            size = queries.sigma
            if self._footprint == "geometric_mean":
                size = np.sqrt(queries.sigma * queries.sigma_minor)
            queries = queries._replace(sigma=size, sigma_minor=size, angle=np.zeros_like(size))
        if "curvature" not in self._kinds:
            return queries._replace(curvature=np.zeros_like(queries.curvature))
        if isinstance(self._method, Limited):
            steepest = np.float32(self._method.steepest(fabric))
            return queries._replace(curvature=np.minimum(queries.curvature, steepest))
        return queries
