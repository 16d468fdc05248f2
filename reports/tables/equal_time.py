"""At equal time: the error of each method beside that of its rivals in the same time, by the size of the footprint.

A rival is a method with a parameter: its settings are a curve of error against time, taken at the very time of the
method by straight lines in both logarithms between settings, of which only those count that no faster one beats. Before
its fastest setting a rival has no answer; beyond its slowest it keeps that setting's error. Every setting of
`OWN_CURVE` is compared with its rivals too: what it promises is a lower error at every time.
"""

import itertools
import math
from collections.abc import Sequence
from typing import Final

import numpy as np
import pandas as pd

from reports.measure.by_size import EDGES, MEASURES, SIZES, WHOLE
from reports.over_seeds import over_trainings
from reports.record import Record
from reports.tables.summary import rows

OWN_CURVE: Final = "soft_nodes"  # the method with a parameter whose own settings are compared


def size_table(records: Sequence[Record]) -> pd.DataFrame:
    """Return times and errors by size, one row a method, setting and size: ns, colour, specular, diffuse.

    Errors of several trainings are their mean.
    """
    numbers_of: dict[tuple[str, str, str], dict[str, float]] = {}
    names: dict[str, str] = {"size_time": "ns"} | {metric: measure for measure, (metric, _) in MEASURES.items()}
    for record in over_trainings(records):
        if record.metric in names:
            values = {SIZES[EDGES.index(low)]: value for low, value in record.curve} | {WHOLE: record.value}
            for size, value in values.items():
                numbers_of.setdefault((record.method, record.setting, size), {})[names[record.metric]] = value
    lines = [(*key, *(numbers.get(name, math.nan) for name in names.values())) for key, numbers in numbers_of.items()]
    return pd.DataFrame(lines, columns=["method", "setting", "size", *names.values()])


def equal_time_table(sizes: pd.DataFrame) -> pd.DataFrame:
    """Return every method without settings, and each of `OWN_CURVE`, beside every method with them, at its time.

    `sizes` is from `size_table`. Columns: measure, method, setting, size; ns and error of the method; rival,
    rival_error (NaN where the rival has no setting as fast), ratio = rival_error / error.
    """
    curves: dict[tuple[str, str], pd.DataFrame] = {}
    single: list[pd.DataFrame] = []
    for (method, size), part in sizes.groupby(["method", "size"], sort=False):
        if len(part) > 1:
            curves[str(method), str(size)] = part
        if len(part) == 1 or method == OWN_CURVE:
            single.append(part)
    lines = []
    for measure, row in itertools.product(MEASURES, rows(pd.concat(single)) if single else ()):
        own = getattr(row, measure)
        for (rival, size), part in curves.items():
            if size == row.size and rival != row.method:
                other = error_at(list(part[["ns", measure]].itertuples(index=False, name=None)), row.ns)
                ratio = other / own if own > 0 else math.nan
                lines.append((measure, row.method, row.setting, size, row.ns, own, rival, other, ratio))
    columns = ["measure", "method", "setting", "size", "ns", "error", "rival", "rival_error", "ratio"]
    return pd.DataFrame(lines, columns=columns)


def error_at(curve: Sequence[tuple[float, float]], ns: float) -> float:
    """Return the error of a method's curve of (time, error) at a time; NaN before its fastest setting.

    Straight in both logarithms between settings that no faster one beats; beyond the slowest its error. From the first
    setting on whose error is lost in the truth's noise (not above 0) it is 0.
    """
    best: list[tuple[float, float]] = []
    for time, error in sorted(curve):
        if error <= 0:
            if ns >= time:
                return 0.0
            break
        if not best or error < best[-1][1]:
            best.append((time, error))
    if not best or ns < best[0][0]:
        return math.nan
    times, errors = np.log(np.array(best)).T
    return float(np.exp(np.interp(math.log(ns), times, errors)))
