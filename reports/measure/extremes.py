"""Every method at its extremes: footprints of 1e-4 to 1e4 repeats, 89.9 degrees, far places, half precision.

All methods evaluate one set of queries on one set of cloths, one of them as lustrous as yarns may be (alpha = .01):

    error       relative RMSE of the colour measure against the truth: at each footprint without grazing angles, and at
                grazing angles; with parallax of the light alone, because the truth knows no viewer beyond 89 degrees
    rounding    relative RMSE between the answers of a lower precision and the method's own, at all queries
    far         the same footprints a million yarns away: largest difference, over the largest answer
    large       1e4 repeats against 1e2: both are the average of the repeat
    not finite, negative    answers that none can be

Random methods draw the same points where only the place differs; at another size they land elsewhere.
"""

import itertools
import math
from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np

from pipeline.compiled.arrays import Float32, Float64, Mask
from pipeline.models.method import Method
from pipeline.truth.estimator import estimate
from pipeline.truth.options import TruthOptions
from pipeline.truth.query import LOWEST_VIEWER, Queries
from reports.error import COLOUR_WEIGHTS
from reports.options import EXTREME_TRUTH, Role
from reports.record import Metric, Record
from weaves.fabric import Fabric

FOOTPRINTS: Final = (1e-4, 1e-2, 1.0, 1e2, 1e4)  # standard deviations, in repeats: the square root of their area
_ANGLES: Final = (0.0, 60.0, 89.9)  # angles of light and viewer to the normal, in degrees
GRAZING: Final = 89.9  # name of the grazing queries among the errors, and their angle
LUSTROUS: Final = 0.01  # least roughness that a yarn may have

FAR: Final = 1e6
"""Distance of the far queries, in yarn spacings; single precision still holds sixteenths of a yarn there."""

SHINY: Final = f", alpha = {LUSTROUS:g}"  # ending of the names of lustrous fabrics
_AZIMUTHS = (0.4, 2.1)  # of light and viewer


def lustrous(fabric: Fabric) -> Fabric:
    """Return the fabric with the shiniest yarns that may be."""
    yarns = {name: getattr(fabric, name).model_copy(update={"roughness": LUSTROUS}) for name in ("warp", "weft")}
    return fabric.model_copy(update={"name": fabric.name + SHINY, **yarns})


class ExtremeInputs(NamedTuple):
    """Queries about one fabric, of all footprints, angles and places."""

    queries: Queries
    far: Queries  # the same footprints a million yarns away
    size: Float64  # footprint of each, in repeats
    grazing: Mask  # True if light or viewer graze


