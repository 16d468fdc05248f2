"""At equal time: the error of each method beside that of its rivals in the same time, by the size of the footprint.

One number over all footprints hides what a method is good for: points resolve small footprints, averages large ones,
and the cost of a query depends on its size as well. So errors and times are measured apart in classes of size, methods
in turns. A rival is a method with a knob: its settings are a curve of error against time, taken at the very time of the
method by straight lines in both logarithms between settings, of which only those count that no faster one beats. Before
its fastest setting a rival has no answer; beyond its slowest it keeps that setting's error.

The error is the relative RMSE of the colour, .3 (S_warp + S_weft) + .5 (C_warp + C_weft), of its specular or its
diffuse part: root of the MSE, noise of the truth subtracted, over the mean of the truth; the mean over fabrics.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np
import numpy.typing as npt
import pandas as pd

from pipeline.fingerprint import fingerprint
from pipeline.shards.manifest import Manifest
from pipeline.truth.options import TruthOptions
from pipeline.truth.query import Answers, Queries
from reports.metrics import COLOUR_WEIGHTS, colour_error
from reports.options import BenchOptions
from reports.record import Metric, Provenance, Record
from reports.summary import rows
from reports.timing import Contender, affordable, time_side_by_side
from reports.truth_noise import with_noise
from weaves.fabric import Fabric

if TYPE_CHECKING:
    from pipeline.models.method import Method

EDGES: Final = (0.0, 0.1, 0.3, 1.0, 3.0, math.inf)
"""Standard deviations between which footprints are of one class, in yarn spacings."""

WHOLE: Final = "all"
"""Name of all classes together, as the data set mixes them."""

SIZES: Final = ("below .1", ".1 to .3", ".3 to 1", "1 to 3", "above 3")
"""Names of the classes."""

MEASURES: Final[dict[str, tuple[Metric, npt.NDArray[np.float64]]]] = {
    "colour": ("size_colour", COLOUR_WEIGHTS),
    "specular": ("size_specular", np.array([[1.0], [1.0], [0.0], [0.0]])),
    "diffuse": ("size_diffuse", np.array([[0.0], [0.0], [1.0], [1.0]])),
}
"""What errors are taken of: the Record's metric and the colour of each component."""

LONGEST: Final = 0.02
"""Seconds that a timed call of one class, over its fabrics, should not exceed by much."""

FEWEST: Final = 512
"""Least queries a fabric in such a call: what a call itself costs must not stand for what a query costs."""

COLUMNS: Final = ("measure", "method", "setting", "size", "ns", "error", "rival", "rival_error", "ratio")

_Asked = list[tuple[Fabric, Queries, Answers]]


def measure_by_size(
    methods: Sequence[Method],
    manifest: Manifest,
    folder: Path,
    options: BenchOptions,
    provenance: Provenance | None = None,
) -> list[Record]:
    """Measure errors and times of methods on held-out queries, one class of footprints after the other.

    Errors are of all queries of a class. Timed are calls on one thread about every fabric that the method covers, of as
    many queries as `LONGEST` allows. The time over all classes weighs them as they occur. A Record's curve holds (lower
    edge of the class, value); its value is that over all classes.
    """
    classes, shares = _classes(manifest, folder)
    methods = [one for one in methods if any(one.covers(cloth) for asked in classes.values() for cloth, _, _ in asked)]
    times: dict[int, list[tuple[float, float]]] = {index: [] for index in range(len(methods))}
    errors: dict[tuple[int, str], list[tuple[float, float]]] = {}
    for low, asked in classes.items():
        contenders = []
        for index, method in enumerate(methods):
            own = [one for one in asked if method.covers(one[0])]
            for cloth, _, _ in own:
                method.prepare(cloth)
            asked_of = [(cloth, queries) for cloth, queries, _ in own]
            contenders.append(affordable(Contender(method.predict, asked_of), LONGEST, FEWEST))
            for name, error in _errors(method, own, options.seed):
                errors.setdefault((index, name), []).append((low, error))
        timings = time_side_by_side(contenders, options.timing_repeats, options.warm_up)
        for index, timing in enumerate(timings):
            times[index].append((low, timing.quartiles[1]))
    records = []
    for index, method in enumerate(methods):
        subject = Record(method=method.name, setting=method.setting, provenance=provenance or Provenance())
        count = sum(len(queries.u) for asked in classes.values() for cloth, queries, _ in asked if method.covers(cloth))
        mean = sum(shares[low] * ns for low, ns in times[index])
        records.append(subject.of("size_time", mean, count, unit="ns/query", curve=tuple(times[index])))
        for name, (metric, _) in MEASURES.items():
            curve = errors[index, name]
            # Squared errors add up: over all classes they weigh as their queries occur.
            whole = math.sqrt(sum(shares[low] * error**2 for low, error in curve))
            records.append(subject.of(metric, whole, count, curve=tuple(curve)))
    return records


