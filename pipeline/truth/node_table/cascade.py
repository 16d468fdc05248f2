"""The estimators `node_table` and `auto`: sums over tabulated nodes, and sampling of all other queries.

`auto` evaluates wide footprints by a coarse table. All others, and those whose standard error exceeds the requested
one, go to a fine table, which costs ten to forty microseconds a query. Where its error is too large, the nodes that may
be most wrong are integrated with exact visibility (refine). Queries whose error is still too large are sampled as a
whole. So are all queries that no table can answer: tiny and very thin footprints, curved cloth, cloths of many
different cells, and options of the truth other than the default.

Each stage stops at the calibrated standard error, not at the error that it reports (pipeline.truth.calibration): the
requested error has one meaning for all stages.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from pipeline.compiled.arrays import Index, Mask
from pipeline.truth.calibration import SAMPLED, calibrate
from pipeline.truth.cloth import ClothSide, Columns, Raw
from pipeline.truth.monte_carlo import OWEN, sample_rows
from pipeline.truth.node_table.tables import ALLOWED, COARSE, FINE, UNBOUNDED
from pipeline.truth.options import TruthOptions
from weaves.errors import BadInput

WIDE: Final = 0.3
"""Smallest standard deviation of a footprint, in yarn spacings, for which the coarse table is about as accurate."""

_STUDENT: Final = 1.2
"""Ratio of Student's t with 15 degrees of freedom to the normal quantile at 99.7 %: a factor on the standard errors of
samples, so that three of them cover as much as three of a normal distribution."""


def auto_rows(cloth: ClothSide, columns: Columns, index: Index, options: TruthOptions, seed: int) -> Raw:
    """Answer each query by the first whose standard error is small enough: a coarse table, a fine one, sampling."""
    answers = Raw.empty(len(index))
    known, wide = FINE.knows(cloth, columns), _wide(columns)
    requested = options.relative_error, options.absolute_error
    left = np.ones(len(index), np.bool_)
    for table, chosen, bound in ((COARSE, known & wide, UNBOUNDED), (FINE, known, requested)):
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
        sampled = sample_rows(
            cloth,
            columns.take(missing),
            index[missing],
            OWEN,
            options.relative_error / _STUDENT,
            options.absolute_error / _STUDENT,
            options.min_count,
            options.max_count,
            np.uint64(seed),
        )
        answers.put(missing, *sampled, SAMPLED)
    return answers


def node_table_rows(cloth: ClothSide, columns: Columns, index: Index, options: TruthOptions, seed: int) -> Raw:
    """Answer every query by the coarse table if its footprint is wide, else by the fine one, whatever their error.

    Raises
    ------
    BadInput
        If the table does not know a query.
    """
    known, wide = FINE.knows(cloth, columns), _wide(columns)
    if not known.all():
        row = int(np.flatnonzero(~known)[0])
        raise BadInput("options", "estimator", f"node_table (row {index[row]})", ALLOWED)
    answers = Raw.empty(len(index))
    for table, chosen in ((COARSE, wide), (FINE, ~wide)):
        here = np.flatnonzero(chosen)
        if here.size:
            answers.put(here, *table.answer(cloth, columns.take(here), index[here], *UNBOUNDED, seed))
    return answers


def _wide(columns: Columns) -> Mask:
    """Return for which queries the coarse table is accurate enough."""
    return np.asarray(np.minimum(columns.sigma, columns.sigma_minor) >= WIDE)
