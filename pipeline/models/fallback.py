"""A method for all queries of real scenes, those outside its domain included.

A query is first brought into the nearest form that the method knows: an ellipse becomes the round footprint of equal
area (or of its major axis, which blurs and never aliases), and curvature is left out. The fallback answers what has no
such form: light from behind, and all that is out of the method's domain (`pipeline.models.domain`). A method that
`turns` answers a viewer behind the cloth as one in front of the cloth's back.

The fallback is a node table of the ground truth with other nodes (`_NODES` is odd, the truth's numbers are even) and
other azimuths: its error has nothing in common with that of the truth, and is measured like any method's error. It has
view rays and rims, as the truth has by default. Queries that the table does not know, such as cloth that
turns across a footprint, narrow footprints at low views and irregular drafts, are sampled, by the estimator `owen`.
Viewers too low for the truth are tilted up to the lowest one.
"""

from collections.abc import Callable, Collection
from typing import Final

import numpy as np

from pipeline.analytic.coverage import quick_coverage
from pipeline.compiled.arrays import Float32, Mask
from pipeline.models.domain import Domain
from pipeline.models.method import Around, Method, row_by_row
from pipeline.models.options import RoundFootprint
from pipeline.scenes.shade import colours_of
from pipeline.truth.cloth import cloth_side, columns_of
from pipeline.truth.estimator import estimate
from pipeline.truth.footprint.mixture import COARSE_LINE
from pipeline.truth.node_table.tables import NOT_REFINED, NodeTable
from pipeline.truth.options import TruthOptions
from pipeline.truth.query import Queries
from weaves.fabric import Fabric

# Nodes a yarn spacing: 1 % off in the shipped scenes (RMSE over the mean), at 15 to 35 microseconds a query.
_NODES: Final = 15
_AZIMUTHS: Final = 96  # in which horizons are known
_TABLE: Final = NodeTable(lambda cells: _NODES, _AZIMUTHS, COARSE_LINE)
# For queries that the table cannot answer: 1.5 to 3 % off, at .2 to .3 ms a query.
_SAMPLING: Final = TruthOptions(estimator="owen", relative_error=0.1)

FLAT_TURN: Final = 0.1
"""Radians that cloth may turn across a footprint's deviation and count as flat. In the shipped scenes that changes
answers by at most .5 % with the light behind and 3 % with it in front (RMSE over the mean); at grazing views by up to
8 %."""


def fallback_answers(fabric: Fabric, queries: Queries, seed: int) -> Float32:
    """Answer N queries of any kind, float32 (N, 4); `seed` fixes the random points."""
    return fallback_rows(fabric, queries, seed)[:, :4]


def fallback_rows(fabric: Fabric, queries: Queries, seed: int) -> Float32:
    """Return the components and the transparency of N queries of any kind, float32 (N, 5)."""
    turned = queries.curvature * np.sqrt(queries.sigma * queries.sigma_minor)
    flat = queries.raised()._replace(curvature=np.where(turned <= FLAT_TURN, np.float32(0.0), queries.curvature))
    result, left = np.empty((len(queries.u), 5), np.float32), np.ones(len(queries.u), np.bool_)
    for behind in (False, True):
        rows = np.flatnonzero((queries.wo[:, 2] < 0.0) == behind)
        if not rows.size:
            continue
        cloth, columns = cloth_side(fabric, _SAMPLING, behind), columns_of(flat.take(rows), behind)
        known = _TABLE.knows(cloth, columns)
        if known.any():
            rows = rows[known]
            answers = _TABLE.answer(cloth, columns.take(known), rows, *NOT_REFINED, seed)
            result[rows], left[rows] = np.maximum(answers.mean, 0.0), False
    if left.any():
        estimated = estimate(fabric, flat.take(left), _SAMPLING, seed)
        result[left] = np.concatenate([estimated.mean, estimated.transparency[:, None]], axis=1)
    return result


