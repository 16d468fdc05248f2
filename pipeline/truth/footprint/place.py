"""Footprints folded by periodicity: where in the repeat a patch of any size puts its points, and with which weight.

A kernel of any width over an endless fabric is a density on one repeat, wrapped; both kernels are products of one axis
each. A narrow axis is sampled from the kernel itself and wrapped. A wide one would wrap many times and lose the order
of low-discrepancy points, so it is sampled evenly over the repeat and weighted by the wrapped density instead; for a
Gaussian of one repeat or more that weight is 1 to 4e-16. The choice depends on the size alone, so both are the same
integral. A footprint with two axes at an angle is no product in x and y: it is sampled from the kernel and wrapped,
unless it covers the repeat evenly.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
import numpy.typing as npt

from pipeline.compiled.decorators import fast_kernel, inlined_kernel, kernel
from pipeline.compiled.float32 import remaining

GAUSSIAN, BOX = 0, 1

_WIDE_GAUSSIAN = 0.3  # in repeats; from here on three harmonics give the wrapped density to 1e-12
_HARMONICS = 3

EVENLY: Final = 0.6
"""Standard deviation of a Gaussian, in repeats, from which on single precision takes it as even: its one wave is
2 exp(-2 pi^2 .36)."""

BOX_SIDE = math.sqrt(12.0)  # side of the square whose standard deviation is 1

# Acklam's rational approximation of the normal quantile [Acklam2003Quantile].
_A = (
    -39.69683028665376,
    220.9460984245205,
    -275.9285104469687,
    138.3577518672690,
    -30.66479806614716,
    2.506628277459239,
)
_B = (-54.47609879822406, 161.5858368580409, -155.6989798598866, 66.80131188771972, -13.28068155288572)
_C = (
    -0.007784894002430293,
    -0.3223964580411365,
    -2.400758277161838,
    -2.549732539343734,
    4.374664141464968,
    2.938163982698783,
)
_D = (0.007784695709041462, 0.3224671290700398, 2.445134137142996, 3.754408661907416)
_TAIL = 0.02425


@inlined_kernel
def _rational(t: float) -> float:
    return (((((_C[0] * t + _C[1]) * t + _C[2]) * t + _C[3]) * t + _C[4]) * t + _C[5]) / (
        (((_D[0] * t + _D[1]) * t + _D[2]) * t + _D[3]) * t + 1.0
    )


@inlined_kernel
def normal_quantile(p: float) -> float:
    """Return the x at which the standard normal distribution reaches p, 0 < p < 1, to 1.2e-9 relative.

    A footprint's centre is known to float32, so the last digits of Acklam's form are not refined further.
    """
    if p < _TAIL:
        return _rational(math.sqrt(-2.0 * math.log(p)))
    if p > 1.0 - _TAIL:
        return -_rational(math.sqrt(-2.0 * math.log1p(-p)))
    q = p - 0.5
    r = q * q
    return (
        (((((_A[0] * r + _A[1]) * r + _A[2]) * r + _A[3]) * r + _A[4]) * r + _A[5])
        * q
        / (((((_B[0] * r + _B[1]) * r + _B[2]) * r + _B[3]) * r + _B[4]) * r + 1.0)
    )


@inlined_kernel
def _wrap(x: float, repeat: float) -> float:
    """Return x modulo the repeat, in [0, repeat)."""
    wrapped = x - repeat * math.floor(x / repeat)
    return wrapped if 0.0 <= wrapped < repeat else 0.0


@inlined_kernel
def place(shape: int, centre: float, sigma: float, repeat: float, number: float) -> tuple[float, float]:
    """Return the position in [0, repeat) that a number in (0, 1) names on one axis, and its weight (mean 1).

    Parameters
    ----------
    shape : int
        GAUSSIAN or BOX.
    centre, sigma, repeat : float
        Centre and standard deviation of the kernel and length of the repeat, in yarn spacings.
    number : float
        Where in the distribution.
    """
    if shape == GAUSSIAN:
        if sigma < _WIDE_GAUSSIAN * repeat:
            return _wrap(centre + sigma * normal_quantile(number), repeat), 1.0
        offset = 2.0 * math.pi * (number - 0.5)
        damping = -2.0 * (math.pi * sigma / repeat) ** 2
        weight = 1.0
        if damping > -40.0:
            for k in range(1, _HARMONICS + 1):
                weight += 2.0 * math.exp(damping * k * k) * math.cos(k * offset)
        return _wrap(centre + (number - 0.5) * repeat, repeat), max(weight, 0.0)
    side = BOX_SIDE * sigma
    if side < repeat:
        return _wrap(centre + (number - 0.5) * side, repeat), 1.0
    # So many whole repeats everywhere, and one more within what is left around the centre (or its opposite).
    whole = math.floor(side / repeat)
    rest = side / repeat - whole
    distance = abs(number - 0.5) * 2.0
    odd = whole % 2.0 == 1.0
    near = distance > 1.0 - rest if odd else distance < rest
    return _wrap(centre + (number - 0.5) * repeat, repeat), (whole + (1.0 if near else 0.0)) * repeat / side


_EVEN = 1.0  # in repeats: both axes of a Gaussian this wide cover the repeat evenly, to 4e-16


@inlined_kernel
def place_pair(
    shape: int,
    u: float,
    v: float,
    sigma: float,
    sigma_minor: float,
    angle: float,
    ends: float,
    picks: float,
    first: float,
    second: float,
) -> tuple[float, float, float]:
    """Return the point of the repeat that two numbers in (0, 1) name, and its weight (mean 1).

    Parameters
    ----------
    shape : int
        GAUSSIAN or BOX.
    u, v : float
        Centre.
    sigma, sigma_minor : float
        Standard deviations along the two axes.
    angle : float
        Angle from x to the first axis, radians.
    ends, picks : float
        The repeat.
    first, second : float
        Where in the distribution.
    """
    if angle == 0.0 or (shape == GAUSSIAN and sigma == sigma_minor):
        x, weight_x = place(shape, u, sigma, ends, first)
        y, weight_y = place(shape, v, sigma_minor, picks, second)
        return x, y, weight_x * weight_y
    if shape == GAUSSIAN:
        if min(sigma, sigma_minor) >= _EVEN * max(ends, picks):
            return _wrap(u + first * ends, ends), _wrap(v + second * picks, picks), 1.0
        a, b = sigma * normal_quantile(first), sigma_minor * normal_quantile(second)
    else:
        a, b = BOX_SIDE * sigma * (first - 0.5), BOX_SIDE * sigma_minor * (second - 0.5)
    cosine, sine = math.cos(angle), math.sin(angle)
    return _wrap(u + a * cosine - b * sine, ends), _wrap(v + a * sine + b * cosine, picks), 1.0


_SPREAD_OUT = 0.8  # in repeats: an axis of a Gaussian this wide covers the repeat evenly, to 6e-6
_REACH = 5.5  # in standard deviations; what lies beyond is 4e-8


@kernel
def interval_masses(
    shape: int,
    centre: float,
    sigma: float,
    repeat: float,
    edges: npt.NDArray[np.float32],
    cell: float,
    masses: npt.NDArray[np.float32],
) -> bool:
    """Write the share of a footprint's axis in each interval between neighbouring edges; say whether any has one.

    Parameters
    ----------
    shape, centre, sigma, repeat
        As in `place`.
    edges : float32 (n + 1,)
        Rising positions in their cell, in [0, 1].
    cell : float
        Where the cell begins.
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


