"""Measurements on held-out queries: errors of methods and of the truth, time, memory.

Each function is independent of the others, so that tasks can run them separately; so are those of
`reports.measure.pictures` and `reports.measure.frames`. The seed of a random method is a function of the measurement:
no number depends on earlier work.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from itertools import count, cycle, islice
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np
import numpy.typing as npt

from pipeline.cores import cores
from pipeline.fingerprint import fingerprint
from pipeline.models.added.guarded import Guarded, load_function
from pipeline.scenes.shade import colours_of
from pipeline.shards.manifest import Manifest
from pipeline.truth.estimator import estimate
from pipeline.truth.options import TruthOptions
from pipeline.truth.query import Answers, Queries
from reports.catalogue import AddedMetric, enter
from reports.error import COLOUR_WEIGHTS, Error, colour_error, component_errors, most_error
from reports.measure.memory import peak_memory
from reports.measure.timing import Contender, affordable, milliseconds, quartiles, thread_counts, time_side_by_side
from reports.options import ErrorOptions, Role, TimingOptions
from reports.record import TRUTH, Metric, Provenance, Record
from weaves.fabric import Fabric

if TYPE_CHECKING:
    from pipeline.models.method import Method

EDITS: Final = 5
"""Fabrics never seen before that a method is timed to prepare."""

_COMPONENT_METRICS: Final[tuple[Metric, ...]] = (
    "rrmse_specular_warp",
    "rrmse_specular_weft",
    "rrmse_diffuse_warp",
    "rrmse_diffuse_weft",
)


def measure_errors(
    method: Method,
    manifest: Manifest,
    folder: Path,
    fabric: str,
    role: Role,
    options: ErrorOptions,
    provenance: Provenance | None = None,
) -> list[Record]:
    """Measure a method on a fabric's held-out queries: MSE in colour, and relative errors (`reports.error`).

    Parameters
    ----------
    method : Method
        Must cover the fabric.
    manifest, folder : Manifest, Path
        The data set.
    fabric, role : str
        Name of the fabric, and whether general models saw it.
    options : ErrorOptions
        Number of rows, and the seed of random methods.
    """
    cloth, queries, truth, values = _answered(method, manifest, folder, fabric, options)
    subject = Record(
        method=method.name,
        setting=method.setting,
        fabric=fabric,
        role=role,
        scene="queries",
        provenance=provenance or Provenance(),
    )
    records = subject.of_error(colour_error(values, truth, colours_of(cloth, queries)))
    relative: dict[Metric, Error] = {"colour_rrmse": colour_error(values, truth, COLOUR_WEIGHTS, resamples=0)}
    relative["colour_rrmse_99"] = most_error(values, truth)
    relative |= dict(zip(_COMPONENT_METRICS, component_errors(values, truth), strict=True))
    black = np.asarray(~values.any(axis=1) & truth.mean.any(axis=1))
    records.append(subject.of("zero_answers", float(black.mean()), len(black)))
    # A component that is nowhere seen has no relative error.
    records += [subject.of(name, e.relative_rmse, e.count) for name, e in relative.items() if e.mean > 0]
    return records


def measure_added(
    method: Method,
    metric: AddedMetric,
    manifest: Manifest,
    folder: Path,
    fabric: str,
    role: Role,
    options: ErrorOptions,
    provenance: Provenance | None = None,
) -> Record:
    """Measure a metric from outside; arguments as for `measure_errors`.

    Raises
    ------
    MethodFailed
        If the metric's code fails, or returns no finite number.
    """
    enter(metric.row)
    measured = load_function(metric)
    cloth, queries, truth, values = _answered(method, manifest, folder, fabric, options)
    value = measured(cloth, queries, values, truth.mean, truth.standard_error)
    subject = Record(
        method=method.name,
        setting=method.setting,
        fabric=fabric,
        role=role,
        scene="queries",
        provenance=provenance or Provenance(),
    )
    return subject.of(metric.row.name, value, len(values)).made_by(metric.origin)


def _answered(
    method: Method, manifest: Manifest, folder: Path, fabric: str, options: ErrorOptions
) -> tuple[Fabric, Queries, Answers, npt.NDArray[np.float32]]:
    """Return a fabric, its held-out queries, the truth, and a method's values."""
    cloth, queries, truth = _held_out(manifest, folder, fabric, options)
    method.prepare(cloth)
    return cloth, queries, truth, method.predict(cloth, queries, int(fingerprint(["errors", fabric, options.seed]), 16))


def measure_truth(
    manifest: Manifest,
    folder: Path,
    fabric: str,
    role: Role,
    options: ErrorOptions,
    provenance: Provenance | None = None,
) -> list[Record]:
    """Measure the truth on a fabric's held-out queries: median and quartiles of |standard error| / |mean|.

    Both are norms over the four components, as in the estimator's stopping rule.
    """
    _, _, truth = _held_out(manifest, folder, fabric, options)
    size = np.linalg.norm(truth.mean, axis=1)
    relative = np.linalg.norm(truth.standard_error, axis=1)[size > 0] / size[size > 0]
    low, median, high = (float(q) for q in np.percentile(relative, [25, 50, 75]))
    subject = Record(method=TRUTH, fabric=fabric, role=role, scene="queries", provenance=provenance or Provenance())
    return [subject.of("truth_relative_error", median, len(relative), low=low, high=high)]


