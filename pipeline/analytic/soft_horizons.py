"""Soft horizons: a node's horizon is known for some azimuths, and its visibility is a ramp.

Azimuths are even in the diamond angle, found around a direction without an arc tangent: it runs with |x| + |y| = 1 from
+y through +x, -y and -x, a quarter of all azimuths in each quadrant. The ramp is as wide as the spread of the horizon
over the node's box. How much of a box both viewer and light reach depends on their azimuths: alike (the smaller share
decides), at right angles (the shares multiply) or opposite (the hidden parts exclude each other).

A base that falls away lowers what hides a direction: the sine of a horizon falls by about curvature / 2 times the
distance of what hides, until something nearer hides more. The fall is tabulated for a few curvatures beside each
horizon, and is a line between them. Towards a light it is that of the curvature in the light's azimuth
(pipeline.truth.scattering.point.directions_of).
"""

from typing import Final, NamedTuple

import numpy as np

from pipeline.compiled.arrays import Float32, Float64
from pipeline.compiled.decorators import fast_kernel, inlined_fast_kernel, inlined_kernel, kernel

_SHORTEST = np.float32(1e-12)  # |x| + |y| below which a direction is the normal
_0, _1, _HALF = np.float32(0.0), np.float32(1.0), np.float32(0.5)
_RAMP, _RAMP_SLOPE = np.float32(0.02), np.float32(0.4)  # width of a point's ramp, and its growth with the deviation
_TINY: Final = np.float32(1e-20)


AZIMUTHS: Final = 32  # azimuths for which horizons are known


@fast_kernel
def around(x: np.float32, y: np.float32) -> tuple[int, int, np.float32]:
    """Return the two azimuths around a direction, and where between them it lies."""
    size = abs(x) + abs(y)
    t = y / size if size > _SHORTEST else _0
    t = _1 - t if x >= _0 else np.float32(3.0) + t
    t = t * np.float32(AZIMUTHS / 4)
    low = min(int(t), AZIMUTHS - 1)
    return low, (low + 1 if low + 1 < AZIMUTHS else 0), t - np.float32(low)


def azimuth_at(share: Float64) -> tuple[Float64, Float64]:
    """Return azimuths, |dx| + |dy| = 1, at shares of the whole turn of the diamond angle."""
    t = 4.0 * share
    dy = np.where(t <= 2.0, 1.0 - t, t - 3.0)
    return np.where(t <= 2.0, 1.0, -1.0) * (1.0 - np.abs(dy)), dy


def from_even(values: Float64) -> Float64:
    """Return values known for azimuths even in the angle from +x, (rows, N), at the AZIMUTHS of the diamond angle."""
    count = len(values)
    dx, dy = azimuth_at(np.arange(AZIMUTHS) / AZIMUTHS)
    turn = np.mod(np.arctan2(dy, dx), 2.0 * np.pi) * (0.5 * count) / np.pi
    low = np.floor(turn + 1e-9).astype(np.int64)
    share = (turn - low)[:, None]
    return np.asarray(values[low % count] * (1.0 - share) + values[(low + 1) % count] * share)


def over_boxes(
    values: Float64 | Float32, squares: Float64 | Float32, rows: Float64, columns: Float64
) -> tuple[Float64, Float64]:
    """Return mean and variance of horizons over boxes, (azimuths, boxes), boxes of a row following each other.

    `values` and `squares` (azimuths, rows, columns) are horizons of the cells of a grid, and their squares (means of
    both, where many grids share the boxes); `rows` and `columns` (boxes, cells) the share of each box in each cell,
    along both axes.
    """
    mean, square = ((rows @ grid @ columns.T).reshape(len(grid), -1) for grid in (values, squares))
    return mean, np.maximum(square - mean**2, 0.0)


@kernel
def sharpness_of_points(deviation: np.float32) -> np.float32:
    """Return 1 over the width of the ramp at nodes placed in a footprint, which grows with its deviation."""
    return _1 / (_RAMP + _RAMP_SLOPE * deviation)


