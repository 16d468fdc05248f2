"""The measurements on held-out queries: errors, the truth's own, and time.

Each function stands alone, so that a task system can run them apart; so do those of `reports.pictures` and
`reports.frames`. Random methods get seeds that are named by what is measured: no number depends on what ran before.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np

from pipeline.fingerprint import fingerprint
from pipeline.scenes.shade import colours
from pipeline.shards.manifest import Manifest
from pipeline.truth.estimator import estimate
from pipeline.truth.options import TruthOptions
from pipeline.truth.query import Answers, Queries
from reports.metrics import COLOUR_WEIGHTS, Error, colour_error, component_errors
from reports.options import BenchOptions
from reports.record import TRUTH, Metric, Provenance, Record, Role
from reports.timing import Contender, time_side_by_side
from weaves.fabric import Fabric

if TYPE_CHECKING:
    from pipeline.models.method import Method

TRUTH_SHARE: Final = 16
"""The truth is timed on one query for this many of the methods': it takes a hundred times as long."""

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
    options: BenchOptions,
    provenance: Provenance | None = None,
) -> list[Record]:
    """Measure a method on a fabric's held-out queries: MSE in colour, and relative errors (`reports.metrics`).

    Parameters
    ----------
    method : Method
        Must cover the fabric.
    manifest, folder : Manifest, Path
        The data set.
    fabric, role : str
        Name of the fabric, and whether general models saw it.
    options : BenchOptions
        How many rows, and the seed of random methods.
    """
    cloth, queries, truth = _held_out(manifest, folder, fabric, options)
    method.prepare(cloth)
    values = method.predict(cloth, queries, int(fingerprint(["errors", fabric, options.seed]), 16))
    subject = Record(
        method=method.name,
        setting=method.setting,
        fabric=fabric,
        role=role,
        scene="queries",
        provenance=provenance or Provenance(),
    )
    records = subject.of_error(colour_error(values, truth, colours(cloth)))
    relative: dict[Metric, Error] = {"colour_rrmse": colour_error(values, truth, COLOUR_WEIGHTS, resamples=0)}
    relative |= dict(zip(_COMPONENT_METRICS, component_errors(values, truth), strict=True))
    black = np.asarray(~values.any(axis=1) & truth.mean.any(axis=1))
    records.append(subject.of("zero_answers", float(black.mean()), len(black)))
    # A component that is nowhere seen has no relative error.
    records += [subject.of(name, e.relative_rmse, e.count) for name, e in relative.items() if e.mean > 0]
    return records


def measure_truth(
    manifest: Manifest,
    folder: Path,
    fabric: str,
    role: Role,
    options: BenchOptions,
    provenance: Provenance | None = None,
) -> list[Record]:
    """Measure the truth itself on a fabric's held-out queries: median and quartiles of |standard error| / |mean|.

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
    options: BenchOptions,
    provenance: Provenance | None = None,
) -> list[Record]:
    """Time methods side by side on held-out queries of all named fabrics, and note the bytes they store.

    One timed call answers `timing_rows` queries, an equal share about each fabric that the method covers; the truth
    answers one in `TRUTH_SHARE` of them.
    """
    asked = []
    names = manifest.names("seen", "unseen")
    share = -(-options.timing_rows // len(names))
    for name in names:
        cloth, queries, _ = _held_out(manifest, folder, name, options)
        asked.append((cloth, queries.take(np.arange(share) % len(queries.u))))

    contenders, subjects, records = [], [], []
    for method in methods:
        covered = [(cloth, queries) for cloth, queries in asked if method.covers(cloth)]
        if not covered:
            continue
        for cloth, _ in covered:
            method.prepare(cloth)
        subject = Record(method=method.name, setting=method.setting, provenance=provenance or Provenance())
        contenders.append(Contender(method.predict, covered))
        subjects.append(subject)
        stored = float(np.mean([method.bytes_stored(cloth) for cloth, _ in covered]))
        records.append(subject.of("bytes_stored", stored, len(covered), unit="B"))

    truth = TruthOptions.model_validate(manifest.about["truth"])
    few = [(cloth, queries.take(slice(-(-share // TRUTH_SHARE)))) for cloth, queries in asked]
    contenders.append(Contender(lambda cloth, queries: estimate(cloth, queries, truth, 0), few))
    subjects.append(Record(method=TRUTH, provenance=provenance or Provenance()))
    timings = time_side_by_side(contenders, options.timing_repeats, options.warm_up, options.threads)
    for subject, t in zip(subjects, timings, strict=True):
        records.append(
            subject.of("time", t.median, t.repeats, unit="ns/query", low=t.first_quartile, high=t.third_quartile)
        )
    return records


def _held_out(manifest: Manifest, folder: Path, name: str, options: BenchOptions) -> tuple[Fabric, Queries, Answers]:
    queries, answers = manifest.read(folder, name, "test")
    rows = slice(options.rows)
    return manifest.fabrics[name], queries.take(rows), answers.take(rows)