class Fallback(Around):
    """A method that answers any query.

    `kinds` are those that `method` knows, of `behind`, `stretch` and `curvature`. In place of an ellipse that it does
    not know, it sees a round `footprint`: ``geometric_mean`` of the axes, or ``major``.
    """

    def __init__(self, method: Method, kinds: Collection[str], footprint: RoundFootprint = "geometric_mean") -> None:
        super().__init__(method)
        self._footprint = footprint
        self._domain: Domain | None = getattr(method, "domain", None)
        # A method may know a kind and not be trained on it: a scene's own recipe leaves out what never occurs there.
        self._kinds = frozenset(kinds)
        self._turns = bool(getattr(method, "turns", False))
        if self._domain:
            self._kinds &= self._domain.kinds

    def predict(self, fabric: Fabric, queries: Queries, seed: int = 0) -> Float32:
        """Answer N queries of any kind, float32 (N, 4)."""
        return np.ascontiguousarray(self.rows(fabric, queries, seed)[:, :4])

    def rows(self, fabric: Fabric, queries: Queries, seed: int = 0) -> Float32:
        """Return components and transparency, (N, 5); the transparency is NaN where the method answers itself."""

        def own(side: Fabric, part: Queries) -> Float32:
            # Footprints that see the average are no larger than trained on.
            part = self._domain.within(side, part) if self._domain else part
            return np.pad(self.method.predict(side, part, seed), ((0, 0), (0, 1)), constant_values=np.nan)

        return row_by_row(
            queries,
            self.out_of_domain(fabric, queries),
            lambda part: fallback_rows(fabric, part, seed),
            lambda part: self._in_front(fabric, part, own),
        )

    def transparency(self, fabric: Fabric, looks: Queries, seed: int = 0) -> Float32:
        """Return the transparency of N footprints, (N,), by the method or the fallback; no light changes it."""
        own = getattr(self.method, "transparency", None)
        if own is None:
            return fallback_rows(fabric, looks, seed)[:, 4]
        return self._in_front(fabric, looks, lambda side, part: own(side, part, seed))

    def coverage(self, fabric: Fabric, looks: Queries, seed: int = 0) -> Float32:
        """Return the share of view rays that do not leave curved cloth again, (N,); wo.z may have any sign.

        By the method's own `coverage` if it has one, up to the curvature that it was trained on, or by a few rays.
        """
        own: Callable[[Fabric, Queries], Float32] | None = getattr(self.method, "coverage", None)
        if own is None:
            return quick_coverage(fabric, looks)
        known = (looks.curvature > 0.0) & (looks.wo[:, 2] > 0.0)
        if self._domain is not None:
            known &= looks.curvature <= self._domain.queries.curvature[1]
        return row_by_row(
            looks, known, lambda part: own(fabric, self._nearest(part)), lambda part: quick_coverage(fabric, part)
        )

    def colours(self, fabric: Fabric, queries: Queries, seed: int = 0) -> Float32:
        """Return the colours of the components of N queries, (N, 4, 3): the method's own, or those of footprints."""
        if own := getattr(self.method, "own_colours", None):
            return np.asarray(own(fabric, queries), np.float32)
        return colours_of(fabric, queries).astype(np.float32)

    def out_of_domain(self, fabric: Fabric, queries: Queries) -> Mask:
        """Return which queries about a fabric are left to the fallback, (N,)."""
        # Seen from behind, cloth is another cloth.
        if self._turns:
            behind = np.zeros(len(queries.u), np.bool_)
        else:
            behind = queries.wo[:, 2] < 0.0 if "behind" in self._kinds else queries.behind
        if self._domain is None:
            return behind
        return behind | self._domain.out_of_domain(fabric, self._nearest(queries))

    def _in_front(self, fabric: Fabric, queries: Queries, answer: Callable[[Fabric, Queries], Float32]) -> Float32:
        """Answer queries in the nearest form, those of viewers behind the cloth about its back."""
        return row_by_row(
            queries,
            queries.wo[:, 2] < 0.0,
            lambda part: answer(fabric.back(), self._nearest(part.turned())),
            lambda part: answer(fabric, self._nearest(part)),
        )

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