@fast_kernel
def azimuths_apart(
    ix: np.float32, iy: np.float32, ox: np.float32, oy: np.float32
) -> tuple[np.float32, np.float32, np.float32]:
    """Return how far two directions' azimuths are alike, at right angles and opposite; the three sum to 1."""
    lengths = (ix * ix + iy * iy) * (ox * ox + oy * oy)
    cosine = (ix * ox + iy * oy) / np.sqrt(max(lengths, _TINY))
    alike, opposite = max(cosine, _0), max(-cosine, _0)
    return alike, _1 - alike - opposite, opposite


@inlined_fast_kernel
def above(z: np.float32, low: np.float32, high: np.float32, turn: np.float32, sharpness: np.float32) -> np.float32:
    """Return by how many widths of the ramp a direction of rise z clears a horizon between two azimuths."""
    return (z - low - turn * (high - low)) * sharpness


@inlined_fast_kernel
def ramp(above: np.float32) -> np.float32:
    """Return the share of a box from which a direction is free."""
    return min(max(_HALF + above, _0), _1)


# Not a fast kernel: regrouped, first + second - 1 would lose a small share's digits, and shadows could make light.
@inlined_kernel
def seen_and_lit(
    first: np.float32, second: np.float32, alike: np.float32, right: np.float32, opposite: np.float32
) -> np.float32:
    """Return the share of a box from which two directions are both free, given those of each and `azimuths_apart`."""
    return alike * min(first, second) + right * first * second + opposite * max(first - (_1 - second), _0)


CURVATURES: Final = (0.05, 0.25, 1.0)
"""Curvatures for which falls are tabulated, 1/yarn spacings; the last one is the largest of all queries."""

FALL: Final = 2.0
"""Largest fall of a sine for each unit of curvature: half the distance of what hides, in yarn spacings."""

_FALL = np.float32(FALL)


class Bend(NamedTuple):
    """A curvature between two tabulated ones."""

    low: int
    high: int
    """Which ones."""
    of_low: np.float32
    of_high: np.float32
    """Factors of their falls, which are tabulated as shares of `FALL` times the curvature."""


@kernel
def bend_of(curvature: np.float32) -> Bend:
    """Return a curvature as a mixture of tabulated ones; below the first, falls grow in proportion."""
    if curvature <= np.float32(CURVATURES[0]):
        return Bend(0, 0, _FALL * curvature, _0)
    high = 1
    while high < len(CURVATURES) - 1 and curvature > np.float32(CURVATURES[high]):
        high += 1
    first, last = np.float32(CURVATURES[high - 1]), np.float32(CURVATURES[high])
    share = (curvature - first) / (last - first)
    return Bend(high - 1, high, _FALL * first * (_1 - share), _FALL * last * share)


@fast_kernel
def bend_rows(
    mean: Float32, falls: Float32, low: int, high: int, turn: np.float32, bend: Bend, found: Float32
) -> None:  # fmt: skip
    """Write the horizons of fixed nodes over a base of curvature `bend` along the direction, (B, BLOCK_NODES).

    `mean` (azimuths, B, BLOCK_NODES) are horizons over a flat base, `falls` (curvatures, azimuths, ...) their falls.
    """
    first, last = mean[low], mean[high]
    first_low, last_low, first_high, last_high = (
        falls[bend.low, low], falls[bend.low, high], falls[bend.high, low], falls[bend.high, high]
    )  # fmt: skip
    for b in range(len(found)):
        for k in range(found.shape[1]):
            flat = first[b, k] + turn * (last[b, k] - first[b, k])
            little = first_low[b, k] + turn * (last_low[b, k] - first_low[b, k])
            much = first_high[b, k] + turn * (last_high[b, k] - first_high[b, k])
            found[b, k] = flat - bend.of_low * little - bend.of_high * much
