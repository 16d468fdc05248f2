"""How busy a machine was with other work while methods were timed on it.

A method on one thread that has nothing to wait for runs all the time it takes. What it does not run
(`reports.measure.timing.CallTiming.waited`), other work had the processor. Work on other cores that slows memory or the
clock is not seen by this.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Final

import numpy as np

from reports.record import Record

QUIET: Final = 0.02
"""Share of the time that methods wait for others on a machine that counts as quiet."""


def waited(records: Iterable[Record]) -> float:
    """Return the share of the time that methods on one thread waited, the median over methods; NaN if unknown."""
    found = [record.value for record in records if record.metric == "waited"]
    return float(np.median(found)) if found else math.nan


def waiting(records: Iterable[Record]) -> list[str]:
    """Return a sentence for the page."""
    share = waited(records)
    if math.isnan(share):
        return []
    warning = "" if share < QUIET else ": the times are too long by that, and not all alike"
    return [
        "While methods were timed on one thread, that thread waited for other work on the machine "
        f"{100 * share:.1f} % of the time (median over methods){warning}."
    ]


def busy(a: Iterable[Record], b: Iterable[Record]) -> list[str]:
    """Return a sentence for a comparison if methods of A or B had to wait."""
    shares = {name: waited(records) for name, records in (("A", a), ("B", b))}
    found = [f"{name} waited {100 * share:.0f} % of the time" for name, share in shares.items() if share >= QUIET]
    if not found:
        return []
    return [f"Other work ran on the machine while methods were timed, {' and '.join(found)}: times may differ by that"]
