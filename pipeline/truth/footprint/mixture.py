"""Elliptic Gaussians at an angle to the yarns, as mixtures of Gaussians along them.

A Gaussian of deviations s_x, s_y and correlation r is the convolution of one along the axes, of deviations sqrt(1 -
|r|) s_x and sqrt(1 - |r|) s_y, with one on the line (sqrt(|r|) s_x, sign(r) sqrt(|r|) s_y) z, z normal. The mixture has
its components at even steps h along the line. For a wave exp(i w.x) its first alias is at most exp(-(2 pi / h)^2 (1 -
|r|) / (1 + |r|) / 2), so h is step sqrt((1 - |r|) / (1 + |r|)); for weak correlations two or three points of
Gauss-Hermite are enough. Where weights are products of two axes, an ellipse costs one product for each point of the
line, and its nodes are shaded once.

No wave differs by more than 2 % from that of the ellipse with a `COARSE_LINE`, which is for methods; by more than 1e-4
with a `FINE_LINE`, which is for the truth.
"""

import math
from typing import Final, NamedTuple

import numpy as np

from pipeline.compiled.arrays import Float32, Float64
from pipeline.compiled.decorators import allocating_kernel, kernel
from pipeline.truth.query import Queries


class Line(NamedTuple):
    """Positions of the points on the line."""

    step: float  # distance between points, in deviations of the line; for correlation r times sqrt((1 - r) / (1 + r))
    reach: float  # largest distance of the points from the centre, in deviations of the line
    three: float
    two: float
    """Largest correlations of three and of two points."""
    half: int  # most points on either side of the middle

    @property
    def points(self) -> int:
        """Most points."""
        return 2 * self.half + 1

    @property
    def most(self) -> float:
        """Largest correlation that the points resolve."""
        share = (self.reach / (self.half * self.step)) ** 2
        return (1.0 - share) / (1.0 + share)


COARSE_LINE: Final = Line(step=2.2, reach=2.4, three=0.28, two=0.15, half=16)
FINE_LINE: Final = Line(step=1.3, reach=4.2, three=0.0, two=0.0, half=64)

SMALLEST: Final = np.float32(1e-3)
"""Least deviation of a footprint: a thousandth of a yarn is a point. Smaller ones would fall between the digits of a
place."""

_LITTLE: Final = 0.02  # correlation that is none to a method
_STRONGEST: Final = COARSE_LINE.most
_WIDEST: Final = np.float32(1e4)  # yarn spacings: even along that axis, and places on the line still have digits


Footprints = tuple[Float32, Float32, Float32, Float32, Float32]
"""Centres in x and y, deviations along them, and their correlations, float32 (N,) each."""


def footprints(queries: Queries) -> Footprints:
    """Return the footprints of N queries for kernels.

    Axes count as `SMALLEST` yarn spacings at least and as 1e4 at most. Correlations are 0 or such as a `COARSE_LINE`
    resolves: an ellipse thinner than that is taken wider.
    """
    columns = queries.u, queries.v, queries.sigma, queries.sigma_minor, queries.angle
    u, v, *shape = (np.ascontiguousarray(column, np.float32) for column in columns)
    x, y, correlation = _shapes(*shape)
    return u, v, x, y, correlation


@allocating_kernel
def _shapes(major: Float32, minor: Float32, angle: Float32) -> Float32:
    """Return deviations along x and y and correlations of N footprints within all limits, (3, N)."""
    shapes = np.empty((3, len(major)), np.float32)
    for row in range(len(major)):
        longer, shorter = min(max(major[row], SMALLEST), _WIDEST), min(max(minor[row], SMALLEST), _WIDEST)
        x, y, correlation = along_axes(np.float64(longer), np.float64(shorter), np.float64(angle[row]))
        shapes[0, row], shapes[1, row] = x, y
        shapes[2, row] = 0.0 if abs(correlation) < _LITTLE else min(max(correlation, -_STRONGEST), _STRONGEST)
    return shapes


@allocating_kernel
def axes(major: Float64, minor: Float64, angle: Float64) -> Float64:
    """Return `along_axes` of N footprints, (3, N)."""
    along = np.empty((3, len(major)))
    for row in range(len(major)):
        along[0, row], along[1, row], along[2, row] = along_axes(major[row], minor[row], angle[row])
    return along


@kernel
def along_axes(major: float, minor: float, angle: float) -> tuple[float, float, float]:
    """Return a footprint's deviations along x and y and their correlation; `angle` is that of the major axis to x."""
    if major == minor:
        return major, minor, 0.0
    cosine, sine = math.cos(angle), math.sin(angle)
    first, second = major * major, minor * minor
    x = math.sqrt(first * cosine * cosine + second * sine * sine)
    y = math.sqrt(first * sine * sine + second * cosine * cosine)
    return x, y, (first - second) * sine * cosine / (x * y)


@kernel
def narrow_axis(deviation_x: float, deviation_y: float, correlation: float) -> float:
    """Return the deviation along the narrower of a footprint's own axes."""
    x, y = deviation_x * deviation_x, deviation_y * deviation_y
    spread = math.sqrt((0.5 * (x - y)) ** 2 + correlation * correlation * x * y)
    # The product of both axes' squares over the wider one's: no difference of nearly equal numbers.
    return math.sqrt((1.0 - correlation * correlation) * x * y / (0.5 * (x + y) + spread))


@kernel
def line_points(correlation: float, line: Line, places: Float32, shares: Float32) -> int:
    """Write the points of a line, in its deviations, and their shares, which add up to 1; return how many."""
    r = abs(correlation)
    if r == 0.0:
        places[0], shares[0] = 0.0, 1.0
        return 1
    if r <= line.two:
        places[0], places[1], shares[0], shares[1] = -1.0, 1.0, 0.5, 0.5
        return 2
    if r <= line.three:
        places[0], places[1], places[2] = -math.sqrt(3.0), 0.0, math.sqrt(3.0)
        shares[0], shares[1], shares[2] = 1.0 / 6.0, 2.0 / 3.0, 1.0 / 6.0
        return 3
    step = line.step * math.sqrt((1.0 - r) / (1.0 + r))
    half = min(math.ceil(line.reach / step), line.half)
    total = 0.0
    for k in range(2 * half + 1):
        z = (k - half) * step
        share = math.exp(-0.5 * z * z)
        places[k], shares[k] = z, share
        total += share
    for k in range(2 * half + 1):
        shares[k] /= total
    return 2 * half + 1
