"""Measurements on held-out queries: errors of methods and of the truth, time, memory.

Each function is independent of the others, so that tasks can run them separately; so are those of
`reports.measure.pictures` and `reports.measure.frames`. The seed of a random method is a function of the measurement:
no number depends on earlier work.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from functools import partial
from itertools import count, cycle, islice
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from pipeline.compiled.arrays import Float32
from pipeline.cores import cores
from pipeline.fingerprint import fingerprint
from pipeline.models.added.guarded import Guarded, load_function
from pipeline.models.method import Method
from pipeline.scenes.shade import colours_of
from pipeline.shards.manifest import Manifest
from pipeline.truth.conventions import COMPONENTS
from pipeline.truth.estimator import estimate
from pipeline.truth.options import TruthOptions
from pipeline.truth.query import Answers, Queries
from reports.catalogue import AddedMetric, enter
from reports.error import COLOUR_WEIGHTS, Error, colour_error, component_errors, most_error
from reports.measure import timing
from reports.measure.memory import peak_memory
from reports.options import TimingOptions
from reports.record import TRUTH, Metric, Record
from weaves.fabric import Fabric

EDITS: Final = 5  # fabrics never seen before that a method is timed to prepare
_LONGEST_EDITS: Final = 10_000.0  # milliseconds
_FIRST: Final = 64  # queries that the truth answers, so that it has its tables

_Sample = Sequence[tuple[Fabric, Queries]]


class HeldOutFabric(NamedTuple):
    """Held-out queries about a fabric, with the truth's answers."""

    fabric: Fabric
    queries: Queries
    truth: Answers

    def answered(self, method: Method, seed: int) -> tuple[Float32, Record]:
        """Return the answers of a method that covers the fabric, and the subject of its Records."""
        method.prepare(self.fabric)
        own = int(fingerprint(["errors", self.fabric.name, seed]), 16)
        subject = Record(method=method.name, setting=method.setting, fabric=self.fabric.name, scene="queries")
        return method.predict(self.fabric, self.queries, own), subject


def held_out(manifest: Manifest, folder: Path, name: str, rows: int | None = None) -> HeldOutFabric:
    """Return the first rows of a fabric's test split; all of them if `rows` is not given."""
    queries, answers = manifest.read(folder, name, "test")
    return HeldOutFabric(manifest.fabrics[name], queries.take(slice(rows)), answers.take(slice(rows)))


def measure_errors(method: Method, rows: HeldOutFabric, seed: int) -> list[Record]:
    """Measure a method: MSE in colour, and relative errors (`reports.error`); `seed` is that of random methods."""
    truth, (values, subject) = rows.truth, rows.answered(method, seed)
    records = subject.of_error(colour_error(values, truth, colours_of(rows.fabric, rows.queries)))
    relative: dict[Metric, Error] = {"colour_rrmse": colour_error(values, truth, COLOUR_WEIGHTS, resamples=0)}
    relative["colour_rrmse_99"] = most_error(values, truth)
    relative |= zip((f"rrmse_{name}" for name in COMPONENTS), component_errors(values, truth), strict=True)
    black = np.asarray(~values.any(axis=1) & truth.mean.any(axis=1))
    records.append(subject.of("zero_answers", float(black.mean()), len(black)))
    # A component that is nowhere seen has no relative error.
    records += [subject.of(name, e.relative_rmse, e.count) for name, e in relative.items() if e.mean > 0]
    return records


def measure_added(method: Method, metric: AddedMetric, rows: HeldOutFabric, seed: int) -> Record:
    """Measure a metric from outside; arguments as for `measure_errors`.

    MethodFailed if the metric's code fails, or returns no finite number.
    """
    enter(metric.row)
    measured = load_function(metric)
    values, subject = rows.answered(method, seed)
    value = measured(rows.fabric, rows.queries, values, rows.truth.mean, rows.truth.standard_error)
    return subject.of(metric.row.name, value, len(values)).made_by(metric.origin)


def measure_truth(rows: HeldOutFabric) -> Record:
    """Measure the truth: median and quartiles of |standard error| / |mean|.

    Both are norms over the four components, as in the estimator's stopping rule.
    """
    size = np.linalg.norm(rows.truth.mean, axis=1)
    relative = np.linalg.norm(rows.truth.standard_error, axis=1)[size > 0] / size[size > 0]
    low, median, high = timing.quartiles(relative)
    subject = Record(method=TRUTH, fabric=rows.fabric.name, scene="queries")
    return subject.of("truth_relative_error", median, len(relative), low=low, high=high)


