"""Azimuths even in the diamond angle: found around a direction without an arc tangent.

The diamond angle runs with |x| + |y| = 1 from +y through +x, -y and -x, a quarter of all azimuths in each quadrant.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from pipeline.compiled.arrays import Float64
from pipeline.compiled.decorators import fast_kernel

AZIMUTHS: Final = 32
"""Azimuths for which horizons are known."""

_0, _1, _TINY = np.float32(0.0), np.float32(1.0), np.float32(1e-12)


@fast_kernel
def around(x: np.float32, y: np.float32) -> tuple[int, int, np.float32]:
    """Return the two azimuths around a direction, and where between them it lies."""
    size = abs(x) + abs(y)
    t = y / size if size > _TINY else _0
    t = _1 - t if x >= _0 else np.float32(3.0) + t
    t = t * np.float32(AZIMUTHS / 4)
    low = min(int(t), AZIMUTHS - 1)
    return low, (low + 1 if low + 1 < AZIMUTHS else 0), t - np.float32(low)


def from_even(values: Float64) -> Float64:
    """Return values known for azimuths even in the angle from +x, (rows, N), at the AZIMUTHS of the diamond angle."""
    count = len(values)
    t = 4.0 * np.arange(AZIMUTHS) / AZIMUTHS
    dy = np.where(t <= 2.0, 1.0 - t, t - 3.0)
    dx = np.where(t <= 2.0, 1.0, -1.0) * (1.0 - np.abs(dy))
    turn = np.mod(np.arctan2(dy, dx), 2.0 * np.pi) * (0.5 * count) / np.pi
    low = np.floor(turn + 1e-9).astype(np.int64)
    share = (turn - low)[:, None]
    return np.asarray(values[low % count] * (1.0 - share) + values[(low + 1) % count] * share)
