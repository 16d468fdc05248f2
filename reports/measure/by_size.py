"""Errors and times of methods by the size of the footprint.

One number over all footprints hides differences between methods: point sampling is good at small footprints, averaging
at large ones, and the cost of a query depends on its size as well. So errors and times are measured separately in
classes of size, methods in turns; `reports.tables.equal_time` compares them.

The error is the relative RMSE of the colour, .3 (S_warp + S_weft) + .5 (C_warp + C_weft), of its specular or its
diffuse part: root of the MSE, noise of the truth subtracted, over the mean of the truth; the mean over fabrics.
"""

import itertools
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Final

import numpy as np

from pipeline.compiled.arrays import Float64
from pipeline.fingerprint import fingerprint
from pipeline.models.method import Method
from reports.error import COLOUR_WEIGHTS, colour_error
from reports.measure.held_out import HeldOutFabric
from reports.measure.timing import Contender, affordable, quartiles, time_side_by_side
from reports.options import TimingOptions
from reports.record import Metric, Record

EDGES: Final = (0.0, 0.1, 0.3, 1.0, 3.0, math.inf)
"""Standard deviations between which footprints are of one class, in yarn spacings."""

WHOLE: Final = "all"  # name of all classes together, as the data set mixes them
SIZES: Final = ("below .1", ".1 to .3", ".3 to 1", "1 to 3", "above 3")  # names of the classes

MEASURES: Final[dict[str, tuple[Metric, Float64]]] = {
    "colour": ("size_colour", COLOUR_WEIGHTS),
    "specular": ("size_specular", np.array([[1.0], [1.0], [0.0], [0.0]])),
    "diffuse": ("size_diffuse", np.array([[0.0], [0.0], [1.0], [1.0]])),
}
"""Measured quantities: the Record's metric and the colour of each component."""

_LONGEST: Final = 0.02  # seconds that a timed call of one class, over its fabrics, should not exceed by much
_FEWEST: Final = 512  # queries a fabric in such a call: its fixed cost must not count as the cost of queries


def measure_by_size(
    methods: Sequence[Method],
    fabrics: Iterable[HeldOutFabric],
    options: TimingOptions,
    progress: Callable[[float], None] = lambda share: None,
) -> list[Record]:
    """Measure errors and times of methods on held-out queries, one class of footprints after the other.

    Errors are of all queries of a class. Timed are calls on one thread about every fabric that the method covers, of as
    many queries as `_LONGEST` allows. The time over all classes weighs them as they occur. The curve of a Record has
    (lower edge of the class, value); its value is that over all classes. `progress` receives the finished share.
    """
    classes, shares = _classes(fabrics)
    cloths = [cloth for members in classes.values() for cloth, _, _ in members]
    methods = [method for method in methods if any(map(method.covers, cloths))]
    times: dict[int, list[tuple[float, float]]] = {index: [] for index in range(len(methods))}
    for done, (low, members) in enumerate(classes.items()):
        progress(done / len(classes))
        contenders = []
        for method in methods:
            own = [member for member in members if method.covers(member[0])]
            for cloth, _, _ in own:
                method.prepare(cloth)
            drawn = [(cloth, queries) for cloth, queries, _ in own]
            contenders.append(affordable(Contender(method.predict, drawn), _LONGEST, _FEWEST))
        timings = time_side_by_side(
            contenders,
            options.timing_repeats,
            options.warm_up,
            progress=lambda share, done=done: progress((done + share) / len(classes)),  # type: ignore[misc]
        )
        for index, timing in enumerate(timings):
            times[index].append((low, quartiles(timing.samples)[1]))
    records = []
    for index, method in enumerate(methods):
        errors = _errors(method, classes, shares, options.seed)
        mean = sum(shares[low] * ns for low, ns in times[index])
        records += [errors[0].of("size_time", mean, errors[0].count, curve=tuple(times[index])), *errors]
    return records


def measure_errors_by_size(methods: Sequence[Method], fabrics: Iterable[HeldOutFabric], seed: int) -> list[Record]:
    """Measure errors as `measure_by_size` does, without times; `seed` is that of random methods."""
    classes, shares = _classes(fabrics)
    return [record for method in methods for record in _errors(method, classes, shares, seed)]


def _classes(fabrics: Iterable[HeldOutFabric]) -> tuple[dict[float, list[HeldOutFabric]], dict[float, float]]:
    """Return the queries and the truth of each class by its lower edge, and the share of all queries it holds."""
    classes: dict[float, list[HeldOutFabric]] = {}
    counts: dict[float, int] = {}
    for fabric, queries, answers in fabrics:
        size = np.sqrt(queries.sigma * queries.sigma_minor)
        for low, high in itertools.pairwise(EDGES):
            chosen = np.flatnonzero((size >= low) & (size < high))
            if chosen.size:
                counts[low] = counts.get(low, 0) + chosen.size
                classes.setdefault(low, []).append(HeldOutFabric(fabric, queries.take(chosen), answers.take(chosen)))
    total = sum(counts.values())
    return {low: classes[low] for low in sorted(classes)}, {low: count / total for low, count in counts.items()}


def _errors(
    method: Method, classes: Mapping[float, Sequence[HeldOutFabric]], shares: Mapping[float, float], seed: int
) -> list[Record]:
    """Return each error, the mean over fabrics; 0 where it is lost in the noise of the truth."""
    curves: dict[str, list[tuple[float, float]]] = {name: [] for name in MEASURES}
    count = 0
    for low, members in classes.items():
        own = [member for member in members if method.covers(member[0])]
        count += sum(len(queries.u) for _, queries, _ in own)
        for cloth, _, _ in own:
            method.prepare(cloth)
        values = [
            method.predict(cloth, queries, int(fingerprint(["size", cloth.name, seed]), 16))
            for cloth, queries, _ in own
        ]
        for name, (_, weights) in MEASURES.items():
            errors = [colour_error(v, part.truth, weights, resamples=0) for v, part in zip(values, own, strict=True)]
            curves[name].append((low, float(np.mean([e.relative_rmse for e in errors if e.mean > 0] or [0.0]))))
    # Squared errors add up: over all classes they weigh as their queries occur.
    wholes = {name: math.sqrt(sum(shares[low] * error**2 for low, error in curve)) for name, curve in curves.items()}
    subject = Record(method=method.name, setting=method.setting)
    return [
        subject.of(metric, wholes[name], count, curve=tuple(curves[name])) for name, (metric, _) in MEASURES.items()
    ]