_NORMAL = tuple(np.float32(c) for c in (0.2316419, 0.319381530, -0.356563782, 1.781477937, -1.821255978, 1.330274429))
_ROOT = np.float32(1.0 / math.sqrt(2.0 * math.pi))


@fast_kernel
def normal_distribution(x: np.float32) -> np.float32:
    """Return the mass of the standard normal distribution below x, to 2e-7 [Abramowitz1964Handbook, 26.2.17]."""
    size = abs(x)
    t = np.float32(1.0) / (np.float32(1.0) + _NORMAL[0] * size)
    series = t * (_NORMAL[1] + t * (_NORMAL[2] + t * (_NORMAL[3] + t * (_NORMAL[4] + t * _NORMAL[5]))))
    tail = _ROOT * remaining(np.float32(0.5) * size * size) * series
    return tail if x < np.float32(0.0) else np.float32(1.0) - tail


@fast_kernel
def _add_gaussian(
    edges: npt.NDArray[np.float32], middle: np.float32, inverse: np.float32, masses: npt.NDArray[np.float32]
) -> None:
    for k in range(len(masses)):
        below = normal_distribution((edges[k] - middle) * inverse)
        masses[k] += normal_distribution((edges[k + 1] - middle) * inverse) - below


@fast_kernel
def _add_box(
    edges: npt.NDArray[np.float32],
    middle: np.float32,
    reach: np.float32,
    inverse: np.float32,
    masses: npt.NDArray[np.float32],
) -> None:
    for k in range(len(masses)):
        low = min(max(edges[k] - middle, -reach), reach)
        high = min(max(edges[k + 1] - middle, -reach), reach)
        masses[k] += (high - low) * inverse