def measure_timing(
    methods: Sequence[Method],
    fabrics: Sequence[HeldOutFabric],
    truth: TruthOptions,
    options: TimingOptions,
    progress: Callable[[float], None] = lambda share: None,
    unseen: Sequence[HeldOutFabric] = (),
) -> list[Record]:
    """Time methods side by side on held-out queries of all fabrics; note bytes, memory and the cost of a fabric.

    The truth is timed with the options it was made by; `progress` receives the finished share.

    Records of each method are `bytes_stored`, the mean over fabrics; `peak_memory` of a call of `timing_rows` queries,
    on one thread, where the system reports it (`reports.measure.memory`); `prepare_time`, the time until a fabric never
    seen before can be evaluated, where any fabric can be. Then `time` for each method and number of threads, the truth
    last, with every reading as `samples` and the queries a fabric as `note` (`reports.measure.timing.affordable`).
    Methods that cover all `unseen` fabrics are timed on those alone too, on the fewest threads: Records of `time`,
    `processor_time`, `waited` and `energy` with the role ``unseen``.
    """
    sample, others = (
        [(cloth, queries.take(np.arange(options.timing_rows) % len(queries.u))) for cloth, queries, _ in part]
        for part in (fabrics, unseen)
    )
    _prepare(methods, sample, others, truth)
    entries, records, edits = [], [], count(1)
    for index, method in enumerate(methods):
        progress(0.3 * index / len(methods))
        covered = [(cloth, queries) for cloth, queries in sample if method.covers(cloth)]
        if not covered:
            continue
        subject = Record(method=method.name, setting=method.setting)
        entries.append((subject, timing.affordable(timing.Contender(method.predict, covered))))
        if others and all(method.covers(cloth) for cloth, _ in others):
            own = timing.affordable(timing.Contender(method.predict, others))
            entries.append((subject.model_copy(update={"role": "unseen"}), own))
        stored = float(np.mean([method.bytes_stored(cloth) for cloth, _ in covered]))
        records.append(subject.of("bytes_stored", stored, len(covered)))
        memory = peak_memory(partial(method.predict, *covered[0]))
        records += [subject.of("peak_memory", memory, 3)] if memory is not None else []
        records += _preparing(subject, method, [cloth for cloth, _ in covered], edits)
    exact = timing.affordable(timing.Contender(lambda cloth, queries: estimate(cloth, queries, truth, 0), sample))
    entries.append((Record(method=TRUTH), exact))
    return records + _times(entries, options, lambda share: progress(0.3 + 0.7 * share))


def _times(
    entries: Sequence[tuple[Record, timing.Contender]], options: TimingOptions, progress: Callable[[float], None]
) -> list[Record]:
    """Return the times of all contenders on every number of threads, all of them in turns."""
    runs = [
        (subject.model_copy(update={"threads": threads}), contender._replace(threads=threads))
        for subject, contender in entries
        for threads in timing.thread_counts(options.threads)[: 1 if subject.role else None]
    ]
    contenders, repeats = [contender for _, contender in runs], options.timing_repeats
    timings = timing.time_side_by_side(contenders, repeats, options.warm_up, progress=progress)
    records = []
    for (subject, contender), cost in zip(runs, timings, strict=True):
        about = subject.model_copy(update={"note": f"{len(contender.queries[0][1].u)} queries a fabric"})
        records.append(timing.timed(about, "time", cost.samples))
        records.append(subject.of("processor_time", 1e-3 * cost.processor, repeats))
        if contender.threads == 1:
            records.append(subject.of("waited", cost.waited, repeats))
        if math.isfinite(cost.joules):
            records.append(subject.of("energy", 1e6 * cost.joules, repeats))
    return records


def _prepare(methods: Sequence[Method], sample: _Sample, others: _Sample, truth: TruthOptions) -> None:
    """Prepare all fabrics for methods, and those of `sample` for the truth, on all cores: the clock needs them idle.

    Code from outside has one thread.
    """
    with ThreadPoolExecutor(cores()) as ours, ThreadPoolExecutor(1) as theirs:
        started: list[Future[object]] = [ours.submit(estimate, c, q.take(slice(_FIRST)), truth, 0) for c, q in sample]
        started += [
            (theirs if isinstance(method, Guarded) else ours).submit(method.prepare, cloth)
            for method in methods
            for cloth, _ in (*sample, *others)
            if method.covers(cloth)
        ]
        for future in started:
            future.result()


def _preparing(subject: Record, method: Method, fabrics: Sequence[Fabric], edits: Iterator[int]) -> list[Record]:
    """Return the time to prepare fabrics that no cache holds: the named ones in turn, each with an edit of its own.

    An edit lowers the warp's relief by a few parts in ten thousand. A method that takes long is measured less often.
    """
    times = []
    for fabric, edit in zip(islice(cycle(fabrics), EDITS), edits, strict=False):
        warp = fabric.warp.model_copy(update={"relief": fabric.warp.relief * (1 - 1e-4 * edit)})
        new = fabric.model_copy(update={"name": f"{fabric.name}, edit {edit}", "warp": warp})
        if not method.covers(new):
            return []
        times.append(timing.milliseconds(partial(method.prepare, new)))
        if sum(times) > _LONGEST_EDITS:
            break
    return [timing.timed(subject, "prepare_time", times)]
