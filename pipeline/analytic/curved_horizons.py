"""Horizons over curved cloth: a base that falls away lowers what hides a direction.

The sine of a horizon falls by about curvature / 2 times the distance of what hides, until something nearer hides more.
The fall is tabulated for a few curvatures beside each horizon, and is a line between them. Towards a light it is that
of the curvature in the light's azimuth (pipeline.truth.scattering.point.directions_of).
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from pipeline.compiled.arrays import Float32
from pipeline.compiled.decorators import fast_kernel, kernel

CURVATURES: Final = (0.05, 0.25, 1.0)
"""Curvatures for which falls are tabulated, 1/yarn spacings; the last one is the largest of all queries."""

FALL: Final = 2.0
"""Largest fall of a sine for each unit of curvature: half the distance of what hides, in yarn spacings."""

_0, _1, _FALL = np.float32(0.0), np.float32(1.0), np.float32(FALL)


class Bend(NamedTuple):
    """A curvature between two tabulated ones.

    Attributes
    ----------
    low, high : int
        Which ones.
    of_low, of_high : float32
        Factors of their falls, which are tabulated as shares of `FALL` times the curvature.
    """

    low: int
    high: int
    of_low: np.float32
    of_high: np.float32


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
    """Write the horizons of fixed nodes over a curved base, (B, BLOCK_NODES).

    Parameters
    ----------
    mean, falls : float32 (azimuths, B, BLOCK_NODES), (curvatures, azimuths, B, BLOCK_NODES)
        Mean horizons over a flat base, and their falls.
    low, high, turn
        Azimuths around the direction, and where between them it lies.
    bend : Bend
        Curvature along the direction.
    found : float32 (B, BLOCK_NODES)
        Written.
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


@kernel
def bend_cells(
    grid: npt.NDArray[np.uint8],
    falls: npt.NDArray[np.uint8],
    cells: npt.NDArray[np.uint32],
    low: np.uint32,
    high: np.uint32,
    turn: np.float32,
    bend: Bend,
    found: Float32,
) -> None:
    """Write the horizons of placed nodes over a curved base, in levels of the grid.

    Parameters
    ----------
    grid, falls : uint8 (cells,), (curvatures, cells)
        Horizons over a flat base, and their falls.
    cells : uint32 (N,)
        Each node's cell at the first azimuth.
    low, high, turn
        What leads to the azimuths around the direction, and where between them it lies.
    bend : Bend
        Curvature along the direction; with factors of 0 no falls are read.
    found : float32 (N,)
        Written.
    """
    bent = bend.of_low > _0 or bend.of_high > _0
    for k in range(len(cells)):
        first, last = cells[k] + low, cells[k] + high
        level = np.float32(grid[first]) + turn * (np.float32(grid[last]) - np.float32(grid[first]))
        if bent:
            little, much = np.float32(falls[bend.low, first]), np.float32(falls[bend.high, first])
            little += turn * (np.float32(falls[bend.low, last]) - little)
            much += turn * (np.float32(falls[bend.high, last]) - much)
            level -= bend.of_low * little + bend.of_high * much
        found[k] = level
