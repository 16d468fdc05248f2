"""What answers in a method's place: the truth's quadrature, from a table of its own.

A sum over nodes with exact horizons, as the truth's table is, but with other nodes (`NODES` is odd, the truth's numbers
are even) and other azimuths: what it errs has nothing to do with what the truth errs, and is measured like any method's
error. Where the table does not reach, on cloth that turns across a footprint, on thin footprints and on irregular
drafts, the truth's `quadrature` answers.
"""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

from pipeline.models.per_fabric import PerFabric
from pipeline.truth.cloth import ClothSide, cloth_side, columns_of
from pipeline.truth.estimator import estimate
from pipeline.truth.footprint.mixture import COARSE_LINE
from pipeline.truth.node_table.answer import sum_rows
from pipeline.truth.node_table.build import Table, tabulate
from pipeline.truth.node_table.cascade import tabulated
from pipeline.truth.options import TruthOptions
from pipeline.truth.query import Queries
from weaves.fabric import Fabric

NODES: Final = 15
"""Nodes a yarn spacing: 1 to 3 % off in the shipped scenes (RMSE over the mean), at some 30 microseconds a query."""

AZIMUTHS: Final = 96
"""Directions in which horizons are known."""

QUADRATURE: Final = TruthOptions(estimator="quadrature", relative_error=0.1)
"""What steps in where the table does not reach: typically 2 % off, at a tenth of a millisecond a query."""

FLAT: Final = 0.1
"""Radians that cloth may turn across a footprint's deviation and still be flat to the table. In the shipped scenes that
moves answers by .1 to .3 % with the light behind and by 1 % with it in front; at grazing angles by up to 7 %."""


def stand_in(fabric: Fabric, queries: Queries, seed: int) -> npt.NDArray[np.float32]:
    """Answer N queries of any kind, float32 (N, 4); `seed` names the points of what is sampled."""
    turned = queries.curvature * np.sqrt(queries.sigma * queries.sigma_minor)
    flat = queries._replace(curvature=np.where(turned <= FLAT, np.float32(0.0), queries.curvature))
    result, left = np.empty((len(queries.u), 4), np.float32), np.ones(len(queries.u), np.bool_)
    for behind in (False, True):
        rows = np.flatnonzero((queries.wo[:, 2] < 0.0) == behind)
        if not rows.size:
            continue
        columns = columns_of(flat.take(rows), behind)
        known = tabulated(cloth_side(fabric, QUADRATURE, behind), columns)
        if known.any():
            model, table = _TABLES[behind].of(fabric)
            rows, columns = rows[known], columns.take(known)
            # An error without bound: nothing is sampled again.
            means, _, _ = sum_rows(model, table, columns, rows, 1.0, np.inf, np.uint64(seed), COARSE_LINE)
            result[rows], left[rows] = np.maximum(means[:, :4], 0.0), False
    if left.any():
        result[left] = estimate(fabric, flat.take(left), QUADRATURE, seed).mean
    return result


def _tabulate(fabric: Fabric, behind: bool) -> tuple[ClothSide, Table]:
    model = cloth_side(fabric, QUADRATURE, behind)
    return model, tabulate(model.front, model.back, True, nodes=NODES, azimuths=AZIMUTHS)


_TABLES: Final = {
    False: PerFabric(lambda fabric: _tabulate(fabric, False)),
    True: PerFabric(lambda fabric: _tabulate(fabric, True)),
}
