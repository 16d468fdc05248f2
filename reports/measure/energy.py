"""Energy of the processor, where Linux lets it be read: that of all packages, cores that do nothing included.

The counters are those of RAPL, which begin again at their range. Some systems let only the administrator read them, and
some machines have none. GPUs are not part of it.
"""

from __future__ import annotations

import math
from pathlib import Path

_ZONES = Path("/sys/class/powercap")


def counters() -> dict[Path, int]:
    """Read the counters of all packages, in microjoules, by their folders; none where they cannot be read."""
    try:
        return {zone: _number(zone / "energy_uj") for zone in sorted(_ZONES.glob("intel-rapl:[0-9]"))}
    except (OSError, ValueError):
        return {}


def joules(before: dict[Path, int]) -> float:
    """Return the energy since counters were read, in joules; NaN where they cannot be read."""
    if not before:
        return math.nan
    try:
        passed = ((_number(zone / "energy_uj") - value, zone) for zone, value in before.items())
        return 1e-6 * sum(energy % (_number(zone / "max_energy_range_uj") + 1) for energy, zone in passed)
    except (OSError, ValueError):
        return math.nan


def _number(path: Path) -> int:
    return int(path.read_text())
