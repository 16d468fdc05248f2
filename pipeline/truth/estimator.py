"""The estimators of the patch BSDF behind one interface: means, calibrated errors, points used.

`mc`, `r2`, `owen` sample the footprint (monte_carlo); `quadrature` is Gauss-Legendre on every float;
`node_table` sums over nodes with horizons; `auto` takes `node_table` where its error is small enough, and samples the
other queries (node_table.cascade).
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Final

import numpy as np

from pipeline.compiled.arrays import Index
from pipeline.truth import monte_carlo
from pipeline.truth.calibration import SAMPLED, calibrate
from pipeline.truth.cloth import ClothSide, Columns, Raw, cloth_side, columns_of
from pipeline.truth.node_table.cascade import auto_rows, node_table_rows
from pipeline.truth.options import EstimatorName, TruthOptions
from pipeline.truth.quadrature.adaptive import quadrature_rows
from pipeline.truth.query import Answers, Queries, validate
from weaves.fabric import Fabric


def _sampled(method: int, cloth: ClothSide, columns: Columns, index: Index, options: TruthOptions, seed: int) -> Raw:
    rows = monte_carlo.sample_rows(
        cloth,
        columns,
        index,
        method,
        options.relative_error,
        options.absolute_error,
        options.min_count,
        options.max_count,
        np.uint64(seed),
    )
    return Raw(*rows, np.full(len(index), SAMPLED))


Estimator = Callable[[ClothSide, Columns, Index, TruthOptions, int], Raw]

ESTIMATORS: Final[dict[EstimatorName, Estimator]] = {
    "mc": partial(_sampled, monte_carlo.INDEPENDENT),
    "r2": partial(_sampled, monte_carlo.R2),
    "owen": partial(_sampled, monte_carlo.OWEN),
    "quadrature": quadrature_rows,
    "node_table": node_table_rows,
    "auto": auto_rows,
}
"""Every estimator by its name in `TruthOptions.estimator`."""


def estimate(fabric: Fabric, queries: Queries, options: TruthOptions, seed: int, start: int = 0) -> Answers:
    """Answer queries about a fabric.

    Parameters
    ----------
    fabric : Fabric
        The cloth.
    queries : Queries
        N queries; viewer and light may be on either side of the cloth.
    options : TruthOptions
        Estimator, requested error, and the choices of the model.
    seed : int
        Name of the random numbers, 0 <= seed < 2^64.
    start : int
        Index of the first query in its stream: a query's numbers depend on `seed` and this index alone.

    Raises
    ------
    BadInput
        If a query has no answer; see `pipeline.truth.query.faults`.
    """
    validate(queries)
    raw = uncalibrated(fabric, queries, options, seed, start)
    mean, error, bound = (values.astype(np.float32) for values in (raw.mean, *calibrate(raw, queries.behind)))
    through = mean[:, 4], error[:, 4], bound[:, 4]
    return Answers(mean[:, :4], error[:, :4], bound[:, :4], raw.count.astype(np.int32), *through)


def uncalibrated(fabric: Fabric, queries: Queries, options: TruthOptions, seed: int, start: int = 0) -> Raw:
    """Return answers with the errors that the estimator itself reports; parameters as for `estimate`."""
    answers = Raw.empty(len(queries.u))
    for behind in (False, True):
        index = np.flatnonzero((queries.wo[:, 2] < 0) == behind)
        if index.size:
            cloth, columns = cloth_side(fabric, options, behind), columns_of(queries.take(index), behind)
            answers.put(index, *ESTIMATORS[options.estimator](cloth, columns, start + index, options, seed))
    return answers
