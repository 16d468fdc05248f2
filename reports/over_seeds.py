"""Statistics over the trainings of a method: the mean of each number, and the range of a table's numbers.

Records of trained networks name the seed of the training. A table of a benchmark is made of the mean Records; made
once more of the Records of each training alone, it gives the range from the least to the most. So the range of a ratio
is that of the trainings' ratios.

The mean of n trainings: value, ends of the interval, points of the curve, and standard error are means. All trainings
answer the same queries. So their errors share the choice of the queries, and the standard error of the mean lies
between s / sqrt(n) and s, the mean standard error: s is stated, which is never too small.
"""

import functools
import math
from collections.abc import Callable, Hashable, Mapping, Sequence
from types import MappingProxyType
from typing import Any, Final

import numpy as np
import pandas as pd

from reports.record import Provenance, Record

LEAST: Final = "_least"
MOST: Final = "_most"  # ends of the names of the columns of a range

_NUMBERS: Final = ("value", "standard_error", "low", "high")
_SHARED: Final = [name for name in Provenance.model_fields if name not in ("model", "seed")]

Table = Callable[[Sequence[Record]], pd.DataFrame]

Statistic = Callable[[Any], float]  # function of the numbers of the trainings


def trainings(records: Sequence[Record]) -> dict[tuple[str, str], int]:
    """Return the number of trainings of each method and setting; 0 where nothing is trained."""
    seeds: dict[tuple[str, str], set[int]] = {}
    for record in records:
        known = seeds.setdefault((record.method, record.setting), set())
        if record.provenance.model:
            known.add(record.provenance.seed)
    return {key: len(known) for key, known in seeds.items()}


def mean(values: Sequence[float]) -> float:
    """Return the mean of numbers."""
    return float(np.mean(values))


def over_trainings(records: Sequence[Record], statistic: Statistic = mean) -> list[Record]:
    """Return Records with one for each number that several trainings have, in the order of the first ones.

    It is a statistic of theirs, such as `min`, which receives the numbers in the order of the seeds.
    """
    groups: dict[Hashable, list[Record]] = {}
    for index, record in enumerate(records):
        # Records of no training are never of the same number.
        groups.setdefault(record.subject(*_SHARED) if record.provenance.model else index, []).append(record)
    ordered = (sorted(group, key=lambda record: record.provenance.seed) for group in groups.values())
    return [_condensed(group, statistic) for group in ordered]


def first_training(records: Sequence[Record]) -> list[Record]:
    """Return Records with those of the first training alone of each number that several trainings have."""
    return over_trainings(records, lambda values: values[0])


def by_seed(records: Sequence[Record]) -> list[list[Record]]:
    """Return the Records of each seed, together with all those of no training; nothing if there is one seed."""
    seeds = sorted({record.provenance.seed for record in records if record.provenance.model})
    if len(seeds) < 2:
        return []
    return [
        [record for record in records if not record.provenance.model or record.provenance.seed == seed]
        for seed in seeds
    ]


def over_seeds(
    keys: Sequence[str], ranged: Sequence[str] | None, means: Mapping[str, Statistic] = MappingProxyType({})
) -> Callable[[Table], Table]:
    """Return a decorator of tables, so that they have means over trainings, their number, and ranges.

    The `keys` name a row, `method` and `setting` among them; `ranged` are the columns of numbers that get a range,
    None: all but the keys. The decorated function adds the columns `seeds`, the number of trainings (0 where nothing is
    trained), and <name>_least and <name>_most, which are NaN where less than two trainings have the row.

    Columns in `means` are no linear function of errors, such as a maximum over fabrics: their number is not that of the
    mean errors, which may lie outside the range, but this mean of the numbers of the trainings.
    """

    def decorated(table: Table) -> Table:
        @functools.wraps(table)
        def condensed(records: Sequence[Record]) -> pd.DataFrame:
            frame = table(over_trainings(records))
            if "method" not in frame:
                return frame
            counts = trainings(records)
            names = [name for name in frame.columns if name not in keys] if ranged is None else list(ranged)
            frame["seeds"] = [counts[key] for key in zip(frame["method"], frame["setting"], strict=True)]
            parts = [part for part in map(table, by_seed(records)) if len(part)]
            if not parts:
                return frame.assign(**{name + end: math.nan for name in names for end in (LEAST, MOST)})
            lines = pd.concat(parts).astype(dict.fromkeys((*names, *means), float))
            several = [counts[key] > 1 for key in zip(lines["method"], lines["setting"], strict=True)]
            every = lines[several].groupby([*keys])
            ends = every[names].min().add_suffix(LEAST).join(every[names].max().add_suffix(MOST))
            frame = frame.merge(ends[every.size() > 1], on=[*keys], how="left")
            for name, mean in means.items():
                of_trainings = every[name].agg(mean).reindex(pd.MultiIndex.from_frame(frame[[*keys]]))
                frame[name] = frame[name].where(frame["seeds"] < 2, of_trainings.to_numpy())
            return frame

        return condensed

    return decorated


def _condensed(group: Sequence[Record], statistic: Statistic) -> Record:
    """Return one Record for the same number of several trainings."""
    first = group[0]
    if len(group) == 1:
        return first

    def of(values: Sequence[float | None]) -> float | None:
        known = [value for value in values if value is not None]
        return statistic(known) if len(known) == len(group) else None

    curves = [dict(record.curve) for record in group]
    shared = [x for x, _ in first.curve if all(x in curve for curve in curves)]
    return first.model_copy(
        update={
            **{name: of([getattr(record, name) for record in group]) for name in _NUMBERS},
            "curve": tuple((x, statistic([curve[x] for curve in curves])) for x in shared),
            "samples": (),
        }
    )