def size_table(records: Sequence[Record]) -> pd.DataFrame:
    """Return times and errors by size, one row a method, setting and size: ns, colour, specular, diffuse."""
    found: dict[tuple[str, str, str], dict[str, float]] = {}
    names: dict[str, str] = {"size_time": "ns"} | {metric: measure for measure, (metric, _) in MEASURES.items()}
    for record in records:
        if record.metric in names:
            values = {SIZES[EDGES.index(low)]: value for low, value in record.curve} | {WHOLE: record.value}
            for size, value in values.items():
                found.setdefault((record.method, record.setting, size), {})[names[record.metric]] = value
    lines = [(*key, *(numbers.get(name, math.nan) for name in names.values())) for key, numbers in found.items()]
    return pd.DataFrame(lines, columns=["method", "setting", "size", *names.values()])


def equal_time_table(sizes: pd.DataFrame) -> pd.DataFrame:
    """Return every method without a knob beside every method with one, at the time of the former.

    Parameters
    ----------
    sizes : DataFrame
        From `size_table`.

    Returns
    -------
    DataFrame
        Columns: measure, method, setting, size; ns and error of the method; rival, rival_error (NaN where the rival has
        no setting as fast), ratio = rival_error / error.
    """
    curves: dict[tuple[str, str], pd.DataFrame] = {}
    single: list[pd.DataFrame] = []
    for (method, size), part in sizes.groupby(["method", "size"], sort=False):
        if len(part) > 1:
            curves[str(method), str(size)] = part
        else:
            single.append(part)
    lines = []
    for measure, row in itertools.product(MEASURES, rows(pd.concat(single)) if single else ()):
        own = getattr(row, measure)
        for (rival, size), part in curves.items():
            if size == row.size:
                points = part[["ns", measure]].to_numpy(dtype=np.float64)
                other = error_at([(float(t), float(e)) for t, e in points], row.ns)
                ratio = other / own if own > 0 else math.nan
                lines.append((measure, row.method, row.setting, size, row.ns, own, rival, other, ratio))
    return pd.DataFrame(lines, columns=list(COLUMNS))


def error_at(curve: Sequence[tuple[float, float]], ns: float) -> float:
    """Return the error of a knob's curve of (time, error) at a time; NaN before its fastest setting.

    Straight in both logarithms between settings that no faster one beats; beyond the slowest its error. From the first
    setting on whose error is lost in the truth's noise (not above 0) it is 0.
    """
    best: list[tuple[float, float]] = []
    lost = math.inf
    for time, error in sorted(curve):
        if error <= 0:
            lost = time
            break
        if not best or error < best[-1][1]:
            best.append((time, error))
    if ns >= lost:
        return 0.0
    if not best or ns < best[0][0]:
        return math.nan
    times, errors = np.log(np.array(best)).T
    return float(np.exp(np.interp(math.log(ns), times, errors)))


def _classes(manifest: Manifest, folder: Path) -> tuple[dict[float, _Asked], dict[float, float]]:
    """Return the queries and the truth of each class by its lower edge, and the share of all queries it holds."""
    classes: dict[float, _Asked] = {}
    counts: dict[float, int] = {}
    for name in manifest.names("seen", "unseen"):
        queries, stated = manifest.read(folder, name, "test")
        answers = with_noise(stated, queries, TruthOptions.model_validate(manifest.about["truth"]))
        size = np.sqrt(queries.sigma * queries.sigma_minor)
        for low, high in itertools.pairwise(EDGES):
            chosen = np.flatnonzero((size >= low) & (size < high))
            if chosen.size:
                counts[low] = counts.get(low, 0) + chosen.size
                asked = (manifest.fabrics[name], queries.take(chosen), answers.take(chosen))
                classes.setdefault(low, []).append(asked)
    total = sum(counts.values())
    return {low: classes[low] for low in sorted(classes)}, {low: count / total for low, count in counts.items()}


def _errors(method: Method, asked: _Asked, seed: int) -> Iterator[tuple[str, float]]:
    """Yield the error of each measure, the mean over fabrics; 0 where it is lost in the noise of the truth."""
    values = [
        method.predict(cloth, queries, int(fingerprint(["size", cloth.name, seed]), 16)) for cloth, queries, _ in asked
    ]
    for name, (_, weights) in MEASURES.items():
        found = [colour_error(v, truth, weights, resamples=0) for v, (_, _, truth) in zip(values, asked, strict=True)]
        yield name, float(np.mean([error.relative_rmse for error in found if error.mean > 0] or [0.0]))
