"""Azimuths of tables: evenly spaced, counter-clockwise from +x, with linear interpolation between them."""

from __future__ import annotations

import math

from pipeline.compiled.decorators import kernel


@kernel
def azimuth_rows(x: float, y: float, count: int) -> tuple[int, int, float]:
    """Return the two azimuths around a direction, and where between them it lies."""
    place = math.atan2(y, x) / (2.0 * math.pi) * count
    row = math.floor(place)
    return int(row) % count, int(row + 1) % count, place - row
