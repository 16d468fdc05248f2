"""The estimators of the patch BSDF behind one interface: means, calibrated errors, points used.

`mc`, `r2`, `owen` sample the footprint (monte_carlo); `quadrature` is Gauss-Legendre on every float; `node_table` sums
over nodes with horizons; `auto` takes it where its error is small enough, and samples the other queries.

`auto` evaluates wide footprints by a coarse table. All others, and those whose standard error exceeds the requested
one, go to a fine table, which costs ten to forty microseconds a query. Where its error is too large, the nodes that may
be most wrong are integrated with exact visibility (node_table.refine). Queries whose error is still too large are
sampled as a whole. So are all queries that no table can answer: tiny and very thin footprints, with parallax narrow
ones seen at low angles, curved cloth, cloths of many different cells, and options of the truth that tables do not know.
Each stage stops at the calibrated standard error, not at the error that it reports (pipeline.truth.calibration): the
requested error has one meaning for all.
"""

from collections.abc import Callable
from functools import partial
from typing import Final

import numpy as np

from pipeline.compiled.arrays import Index, Mask
from pipeline.truth.calibration import calibrate
from pipeline.truth.cloth import ClothSide, Raw, WideQueries, cloth_side, columns_of
from pipeline.truth.monte_carlo import INDEPENDENT, OWEN, R2, sample_rows
from pipeline.truth.node_table.tables import ALLOWED, COARSE, FINE, NOT_REFINED
from pipeline.truth.options import EstimatorName, TruthOptions
from pipeline.truth.quadrature.adaptive import quadrature_rows
from pipeline.truth.query import Answers, Queries, validate
from weaves.errors import BadInput
from weaves.fabric import Fabric

WIDE: Final = 0.3
"""Smallest standard deviation of a footprint, in yarn spacings, for which the coarse table is about as accurate."""

_STUDENT: Final = 1.2
"""Ratio of Student's t with 15 degrees of freedom to the normal quantile at 99.7 %: a factor on the standard errors of
samples, so that three of them cover as much as three of a normal distribution."""


def _auto_rows(cloth: ClothSide, columns: WideQueries, index: Index, options: TruthOptions, seed: int) -> Raw:
    """Answer each query by the first whose standard error is small enough: a coarse table, a fine one, sampling."""
    answers = Raw.empty(len(index))
    known = FINE.knows(cloth, columns)
    requested = options.relative_error, options.absolute_error
    left = np.ones(len(index), np.bool_)
    for table, chosen, bound in ((COARSE, _wide(cloth, columns), NOT_REFINED), (FINE, known, requested)):
        here = np.flatnonzero(chosen & left)
        if not here.size:
            continue
        found = table.answer(cloth, columns.take(here), index[here], *bound, seed)
        errors, _ = calibrate(found, columns.wi[here, 2] < 0.0)
        size, doubt = (np.linalg.norm(values[:, :4], axis=1) for values in (found.mean, errors))
        good = doubt <= np.maximum(options.relative_error * size, options.absolute_error)
        answers.put(here, *found)
        left[here[good]] = False
    missing = np.flatnonzero(left)
    if missing.size:
        limits = options.limits._replace(
            relative_error=options.relative_error / _STUDENT, absolute_error=options.absolute_error / _STUDENT
        )
        answers.put(missing, *sample_rows(cloth, columns.take(missing), index[missing], OWEN, limits, np.uint64(seed)))
    return answers


def _node_table_rows(cloth: ClothSide, columns: WideQueries, index: Index, options: TruthOptions, seed: int) -> Raw:
    """Answer every query by the coarse table if its footprint is wide, else by the fine one, whatever their error."""
    known, wide = FINE.knows(cloth, columns), _wide(cloth, columns)
    if not known.all():
        row = int(np.flatnonzero(~known)[0])
        raise BadInput("options", "estimator", f"node_table (row {index[row]})", ALLOWED)
    answers = Raw.empty(len(index))
    for table, chosen in ((COARSE, wide), (FINE, ~wide)):
        here = np.flatnonzero(chosen)
        if here.size:
            answers.put(here, *table.answer(cloth, columns.take(here), index[here], *NOT_REFINED, seed))
    return answers


def _wide(cloth: ClothSide, columns: WideQueries) -> Mask:
    """Return for which queries the coarse table is accurate enough."""
    return np.asarray(COARSE.knows(cloth, columns) & (np.minimum(columns.sigma, columns.sigma_minor) >= WIDE))


def _sampled(
    method: int, cloth: ClothSide, columns: WideQueries, index: Index, options: TruthOptions, seed: int
) -> Raw:
    return sample_rows(cloth, columns, index, method, options.limits, np.uint64(seed))


Estimator = Callable[[ClothSide, WideQueries, Index, TruthOptions, int], Raw]

ESTIMATORS: Final[dict[EstimatorName, Estimator]] = {
    "mc": partial(_sampled, INDEPENDENT),
    "r2": partial(_sampled, R2),
    "owen": partial(_sampled, OWEN),
    "quadrature": quadrature_rows,
    "node_table": _node_table_rows,
    "auto": _auto_rows,
}
"""Every estimator by its name in `TruthOptions.estimator`."""


def estimate(fabric: Fabric, queries: Queries, options: TruthOptions, seed: int, start: int = 0) -> Answers:
    """Answer queries about a fabric; viewer and light may be on either side of the cloth.

    A query's random numbers depend on `seed`, 0 <= seed < 2^64, and on its index in its stream alone; `start` is that
    of the first. BadInput if a query has no answer (`pipeline.truth.query.faults`) or, with parallax, too low a viewer.
    """
    validate(queries, parallax=options.parallax)
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
