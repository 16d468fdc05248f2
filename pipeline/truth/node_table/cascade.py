"""The estimators `table`, `auto`, `elliptic`: sums over tabulated nodes, and sampling for what these cannot say well.

`auto` asks a coarse table if the footprint is wide, and then a fine one, which costs ten to forty microseconds a query
and samples its own doubtful nodes where the error it states is above the one asked for (nodes, refine). What is still
above is sampled as a whole, and so is what the table knows nothing of: tiny footprints, curved cloth, cloths of more
than `TABLE_CELLS` different cells, and models other than the default. Footprints at an angle, which the table takes as
mixtures (oblique), are `auto`'s to sample, as in all shards so far; `elliptic` asks the tables about them too.
"""

from __future__ import annotations

from threading import Lock
from typing import Final

import numpy as np

from pipeline.compiled.arrays import Index, Mask
from pipeline.truth.cloth import ClothSide, Columns, Raw
from pipeline.truth.footprint.mixture import FINE_LINE, axes
from pipeline.truth.footprint.place import GAUSSIAN
from pipeline.truth.geometry.symmetry import different_cells
from pipeline.truth.monte_carlo import OWEN, sample_rows
from pipeline.truth.node_table.answer import sum_rows
from pipeline.truth.node_table.build import WIDE, Table, tabulate
from pipeline.truth.options import TABLE_CELLS, TABLE_SIGMA, TruthOptions
from weaves.errors import BadInput

_UNBOUNDED: Final = (1.0, np.inf)  # relative and absolute error: whatever the table states will do
_STUDENT: Final = 1.2  # 16 randomisations: so much wider is Student's t at 99.7 %
"""Factor on the standard error of sampled answers, so that three of them mean what they mean for a normal one."""


def auto_rows(cloth: ClothSide, columns: Columns, index: Index, options: TruthOptions, seed: int) -> Raw:
    """Answer each query by the first that states the requested error: a coarse table, a fine one, sampling."""
    return _first_good(tabulated(cloth, columns) & _axial(cloth, columns), cloth, columns, index, options, seed)


def elliptic_rows(cloth: ClothSide, columns: Columns, index: Index, options: TruthOptions, seed: int) -> Raw:
    """Answer as `auto_rows` does, footprints at an angle by the tables too."""
    return _first_good(tabulated(cloth, columns), cloth, columns, index, options, seed)


def _first_good(
    known: Mask,
    cloth: ClothSide,
    columns: Columns,
    index: Index,
    options: TruthOptions,
    seed: int,
) -> Raw:
    rows = len(index)
    means, errors, counts = np.zeros((rows, 5)), np.zeros((rows, 5)), np.zeros(rows, np.int64)
    wide = _wide(columns)
    left = np.ones(rows, np.bool_)
    for coarse in (True, False):
        asked = np.flatnonzero(known & left & (wide | (not coarse)))
        if not asked.size:
            continue
        chosen = columns.take(asked)
        bound = _UNBOUNDED if coarse else (options.relative_error, options.absolute_error)
        mean, error, count = sum_rows(
            cloth, _table(cloth, chosen, coarse), chosen, index[asked], *bound, np.uint64(seed), FINE_LINE
        )
        size, doubt = (np.linalg.norm(values[:, :4], axis=1) for values in (mean, error))
        good = doubt <= np.maximum(options.relative_error * size, options.absolute_error)
        means[asked], errors[asked] = mean, error
        counts[asked] += count
        left[asked[good]] = False
    missing = np.flatnonzero(left)
    if missing.size:
        mean, error, count = sample_rows(
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
        means[missing], errors[missing] = mean, _STUDENT * error
        counts[missing] += count
    return means, errors, counts


def table_rows(cloth: ClothSide, columns: Columns, index: Index, options: TruthOptions, seed: int) -> Raw:
    """Answer every query by the coarse table if its footprint is wide, else by the fine one, whatever they state."""
    known, wide = tabulated(cloth, columns), _wide(columns)
    if not known.all():
        row = int(np.flatnonzero(~known)[0])
        allowed = f"flat cloth of at most {TABLE_CELLS} different cells, footprints of at least {TABLE_SIGMA:.3g} yarn "
        allowed += "spacings and not too thin, and the default frame, geometry, shadows and variation: take auto"
        raise BadInput("options", "estimator", f"table (row {index[row]})", allowed)
    rows = len(index)
    means, errors, counts = np.zeros((rows, 5)), np.zeros((rows, 5)), np.zeros(rows, np.int64)
    for coarse in (True, False):
        asked = np.flatnonzero(wide == coarse)
        if asked.size:
            chosen = columns.take(asked)
            answer = sum_rows(
                cloth, _table(cloth, chosen, coarse), chosen, index[asked], *_UNBOUNDED, np.uint64(seed), FINE_LINE
            )
            means[asked], errors[asked], counts[asked] = answer
    return means, errors, counts


def _wide(columns: Columns) -> Mask:
    """Return for which queries the coarse table is good enough to be asked."""
    return np.asarray(np.minimum(columns.sigma, columns.sigma_minor) >= WIDE)


def tabulated(cloth: ClothSide, columns: Columns) -> Mask:
    """Return which queries the table knows of, (N,)."""
    choices = cloth.choices
    other = choices.macro or choices.linear or not choices.shadows or cloth.varied
    if other or different_cells(cloth.front) > TABLE_CELLS:
        return np.zeros(len(columns.u), np.bool_)
    known = (np.minimum(columns.sigma, columns.sigma_minor) >= TABLE_SIGMA) & (columns.curvature == 0.0)
    if (oblique := ~_axial(cloth, columns)).any():
        x, y, correlation = np.abs(axes(columns.sigma, columns.sigma_minor, columns.angle))
        blurred = np.sqrt(1.0 - correlation) * np.minimum(x, y) >= TABLE_SIGMA
        known &= ~oblique | (blurred & (correlation <= FINE_LINE.most) & (cloth.shape == GAUSSIAN))
    return np.asarray(known)


def _axial(cloth: ClothSide, columns: Columns) -> Mask:
    """Return which footprints are round or lie along the axes."""
    along = columns.angle == 0.0
    if cloth.shape == GAUSSIAN:
        along |= columns.sigma == columns.sigma_minor
    return np.asarray(along)


_TABLES: dict[tuple[int, bool, bool], tuple[ClothSide, Table]] = {}
_KEPT: Final = 48  # of 1 to 5 MB each: those of a benchmark that asks about a dozen cloths in turn
_BUILDING: Final = Lock()


def _table(cloth: ClothSide, columns: Columns, coarse: bool) -> Table:
    """Return the table of one side of a cloth, one of the last few built."""
    behind = bool((columns.wi[:, 2] < 0.0).any())
    with _BUILDING:
        for with_behind in (True, False):
            kept = _TABLES.get((id(cloth.front), with_behind, coarse))
            if kept and kept[0].front is cloth.front and (with_behind or not behind):
                return kept[1]
        while len(_TABLES) >= _KEPT:
            _TABLES.pop(next(iter(_TABLES)))
        table = tabulate(cloth.front, cloth.back, behind, coarse)
        _TABLES[id(cloth.front), behind, coarse] = (cloth, table)
    return table
