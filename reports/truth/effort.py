"""Effort of `auto`: the shares of queries that it answers by tables alone, by refined borders, and by sampling."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Annotated, Final

import numpy as np

from pipeline.truth.calibration import COARSE_TABLE, FINE_TABLE, REFINED, SAMPLED
from pipeline.truth.estimator import uncalibrated
from pipeline.truth.options import TruthOptions
from reports.truth.accuracy import FABRICS, default_queries, seconds_a_query
from reports.truth.row_records import RowRecords

CLASSES: Final = ("table alone", "borders refined", "sampled")  # how a query is answered, the cheapest first
RELATIVE_ERROR: Final = 0.01  # requested error
_SEED = 23
_CLASS_OF: Final = {COARSE_TABLE: 0, FINE_TABLE: 0, REFINED: 1, SAMPLED: 2}


@dataclass(frozen=True)
class Effort:
    """One way of answering on one fabric."""

    kind: str  # one of `CLASSES`
    fabric: str
    share: Annotated[float, "kind_share"]
    points: Annotated[float, "kind_points"]
    seconds: Annotated[float, "kind_time"]
    count: int  # queries of all kinds


def measure(rows: int = 1000, fabrics: Sequence[str] = FABRICS) -> Iterator[Effort]:
    """Measure how `auto` at `RELATIVE_ERROR` answers so many default queries of every preset."""
    for fabric, queries in default_queries(fabrics, rows, _SEED):
        options = TruthOptions(relative_error=RELATIVE_ERROR, max_count=1 << 14)
        answers = uncalibrated(fabric, queries, options, _SEED)
        kinds = np.array([_CLASS_OF[stage] for stage in answers.stage.tolist()])
        for number, kind in enumerate(CLASSES):
            chosen = np.flatnonzero(kinds == number)
            points = float(answers.count[chosen].mean()) if chosen.size else 0.0
            seconds = seconds_a_query(fabric, queries.take(chosen), options) if chosen.size else 0.0
            yield Effort(kind, fabric.name, chosen.size / rows, points, seconds, rows)


RECORDS: Final = RowRecords(Effort, setting=("kind",))
