"""Energy of the processor, where Linux lets it be read: that of all packages, cores that do nothing included.

The counters are those of RAPL, which begin again at their range. Some systems let only the administrator read them, and
some machines have none. GPUs are not part of it.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import NamedTuple

_ZONES = Path("/sys/class/powercap")


class Counter(NamedTuple):
    """The counter of one package."""

    folder: Path
    value: int
    """In microjoules."""


def counters() -> list[Counter]:
    """Read the counters of all packages; none where they cannot be read."""
    try:
        return [Counter(zone, _number(zone / "energy_uj")) for zone in sorted(_ZONES.glob("intel-rapl:[0-9]"))]
    except (OSError, ValueError):
        return []


def joules(before: list[Counter]) -> float:
    """Return the energy since counters were read, in joules; NaN where they cannot be read."""
    try:
        passed = [
            (_number(folder / "energy_uj") - value) % (_number(folder / "max_energy_range_uj") + 1)
            for folder, value in before
        ]
    except (OSError, ValueError):
        return math.nan
    return 1e-6 * sum(passed) if passed else math.nan


def _number(path: Path) -> int:
    return int(path.read_text())