def extremes(repeat: tuple[int, int]) -> ExtremeInputs:
    """Return the queries about a fabric of this repeat: 5 footprints x 9 pairs of angles x 2 places."""
    random = np.random.default_rng(0)
    # Sixteenths of a yarn: what single precision holds far away too.
    places = random.integers(0, np.array(repeat) * 16, (2, 2)) / 16
    rows = list(itertools.product(FOOTPRINTS, _ANGLES, _ANGLES, places.tolist()))
    size, light, viewer = (np.array([row[k] for row in rows], np.float64) for k in range(3))
    centre, period = np.array([row[3] for row in rows]).T, np.array(repeat)[:, None]
    near, away = centre.astype(np.float32), (centre + period * (FAR // period - 1)).astype(np.float32)
    sigma = (size * math.sqrt(repeat[0] * repeat[1])).astype(np.float32)
    wi, wo = (_direction(theta, phi) for theta, phi in zip((light, viewer), _AZIMUTHS, strict=True))
    queries = Queries.round(near[0], near[1], sigma, wi, wo)
    far = queries._replace(u=away[0], v=away[1])
    return ExtremeInputs(queries, far, size, np.maximum(light, viewer) == GRAZING)


def measure_extremes(
    families: Sequence[Sequence[Method]], fabrics: Sequence[tuple[Fabric, Role]], truth: TruthOptions = EXTREME_TRUTH
) -> list[Record]:
    """Measure methods, each followed by its lower precisions, at their extremes on the cloths that they cover.

    Records of each method and fabric are `extreme_error`, the worst over footprints with all of them as its curve, and
    `extreme_grazing`; `extreme_rounding` for lower precisions; `extreme_far`, `extreme_large`, `extreme_not_finite`,
    `extreme_negative`. A number is left out if no answer is finite.
    """
    records = []
    for fabric, role in fabrics:
        inputs = extremes(fabric.weave.repeat)
        covering = [[method for method in family if method.covers(fabric)] for family in families]
        if not any(covering):
            continue
        true = _true(fabric, inputs.queries, truth)
        for family in covering:
            own: Float64 | None = None
            for method in family:
                subject = Record(method=method.name, setting=method.setting, fabric=fabric.name, role=role)
                method.prepare(fabric)
                answers, measured = _measured(subject, method, fabric, inputs, true)
                records += measured
                if own is not None:
                    records += _of(subject, "extreme_rounding", _relative(answers, own), len(own))
                own = answers if own is None else own
    return records


def _true(fabric: Fabric, queries: Queries, options: TruthOptions) -> Float64:
    """Return the truth, NaN for viewers too low for parallax."""
    known = queries.wo[:, 2] >= (LOWEST_VIEWER if options.parallax else 0.0)
    result = np.full((len(known), 4), np.nan)
    result[known] = estimate(fabric, queries.take(known), options, 0).mean
    return result


def _measured(
    subject: Record, method: Method, fabric: Fabric, inputs: ExtremeInputs, truth: Float64
) -> tuple[Float64, list[Record]]:
    near, far = (_evaluated(method, fabric, queries) for queries in (inputs.queries, inputs.far))
    wide, wider = (_evaluated(method, fabric, inputs.queries.take(inputs.size == size)) for size in FOOTPRINTS[-2:])
    every, grazing = np.concatenate([near, far]), inputs.grazing
    wrong = {"extreme_not_finite": ~np.isfinite(every), "extreme_negative": every < 0}
    records = [subject.of(metric, int(rows.any(axis=1).sum()), len(every)) for metric, rows in wrong.items()]
    rows = [(size, (inputs.size == size) & ~grazing) for size in FOOTPRINTS]
    points = ((size, _relative(near[chosen], truth[chosen])) for size, chosen in rows)
    if curve := tuple(point for point in points if math.isfinite(point[1])):
        records.append(subject.of("extreme_error", max(error for _, error in curve), len(near), curve=curve))
    records += _of(subject, "extreme_grazing", _relative(near[grazing], truth[grazing]), int(grazing.sum()))
    records += _of(subject, "extreme_far", _largest(far, near), len(far))
    records += _of(subject, "extreme_large", _largest(wider, wide), len(wide))
    return near, records


def _evaluated(method: Method, fabric: Fabric, queries: Queries) -> Float64:
    with np.errstate(all="ignore"):  # what is not finite is counted
        return method.predict(fabric, queries, 0).astype(np.float64)


def _of(subject: Record, metric: Metric, value: float, count: int) -> list[Record]:
    return [subject.of(metric, value, count)] if math.isfinite(value) else []


def _relative(answers: Float64, truth: Float64) -> float:
    """Return the relative RMSE of the colour measure over rows that are finite; NaN if there is none."""
    finite = np.isfinite(answers).all(axis=1) & np.isfinite(truth).all(axis=1)
    value, reference = (x[finite] @ COLOUR_WEIGHTS for x in (answers, truth))
    size = float(np.linalg.norm(reference))
    return float(np.linalg.norm(value - reference)) / size if size else math.nan


def _largest(answers: Float64, others: Float64) -> float:
    """Return the largest difference over the largest of the others; NaN if no row is finite in both."""
    finite = np.isfinite(answers).all(axis=1) & np.isfinite(others).all(axis=1)
    largest = float(np.abs(others[finite]).max(initial=0.0))
    return float(np.abs(answers[finite] - others[finite]).max(initial=0.0)) / largest if largest else math.nan


def error_name(size: float) -> str:
    """Return the column of the errors at a footprint: ``error_1em04`` for 1e-4."""
    return "error_" + f"{size:g}".replace("-", "m").replace(".", "p")


def _direction(theta: Float64, phi: float) -> Float32:
    sine, cosine = np.sin(np.radians(theta)), np.cos(np.radians(theta))
    return np.stack([sine * math.cos(phi), sine * math.sin(phi), cosine], axis=-1).astype(np.float32)
