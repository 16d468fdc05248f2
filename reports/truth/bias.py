"""The bias of the tabulated answers: what `node_table` gets wrong on the average over many patches.

A table's horizons and nodes are the same for every query, so that its errors need not cancel as those of random points
do. The bias of a component is <table - reference> / <reference> over queries of the default distribution, with the
light in front of the cloth or, its z reversed, behind; the reference is `owen`, whose own errors cancel in the mean.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
import numpy.typing as npt

from pipeline.shards.queries import QueryOptions, draw_queries
from pipeline.truth.conventions import COMPONENTS
from pipeline.truth.estimator import estimate
from pipeline.truth.options import TruthOptions
from reports.measure.timing import set_threads
from reports.truth.accuracy import fixed
from reports.truth.row_records import RowRecords
from reports.truth.throughput import FABRICS
from weaves.fabric import load_fabric

LIMIT: Final = 0.003
"""Bias that is small enough."""

SIDES: Final = ("light in front", "light behind")
"""Where the light is; the viewer is in front."""

_ROWS = 4000
_REFERENCE = 1 << 13
_SEED = 22

Floats = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Bias:
    """The bias of one component on one fabric."""

    fabric: str
    """On which cloth."""
    side: str
    """One of `SIDES`."""
    component: str
    """One of `COMPONENTS`."""
    value: float
    """Relative to the mean of the component."""
    standard_error: float
    """Of `value`, from the spread over queries."""
    count: int
    """Queries."""

    @property
    def result(self) -> Literal["below", "open", "above"]:
        """True if it lies below `LIMIT`, two standard errors considered."""
        if abs(self.value) + 2.0 * self.standard_error <= LIMIT:
            return "below"
        return "above" if abs(self.value) - 2.0 * self.standard_error > LIMIT else "open"


def measure(rows: int = _ROWS, fabrics: Sequence[str] = FABRICS, reference: int = _REFERENCE) -> Iterator[Bias]:
    """Measure the bias of every component on every fabric, single-threaded.

    Parameters
    ----------
    rows : int
        Queries a fabric and side.
    fabrics : sequence of str
        Presets.
    reference : int
        Points of a reference answer, a power of two.
    """
    set_threads(1)
    for name in fabrics:
        fabric = load_fabric(name)
        queries = draw_queries(QueryOptions(), fabric.weave.repeat, _SEED, 0, rows)
        for side, sign in zip(SIDES, (1.0, -1.0), strict=True):
            lit = queries._replace(wi=queries.wi * np.array([1.0, 1.0, sign], np.float32))
            truth = estimate(fabric, lit, fixed("owen", reference), _SEED + 1).mean.astype(np.float64)
            found = estimate(fabric, lit, TruthOptions(estimator="node_table"), _SEED).mean.astype(np.float64)
            for component, one, other in zip(COMPONENTS, found.T, truth.T, strict=True):
                value, error = bias_of(one, other)
                yield Bias(name, side, component, value, error, rows)


def bias_of(found: Floats, truth: Floats) -> tuple[float, float]:
    """Return <found - truth> / <truth> and its standard error; 0 where the truth is 0.

    The error is that of a ratio of means r, to first order: sd(found - truth - r truth) / (sqrt(N) <truth>).
    """
    mean = float(truth.mean())
    if mean <= 0.0:
        return 0.0, 0.0
    ratio = float((found - truth).mean()) / mean
    spread = float(np.std(found - truth - ratio * truth, ddof=1))
    return ratio, spread / math.sqrt(len(truth)) / mean


RECORDS: Final = RowRecords(
    Bias,
    {"value": "bias"},
    setting=("side", "component"),
    once={"standard_error": "standard_error"},
    joint=": ",
)
"""Biases as Records."""
