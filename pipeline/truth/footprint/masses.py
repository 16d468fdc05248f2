"""The mass of a footprint's axis on intervals of the repeat, folded by periodicity; float32.

Kernel, centre and repeat are those of `place`, whose points have these masses as their histogram.
"""

from __future__ import annotations

import math

import numpy as np

from pipeline.compiled.arrays import Float32
from pipeline.compiled.decorators import fast_kernel, kernel
from pipeline.compiled.normal import normal_distribution
from pipeline.truth.footprint.place import BOX, BOX_SIDE, GAUSSIAN

_SPREAD_OUT = 0.8  # in repeats: an axis of a Gaussian this wide covers the repeat evenly, to 6e-6
_REACH = 5.5  # in standard deviations; what lies beyond is 4e-8


@kernel
def interval_masses(
    shape: int,
    centre: float,
    sigma: float,
    repeat: float,
    edges: Float32,
    cell: float,
    masses: Float32,
) -> bool:
    """Write the mass of each interval between neighbouring edges; return whether any may be above 0.

    Parameters
    ----------
    shape, centre, sigma, repeat
        As in `place`.
    edges : float32 (n + 1,)
        Rising positions in their cell, in [0, 1].
    cell : float
        Start of the cell.
    masses : float32 (n,)
        Written; over a whole repeat they sum to 1.
    """
    count = len(masses)
    if shape == GAUSSIAN and sigma >= _SPREAD_OUT * repeat:
        even = np.float32(1.0 / repeat)
        for k in range(count):
            masses[k] = (edges[k + 1] - edges[k]) * even
        return True
    side = BOX_SIDE * sigma
    whole, even = 0.0, np.float32(0.0)
    if shape == BOX:
        # So many whole repeats everywhere, and the rest around the centre, or opposite it.
        whole = math.floor(side / repeat)
        even = np.float32(whole / side)
        if whole % 2.0 == 1.0:
            centre += 0.5 * repeat
    reach = _REACH * sigma if shape == GAUSSIAN else 0.5 * (side - whole * repeat)
    for k in range(count):
        masses[k] = even * (edges[k + 1] - edges[k])
    first = math.ceil((cell - centre - reach) / repeat)
    last = math.floor((cell + 1.0 - centre + reach) / repeat)
    for image in range(first, last + 1):
        middle = np.float32(centre + image * repeat - cell)
        if shape == GAUSSIAN:
            _add_gaussian(edges, middle, np.float32(1.0 / sigma), masses)
        else:
            _add_box(edges, middle, np.float32(reach), np.float32(1.0 / side), masses)
    return last >= first or whole > 0.0


@fast_kernel
def _add_gaussian(edges: Float32, middle: np.float32, inverse: np.float32, masses: Float32) -> None:
    for k in range(len(masses)):
        below = normal_distribution((edges[k] - middle) * inverse)
        masses[k] += normal_distribution((edges[k + 1] - middle) * inverse) - below


@fast_kernel
def _add_box(
    edges: Float32,
    middle: np.float32,
    reach: np.float32,
    inverse: np.float32,
    masses: Float32,
) -> None:
    for k in range(len(masses)):
        low = min(max(edges[k] - middle, -reach), reach)
        high = min(max(edges[k + 1] - middle, -reach), reach)
        masses[k] += (high - low) * inverse
