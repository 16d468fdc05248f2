"""`selvage` within a wished error: the cheapest of three answers whose estimated error is small enough, query by query.

    1  soft nodes corrected by the network        estimated by the network
    2  the finest soft nodes                      estimated by the network
    3  the fallback, sums over a node table       not estimated: the answer of what is left

Errors are root mean squares over many queries, relative to a grey cloth's colour (`error_network`): single errors may
be larger. Light from behind has no estimate; the finest soft nodes answer it, and all that the network is not trained
for.
"""

from __future__ import annotations

from typing import ClassVar, Protocol

import numpy as np
import numpy.typing as npt

from pipeline.models.analytic.soft_nodes import Level, SoftNodes
from pipeline.models.domain import Domain
from pipeline.models.fallback import fallback_answers
from pipeline.models.method import Method
from pipeline.models.selvage import SelvageOptions
from pipeline.models.selvage.error_network import FINEST, OWN
from pipeline.truth.query import Queries
from weaves.errors import BadInput
from weaves.fabric import Fabric

_ANY = Queries.round(u=[0.5], v=[0.5], sigma=[1.0], wi=[[0.6, 0.0, 0.8]], wo=[[0.0, 0.0, 1.0]])

Floats = npt.NDArray[np.float32]


class Estimating(Method, Protocol):
    """The part of `Selvage` that is used here."""

    @property
    def domain(self) -> Domain | None:
        """Range of its training."""

    def with_errors(self, fabric: Fabric, queries: Queries) -> tuple[Floats, Floats]:
        """Return components (N, 4), and estimated errors of these and of the finest soft nodes (N, 2)."""


class Adaptive:
    """A trained `selvage` that answers by more nodes where its error would exceed the wished one.

    Parameters
    ----------
    selvage : Estimating
        Answers first, and estimates errors.
    finest : int
        Level of detail of the soft nodes that answer second.
    error : float
        Wished relative error, above 0 and below 1; BadInput if it is another number.
    """

    without_training: ClassVar[frozenset[str]] = SelvageOptions.without_training
    """Kinds of queries that need no training: the soft nodes know them."""
    turns: ClassVar[bool] = SelvageOptions.turns

    def __init__(self, selvage: Estimating, finest: Level, error: float) -> None:
        if not 0.0 < error < 1.0:
            raise BadInput(selvage.name, "error", error, "a relative error above 0 and below 1 is needed, such as .02")
        self.name, self.setting, self.domain = selvage.name, f"error {100 * error:g} %", selvage.domain
        self.error = error
        self._selvage, self._finest = selvage, SoftNodes(finest, selvage.name)

    def covers(self, fabric: Fabric) -> bool:
        """Return True: any fabric can be tabulated."""
        return True

    def prepare(self, fabric: Fabric) -> None:
        """Tabulate the fabric for both levels of soft nodes and for the fallback, once."""
        self._selvage.prepare(fabric)
        self._finest.prepare(fabric)
        fallback_answers(fabric, _ANY, 0)

    def predict(self, fabric: Fabric, queries: Queries, seed: int = 0) -> Floats:
        """Answer N queries, float32 (N, 4). BadInput for kinds of queries that the soft nodes do not know."""
        behind = queries.wi[:, 2] < 0.0
        if not behind.any():
            return self._answers(fabric, queries, seed)
        result = np.empty((len(behind), 4), np.float32)
        result[behind] = self._finest.predict(fabric, queries.take(behind))
        result[~behind] = self._answers(fabric, queries.take(~behind), seed)
        return result

    def outside_domain(self, fabric: Fabric, queries: Queries) -> Floats:
        """Answer N queries that the network is not trained for, float32 (N, 4), by the finest soft nodes."""
        return self._finest.predict(fabric, queries)

    def transparency(self, fabric: Fabric, looks: Queries, seed: int = 0) -> Floats:
        """Return the transparency of N footprints, float32 (N,), by the finest soft nodes."""
        return self._finest.transparency(fabric, looks)

    def bytes_stored(self, fabric: Fabric) -> int:
        """Return the bytes of both tables and of the network; the tables of the fallback are shared by all methods."""
        return self._selvage.bytes_stored(fabric) + self._finest.bytes_stored(fabric)

    def _answers(self, fabric: Fabric, queries: Queries, seed: int) -> Floats:
        """Answer queries with the light in front."""
        result, errors = self._selvage.with_errors(fabric, queries)
        too_far = errors[:, OWN] > self.error
        finer = too_far & (errors[:, FINEST] <= self.error)
        left = too_far & ~finer
        if finer.any():
            result[finer] = self._finest.predict(fabric, queries.take(finer))
        if left.any():
            result[left] = fallback_answers(fabric, queries.take(left), seed)
        return result
