"""Effort of `auto`: the shares of queries that it answers by tables alone, by refined borders, and by sampling."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from pipeline.shards.queries import QueryOptions, draw_queries
from pipeline.truth.calibration import COARSE_TABLE, FINE_TABLE, REFINED, SAMPLED
from pipeline.truth.estimator import estimate, uncalibrated
from pipeline.truth.options import TruthOptions
from pipeline.truth.query import Queries
from reports.measure.timing import set_threads
from reports.truth.row_records import RowRecords
from reports.truth.throughput import FABRICS
from weaves.fabric import Fabric, load_fabric

CLASSES: Final = ("table alone", "borders refined", "sampled")
"""How a query is answered, the cheapest first."""

RELATIVE_ERROR: Final = 0.01
"""Requested error."""

_ROWS = 1000
_REPEATS = 3
_SEED = 23
_CLASS_OF: Final = {COARSE_TABLE: 0, FINE_TABLE: 0, REFINED: 1, SAMPLED: 2}


@dataclass(frozen=True)
class Effort:
    """One way of answering on one fabric."""

    kind: str
    """One of `CLASSES`."""
    fabric: str
    """Name of the cloth."""
    share: float
    """Share of the queries."""
    points: float
    """Nodes and points a query of this kind."""
    seconds: float
    """Time of a query of this kind."""
    count: int
    """Queries of all kinds."""


def measure(rows: int = _ROWS, fabrics: Sequence[str] = FABRICS) -> Iterator[Effort]:
    """Measure how `auto` at `RELATIVE_ERROR` answers queries of the default distribution, single-threaded.

    Parameters
    ----------
    rows : int
        Queries a fabric.
    fabrics : sequence of str
        Presets.
    """
    set_threads(1)
    for name in fabrics:
        fabric = load_fabric(name)
        queries = draw_queries(QueryOptions(), fabric.weave.repeat, _SEED, 0, rows)
        options = TruthOptions(relative_error=RELATIVE_ERROR, max_count=1 << 14)
        answers = uncalibrated(fabric, queries, options, _SEED)
        kinds = np.array([_CLASS_OF[stage] for stage in answers.stage.tolist()])
        for number, kind in enumerate(CLASSES):
            chosen = np.flatnonzero(kinds == number)
            yield Effort(
                kind=kind,
                fabric=name,
                share=chosen.size / rows,
                points=float(answers.count[chosen].mean()) if chosen.size else 0.0,
                seconds=_seconds(fabric, queries.take(chosen), options) if chosen.size else 0.0,
                count=rows,
            )


def _seconds(fabric: Fabric, queries: Queries, options: TruthOptions) -> float:
    """Return the median time of a query among others of its kind."""
    times = []
    for _ in range(_REPEATS):
        start = time.perf_counter()
        estimate(fabric, queries, options, _SEED)
        times.append(time.perf_counter() - start)
    return float(np.median(times)) / len(queries.u)


RECORDS: Final = RowRecords(
    Effort,
    {"share": "kind_share", "points": "kind_points", "seconds": "kind_time"},
    setting=("kind",),
)
"""Efforts as Records."""
