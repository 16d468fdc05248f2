"""Errors of blended latents, and the time of an edit.

A designer moves a slider, or edits a yarn. Two ways lead from one fabric to another: blend their latents, or encode the
fabric in between. Both are held against the truth of the fabric in between, at shares t of the way, on the same
queries. Every number of the yarns is then blended alike, beta(t) = (1 - t) beta_first + t beta_second. Between two
drafts there is no draft: the truth in between is the cross-fade (1 - t) f_first + t f_second of both cloths, and there
is nothing to encode.

Errors are the relative RMSE of the colour measure (`reports.error`), noise of the truth subtracted. The time of an edit
is the delay until the next answer: the fabric's maps are made and encoded again. Colours are not encoded.
"""

from functools import partial
from typing import Any, Final, Literal, NamedTuple

import numpy as np

from pipeline.compiled.arrays import Float32
from pipeline.models.method import Method
from pipeline.shards.queries import QueryOptions, draw_queries
from pipeline.truth.estimator import estimate
from pipeline.truth.options import TruthOptions
from pipeline.truth.query import Answers, Queries
from reports.error import COLOUR_WEIGHTS, colour_error
from reports.measure.timing import milliseconds, timed
from reports.options import LATENT_PAIRS
from reports.record import Metric, Record
from weaves.fabric import Fabric, load_fabric

SHARES: Final = (0.0, 0.25, 0.5, 0.75, 1.0)
"""Positions between the first fabric (0) and the second (1) at which errors are measured."""

_SEED = 31
_BLENDED = ("width", "bend", "twist", "roughness", "relief", "blend")


class Pair(NamedTuple):
    """Two fabrics that differ in one thing."""

    first: Fabric
    second: Fabric  # of the same repeat
    differs: Literal["yarns", "draft"]

    @property
    def about(self) -> str:
        """Difference of the second fabric from the first."""
        return f"{self.differs} of {self.second.name}"


def pairs() -> list[Pair]:
    """Return the pairs: three drafts, each with the yarns of another preset, and two drafts of the same yarns."""
    result = []
    for name, other, differs in LATENT_PAIRS:
        first, second = load_fabric(name), load_fabric(other)
        update = {"draft": second.draft} if differs == "draft" else {"warp": second.warp, "weft": second.weft}
        result.append(Pair(first, first.model_copy(update={"name": other} | update), differs))
    return result


def between(pair: Pair, share: float) -> Fabric:
    """Return the fabric whose yarns lie at `share` of the way; colours are the first one's."""
    yarns = {}
    for name in ("warp", "weft"):
        first, second = getattr(pair.first, name), getattr(pair.second, name)
        numbers = {key: (1.0 - share) * getattr(first, key) + share * getattr(second, key) for key in _BLENDED}
        yarns[name] = first.model_copy(update=numbers)
    return pair.first.model_copy(update=yarns)


def measure_paths(
    method: Any, pair: Pair, distribution: QueryOptions, truth: TruthOptions, rows: int = 1024
) -> list[Record]:
    """Return the errors of blending and of encoding anew along the path between two fabrics.

    The method must have `predict_between`, as `woven` has. The `rows` queries of the distribution are the same ones at
    every share. Records are `path_error` and, for yarns, `reencode_error`: the value is the error in the middle, the
    curve that at `SHARES`.
    """
    queries, records = draw_queries(distribution, pair.first.weave.repeat, _SEED, 0, rows), []
    answers = _truths(pair, queries, truth)
    subject = Record(method=method.name, setting=method.setting, fabric=pair.first.name, note=pair.about)
    ways: dict[Metric, list[Float32]] = {}
    ways["path_error"] = [method.predict_between(pair.first, pair.second, share, queries) for share in SHARES]
    if pair.differs == "yarns":
        ways["reencode_error"] = [method.predict(between(pair, share), queries) for share in SHARES]
    for metric, values in ways.items():
        errors = (
            colour_error(*of_share, COLOUR_WEIGHTS, resamples=0) for of_share in zip(values, answers, strict=True)
        )
        curve = tuple((share, error.relative_rmse) for share, error in zip(SHARES, errors, strict=True))
        records.append(subject.of(metric, dict(curve)[0.5], rows, curve=curve))
    return records


def measure_edits(method: Method, fabric: Fabric, repeats: int = 25) -> list[Record]:
    """Return the time until answers can follow an edit of a yarn, and one of a colour: medians, in milliseconds.

    Edits, `repeats` of each, change the warp's relief or its diffuse colour a little: no two fabrics are the same.
    """
    subject = Record(method=method.name, setting=method.setting, fabric=fabric.name)
    method.prepare(fabric)
    steps = [(step + 1) / (repeats + 2) for step in range(repeats + 1)]
    yarns = [{"relief": fabric.warp.relief * (0.9 + 0.1 * step)} for step in steps]
    colours = [{"diffuse": (0.2, 0.3, 0.4 * step)} for step in steps]
    records = []
    for about, edits in (("a yarn", yarns), ("a colour", colours)):
        edited = [fabric.model_copy(update={"warp": fabric.warp.model_copy(update=edit)}) for edit in edits]
        # The first call warms up.
        times = [milliseconds(partial(method.prepare, cloth)) for cloth in edited][1:]
        records.append(timed(subject.model_copy(update={"note": about}), "encode_time", times))
    return records


def _truths(pair: Pair, queries: Queries, truth: TruthOptions) -> list[Answers]:
    """Return the truth at every share: of the yarns in between, or the cross-fade of both drafts."""
    if pair.differs == "yarns":
        return [estimate(between(pair, share), queries, truth, _SEED) for share in SHARES]
    first, second = estimate(pair.first, queries, truth, _SEED), estimate(pair.second, queries, truth, _SEED + 1)
    faded = []
    for share in SHARES:
        mean = (1.0 - share) * first.mean + share * second.mean
        error = np.hypot((1.0 - share) * first.standard_error, share * second.standard_error)
        faded.append(Answers.opaque(mean.astype(np.float32), error.astype(np.float32), first.count + second.count))
    return faded
