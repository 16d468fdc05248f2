"""Footprints folded by periodicity: positions in the repeat, and weights, of the points of a patch of any size.

A kernel of any width over an endless fabric is a wrapped density on one repeat; both kernels are products of one factor
for each axis. A narrow axis is sampled from the kernel itself and wrapped. A wide one would wrap many times and lose
the order of low-discrepancy points, so it is sampled evenly over the repeat and weighted by the wrapped density
instead; for a Gaussian of one repeat or more that weight is 1 to 4e-16. The choice depends on the size alone, so both
are the same integral. A footprint with two axes at an angle is no product in x and y: it is sampled from the kernel and
wrapped, unless it covers the repeat evenly.
"""

import math
from typing import Final, NamedTuple

from pipeline.compiled.decorators import inlined_kernel, kernel
from pipeline.compiled.normal import normal_quantile
from pipeline.truth.geometry.march import wrap

GAUSSIAN, BOX = 0, 1

_WIDE_GAUSSIAN = 0.3  # in repeats; from here on three harmonics give the wrapped density to 1e-12
_HARMONICS = 3

EVENLY: Final = 0.6
"""Standard deviation of a Gaussian, in repeats, from which on single precision takes it as even: its one wave is
2 exp(-2 pi^2 .36)."""

BOX_SIDE = math.sqrt(12.0)  # side of the square whose standard deviation is 1


class Axis(NamedTuple):
    """A footprint along x or y: GAUSSIAN or BOX, centre, standard deviation, and the repeat it is folded into."""

    shape: int
    centre: float
    sigma: float
    repeat: float


@kernel
def folded_box(axis: Axis) -> tuple[float, float, float]:
    """Return how many whole repeats a box covers everywhere, and where it covers one more: half width and centre."""
    side = BOX_SIDE * axis.sigma
    whole = float(math.floor(side / axis.repeat))
    centre = axis.centre + (0.5 * axis.repeat if whole % 2.0 == 1.0 else 0.0)
    return whole, 0.5 * (side - whole * axis.repeat), centre


@inlined_kernel
def place(axis: Axis, number: float) -> tuple[float, float]:
    """Return the position in [0, repeat) that a number in (0, 1) names on one axis, and its weight (mean 1)."""
    shape, centre, sigma, repeat = axis
    if shape == GAUSSIAN:
        if sigma < _WIDE_GAUSSIAN * repeat:
            return wrap(centre + sigma * normal_quantile(number), repeat), 1.0
        offset = 2.0 * math.pi * (number - 0.5)
        damping = -2.0 * (math.pi * sigma / repeat) ** 2
        weight = 1.0
        if damping > -40.0:
            for k in range(1, _HARMONICS + 1):
                weight += 2.0 * math.exp(damping * k * k) * math.cos(k * offset)
        return wrap(centre + (number - 0.5) * repeat, repeat), max(weight, 0.0)
    side = BOX_SIDE * sigma
    if side < repeat:
        return wrap(centre + (number - 0.5) * side, repeat), 1.0
    # So many whole repeats everywhere, and one more within what is left around the centre (or its opposite).
    whole = math.floor(side / repeat)
    rest = side / repeat - whole
    distance = abs(number - 0.5) * 2.0
    odd = whole % 2.0 == 1.0
    near = distance > 1.0 - rest if odd else distance < rest
    return wrap(centre + (number - 0.5) * repeat, repeat), (whole + (1.0 if near else 0.0)) * repeat / side