def measure_timing(
    methods: Sequence[Method],
    manifest: Manifest,
    folder: Path,
    options: TimingOptions,
    provenance: Provenance | None = None,
    progress: Callable[[float], None] = lambda share: None,
) -> list[Record]:
    """Time methods side by side on held-out queries of all named fabrics; note bytes, memory and the cost of a fabric.

    `progress` receives the finished share.

    Returns
    -------
    list of Record
        For each method `bytes_stored`, the mean over fabrics; `peak_memory` of a call of `timing_rows` queries, on one
        thread, where the system reports it (`reports.measure.memory`); `prepare_time`, the time until a fabric never
        seen before can be evaluated, where any fabric can be. Then `time` for each method and number of threads, the
        truth last, with every reading as `samples` and the queries a fabric as `note`
        (`reports.measure.timing.affordable`).
    """
    sample = []
    for name in manifest.names("seen", "unseen"):
        cloth, queries, _ = _held_out(manifest, folder, name, options)
        sample.append((cloth, queries.take(np.arange(options.timing_rows) % len(queries.u))))

    truth = TruthOptions.model_validate(manifest.about["truth"])
    _prepare(methods, [cloth for cloth, _ in sample])
    entries, records, edits = [], [], count(1)
    for index, method in enumerate(methods):
        progress(0.3 * index / len(methods))
        covered = [(cloth, queries) for cloth, queries in sample if method.covers(cloth)]
        if not covered:
            continue
        subject = Record(method=method.name, setting=method.setting, provenance=provenance or Provenance())
        entries.append((subject, affordable(Contender(method.predict, covered))))
        stored = float(np.mean([method.bytes_stored(cloth) for cloth, _ in covered]))
        records.append(subject.of("bytes_stored", stored, len(covered)))
        memory = peak_memory(partial(method.predict, *covered[0]))
        records += [subject.of("peak_memory", memory, 3)] if memory is not None else []
        records += _preparing(subject, method, [cloth for cloth, _ in covered], edits)
    exact = affordable(Contender(lambda cloth, queries: estimate(cloth, queries, truth, 0), sample))
    entries.append((Record(method=TRUTH, provenance=provenance or Provenance()), exact))
    return records + _times(entries, options, lambda share: progress(0.3 + 0.7 * share))


def _times(
    entries: Sequence[tuple[Record, Contender]], options: TimingOptions, progress: Callable[[float], None]
) -> list[Record]:
    """Return the times of all contenders on every number of threads, all of them in turns."""
    runs = [
        (subject.model_copy(update={"threads": threads}), contender._replace(threads=threads))
        for subject, contender in entries
        for threads in thread_counts(options.threads)
    ]
    timings = time_side_by_side(
        [contender for _, contender in runs], options.timing_repeats, options.warm_up, progress=progress
    )
    records = []
    for (subject, contender), timing in zip(runs, timings, strict=True):
        low, median, high = timing.quartiles
        about = subject.model_copy(update={"note": f"{len(contender.queries[0][1].u)} queries a fabric"})
        repeats, samples = len(timing.samples), timing.samples
        records.append(about.of("time", median, repeats, low=low, high=high, samples=samples))
        if math.isfinite(timing.waited):
            records.append(subject.of("waited", timing.waited, repeats))
    return records


def _prepare(methods: Sequence[Method], fabrics: Sequence[Fabric]) -> None:
    """Prepare every fabric for every method, on all cores but for code from outside: only the clock needs them idle."""
    with ThreadPoolExecutor(cores()) as ours, ThreadPoolExecutor(1) as theirs:
        started = [
            (theirs if isinstance(method, Guarded) else ours).submit(method.prepare, cloth)
            for method in methods
            for cloth in fabrics
            if method.covers(cloth)
        ]
        for future in started:
            future.result()


def _preparing(subject: Record, method: Method, fabrics: Sequence[Fabric], edits: Iterator[int]) -> list[Record]:
    """Return the time to prepare fabrics that no cache holds: the named ones in turn, each with an edit of its own.

    An edit lowers the warp's relief by a few parts in ten thousand, so that no cache of any method helps.
    """
    times = []
    for fabric, edit in zip(islice(cycle(fabrics), EDITS), edits, strict=False):
        warp = fabric.warp.model_copy(update={"relief": fabric.warp.relief * (1 - 1e-4 * edit)})
        new = fabric.model_copy(update={"name": f"{fabric.name}, edit {edit}", "warp": warp})
        if not method.covers(new):
            return []
        times.append(milliseconds(partial(method.prepare, new)))
    low, median, high = quartiles(times)
    found = subject.of("prepare_time", median, len(times), low=low, high=high, samples=tuple(times))
    return [found]


def _held_out(manifest: Manifest, folder: Path, name: str, options: ErrorOptions) -> tuple[Fabric, Queries, Answers]:
    queries, answers = manifest.read(folder, name, "test")
    rows = slice(options.rows)
    return manifest.fabrics[name], queries.take(rows), answers.take(rows)
