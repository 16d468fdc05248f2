"""The bias of the tabulated answers: what `node_table` gets wrong on the average over many patches.

A table's horizons and nodes are the same for every query, so that its errors need not cancel as those of random points
do. The bias of a component is <table - reference> / <reference> over the queries of the default distribution that the
table answers, with the light in front of the cloth or, its z reversed, behind; the reference is `owen`, whose own
errors cancel in the mean.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Annotated, Final, Literal

import numpy as np

from pipeline.compiled.arrays import Float64
from pipeline.truth.cloth import cloth_side, columns_of
from pipeline.truth.conventions import COMPONENTS
from pipeline.truth.estimator import estimate
from pipeline.truth.node_table.tables import FINE
from pipeline.truth.options import TruthOptions
from reports.truth.accuracy import FABRICS, default_queries, fixed
from reports.truth.row_records import RowRecords

LIMIT: Final = 0.003  # bias that is small enough
SIDES: Final = ("light in front", "light behind")  # where the light is; the viewer is in front
_SEED = 22
_TABLE: Final = TruthOptions(estimator="node_table")


@dataclass(frozen=True)
class Bias:
    """The bias of one component on one fabric."""

    fabric: str
    side: str  # one of `SIDES`
    component: str  # one of `COMPONENTS`
    value: Annotated[float, "bias"]  # relative to the mean of the component
    standard_error: float  # of `value`, from the spread over queries
    count: int  # queries

    @property
    def result(self) -> Literal["below", "open", "above"]:
        """Where it lies beside `LIMIT`, two standard errors considered."""
        if abs(self.value) + 2.0 * self.standard_error <= LIMIT:
            return "below"
        return "above" if abs(self.value) - 2.0 * self.standard_error > LIMIT else "open"


def measure(rows: int = 4000, fabrics: Sequence[str] = FABRICS, reference: int = 1 << 13) -> Iterator[Bias]:
    """Measure every component, of so many queries of every preset and side; `reference` is a power of two."""
    for fabric, drawn in default_queries(fabrics, rows, _SEED):
        queries = drawn.take(FINE.knows(cloth_side(fabric, _TABLE), columns_of(drawn)))
        for side, sign in zip(SIDES, (1.0, -1.0), strict=True):
            lit = queries._replace(wi=queries.wi * np.array([1.0, 1.0, sign], np.float32))
            truth = estimate(fabric, lit, fixed("owen", reference), _SEED + 1).mean.astype(np.float64)
            answers = estimate(fabric, lit, _TABLE, _SEED).mean.astype(np.float64)
            for component, own, other in zip(COMPONENTS, answers.T, truth.T, strict=True):
                yield Bias(fabric.name, side, component, *bias_of(own, other), len(lit.u))


def bias_of(found: Float64, truth: Float64) -> tuple[float, float]:
    """Return <found - truth> / <truth> and its standard error; 0 where the truth is 0.

    The error is that of a ratio of means r, to first order: sd(found - truth - r truth) / (sqrt(N) <truth>).
    """
    mean = float(truth.mean())
    if mean <= 0.0:
        return 0.0, 0.0
    ratio = float((found - truth).mean()) / mean
    spread = float(np.std(found - truth - ratio * truth, ddof=1))
    return ratio, spread / math.sqrt(len(truth)) / mean


RECORDS: Final = RowRecords(Bias, setting=("side", "component"), once={"standard_error": "standard_error"}, joint=": ")
