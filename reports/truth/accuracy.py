"""Accuracy of the estimators: true errors beside stated errors and cost.

Errors are of the four components as a vector, |mean - reference| / |reference|, over patches that return light; the
reference is `owen` with 65,536 points and another seed. Plain Monte Carlo's error falls as N^-1/2: with its own
median true errors e_N at N points, c is the geometric mean of e_N sqrt(N), and (c / e)^2 points of it have the median
true error e. "Points saved" is that number over the points used.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Final

import numpy as np

from pipeline.shards.queries import QueryOptions, draw_queries
from pipeline.truth.estimator import estimate
from pipeline.truth.options import EstimatorName, TruthOptions
from pipeline.truth.query import Answers, Queries
from reports.error import COLOUR_WEIGHTS
from reports.measure.timing import milliseconds, set_threads
from reports.truth.row_records import RowRecords
from weaves.fabric import Fabric, load_fabric

FABRICS: Final = ("polyester_lining", "denim", "silk_charmeuse", "satin_8", "twill_4_4", "basket")
"""One of each family, and the largest repeats."""

COUNTS: Final = (64, 256, 1024)  # points of the estimators that sample
_SEED = 21
_DARK = 1e-3  # 1/sr: patches below return too little for a relative error


@dataclass(frozen=True)
class Accuracy:
    """One setting of the truth on one fabric."""

    setting: str  # estimator, and requested points or error
    fabric: str
    rmse: Annotated[float, "true_rmse"]  # of .3 (S_warp + S_weft) + .5 (C_warp + C_weft), over its mean
    true_error: Annotated[float, "true_error"]
    stated_error: Annotated[float, "stated_error"]
    points: Annotated[float, "points"]  # or nodes, a query; the mean
    rate: Annotated[float, "query_rate"]
    saved: Annotated[float, "points_saved"]  # points that `mc` would need for the same true error over those used
    reference: Annotated[float, "reference_error"]  # median relative error that the reference states
    count: int  # queries


def default_queries(names: Sequence[str], rows: int, seed: int) -> Iterator[tuple[Fabric, Queries]]:
    """Yield presets with queries of the default distribution; what follows runs on one thread."""
    set_threads(1)
    for fabric in map(load_fabric, names):
        yield fabric, draw_queries(QueryOptions(), fabric.weave.repeat, seed, 0, rows)


def seconds_a_query(fabric: Fabric, queries: Queries, options: TruthOptions) -> float:
    """Return the time of one query; the median of a few calls."""
    calls = [milliseconds(lambda: estimate(fabric, queries, options, _SEED)) for _ in range(3)]
    return 1e-3 * float(np.median(calls)) / len(queries.u)


def fixed(estimator: EstimatorName, count: int) -> TruthOptions:
    """Return options that take `count` points whatever their error."""
    return TruthOptions(estimator=estimator, relative_error=1e-9, absolute_error=0.0, min_count=count, max_count=count)


_SAMPLED: Final[tuple[EstimatorName, ...]] = ("mc", "r2", "owen")
SETTINGS: Final[dict[str, TruthOptions]] = {
    **{f"{name}, {count} points": fixed(name, count) for name in _SAMPLED for count in COUNTS},
    **{f"auto at {error} %": TruthOptions(relative_error=error / 100, max_count=1 << 14) for error in (5, 2, 1)},
}
"""Settings that are measured, by their names in tables."""


def measure(rows: int = 150, fabrics: Sequence[str] = FABRICS, reference: int = 1 << 16) -> Iterator[Accuracy]:
    """Measure every setting on so many default queries of every preset; `reference` is a power of two."""
    for fabric, queries in default_queries(fabrics, rows, _SEED):
        truth = estimate(fabric, queries, fixed("owen", reference), _SEED + 1)
        rows_of_fabric = [_compare(fabric, queries, truth, setting, options) for setting, options in SETTINGS.items()]
        # c of the law e = c N^-1/2: the geometric mean of plain Monte Carlo's median errors times sqrt(N).
        random = [row for row in rows_of_fabric if row.setting.startswith("mc,")]
        spread = float(np.exp(np.mean([np.log(row.true_error * np.sqrt(row.points)) for row in random])))
        for row in rows_of_fabric:
            yield replace(row, saved=(spread / max(row.true_error, 1e-12)) ** 2 / row.points)


def _compare(fabric: Fabric, queries: Queries, truth: Answers, setting: str, options: TruthOptions) -> Accuracy:
    """Return the errors and the cost of one setting; what it saves is not known yet."""
    answers = estimate(fabric, queries, options, _SEED)
    lit = np.linalg.norm(truth.mean, axis=1) > _DARK
    size = np.linalg.norm(truth.mean[lit], axis=1)
    wrong = np.linalg.norm(answers.mean[lit] - truth.mean[lit], axis=1) / size
    stated = np.linalg.norm(answers.standard_error[lit], axis=1) / size
    colour, true_colour = ((a.mean.astype(np.float64) @ COLOUR_WEIGHTS)[:, 0] for a in (answers, truth))
    return Accuracy(
        setting=setting,
        fabric=fabric.name,
        rmse=float(np.sqrt(np.mean((colour - true_colour) ** 2)) / true_colour.mean()),
        true_error=float(np.median(wrong)),
        stated_error=float(np.median(stated)),
        points=float(answers.count.mean()),
        rate=1.0 / seconds_a_query(fabric, queries, options),
        saved=1.0,
        reference=float(np.median(np.linalg.norm(truth.standard_error[lit], axis=1) / size)),
        count=len(lit),
    )


RECORDS: Final = RowRecords(Accuracy, setting=("setting",))
