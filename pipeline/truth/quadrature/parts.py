"""Rectangles of a fabric on which its surface is smooth, and their parts that a footprint reaches.

Floats on top, strips of the yarn beneath where the one on top is narrow, and gaps cover one repeat once. Footprints are
folded: a position represents all its images. A kernel that is narrow against a rectangle cuts it further, so that a
rule of few nodes resolves it.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np

from pipeline.compiled.arrays import Float64, Mask
from pipeline.compiled.decorators import allocating_kernel, kernel
from pipeline.truth.footprint.place import BOX_SIDE, GAUSSIAN
from pipeline.truth.geometry.heightfield import (
    ALPHA,
    BEND,
    BEND_RADIUS,
    GAP,
    HALF_LENGTH,
    OFFSET,
    RADIUS,
    TOP,
    UNDER,
    WARP,
    WEFT,
    HeightField,
)

_REACH: Final = 5.5
_RESOLVED: Final = 3.0  # widest part in standard deviations: 8 nodes give its mass to 1e-7

# Columns of a part: limits across (the angle v; at gaps x) and along, whose yarn, its middle and half width, the box's
# weight, the larger of the angles that the surface turns by across and along, over the roughness, and its share of the
# footprint, which is 1 for all parts together.
A0, A1, B0, B1, KIND, MIDDLE, HALF, BOX_WEIGHT, TURN, MASS = range(10)
PART: Final = 10


class Axis(NamedTuple):
    """A footprint along x or y: kernel, centre, standard deviation, and the repeat it is folded into."""

    shape: int
    centre: float
    sigma: float
    repeat: float


@allocating_kernel
def rectangles(field: HeightField, wanted_cells: Mask) -> Float64:
    """Return the rectangles on which the fabric is smooth, (P, 6), that begin in the cells wanted.

    Columns: x from, x to, y from, y to, WARP, WEFT or GAP, and the yarn's turn for each unit along it, in radians.
    Together they cover one repeat once, up to whole repeats: x and y lie in [0, 2 ends] and [0, 2 picks].
    """
    picks, ends = field.top.shape
    found = np.zeros((4 * picks * ends, 6))
    count = 0
    for pick in range(picks):
        for end in range(ends):
            if not wanted_cells[pick, end]:
                continue
            for side in (TOP, UNDER):
                family = int(field.top[pick, end]) if side == TOP else 1 - int(field.top[pick, end])
                radius, margin = field.yarn[family, RADIUS], 0.5 - field.yarn[1 - family, RADIUS]
                half, offset = field.floats[pick, end, side, HALF_LENGTH], field.floats[pick, end, side, OFFSET]
                middle = (end if family == WARP else pick) + 0.5
                cell = float(pick if family == WARP else end)
                # A yarn that never changes side has floats without end: it is cut at the cells.
                first = half == math.inf or offset < 0.75 - half
                last = half == math.inf or offset > half - 0.75
                for strip in range(2):
                    if side == TOP:
                        low, high = cell, cell + (1.0 if half == math.inf else 2.0 * half)
                        wanted = first and strip == 0
                    elif strip == 0:
                        low, high = cell, cell + margin
                        wanted = first and margin > 0.0
                    else:
                        low, high = cell + 1.0 - margin, cell + 1.0 + (0.0 if last else margin)
                        wanted = margin > 0.0
                    if wanted:
                        at = 0 if family == WARP else 2
                        found[count, at], found[count, at + 1] = middle - radius, middle + radius
                        found[count, 2 - at], found[count, 3 - at] = low, high
                        found[count, 4] = family
                        if field.floats[pick, end, side, BEND_RADIUS] > 0.0:
                            found[count, 5] = field.yarn[family, BEND] / half
                        count += 1
            width, height = 0.5 - field.yarn[WARP, RADIUS], 0.5 - field.yarn[WEFT, RADIUS]
            if width > 0.0 and height > 0.0:
                found[count, 0], found[count, 1] = end + 1.0 - width, end + 1.0 + width
                found[count, 2], found[count, 3] = pick + 1.0 - height, pick + 1.0 + height
                found[count, 4] = GAP
                count += 1
    return found[:count]


@kernel
def density(axis: Axis, x: float) -> float:
    """Return the folded Gaussian at x, of mass 1 a repeat; 1 for a box, whose parts carry their weight."""
    if axis.shape != GAUSSIAN:
        return 1.0
    away = (x - axis.centre) / axis.repeat
    away -= math.floor(away + 0.5)
    share = axis.sigma / axis.repeat
    total = 0.0
    if share < 0.3:
        for image in range(-2, 3):
            distance = (away + image) / share
            total += math.exp(-0.5 * distance * distance)
        return total / (math.sqrt(2.0 * math.pi) * axis.sigma)
    for k in range(1, 4):
        total += math.exp(-2.0 * (math.pi * share * k) ** 2) * math.cos(2.0 * math.pi * k * away)
    return max(1.0 + 2.0 * total, 0.0) / axis.repeat


@kernel
def _mass(axis: Axis, low: float, high: float) -> float:
    """Return the integral of `density` over a resolved interval, by Simpson's rule: 4 % at worst."""
    middle = 0.5 * (low + high)
    return (high - low) / 6.0 * (density(axis, low) + 4.0 * density(axis, middle) + density(axis, high))


@kernel
def _cut(axis: Axis, low: float, high: float, pieces: Float64) -> int:
    """Write the pieces of [low, high] that the footprint reaches, (from, to, weight); return their number."""
    count = 0
    if axis.shape == GAUSSIAN:
        reach = _REACH * axis.sigma
        # From half a repeat on, images meet: the folded kernel is taken everywhere.
        everywhere = reach >= 0.5 * axis.repeat
        first = 0.0 if everywhere else math.ceil((low - axis.centre - reach) / axis.repeat)
        last = 0.0 if everywhere else math.floor((high - axis.centre + reach) / axis.repeat)
        image = first
        while image <= last:
            middle = axis.centre + image * axis.repeat
            start = low if everywhere else max(low, middle - reach)
            stop = high if everywhere else min(high, middle + reach)
            number = math.ceil((stop - start) / (_RESOLVED * axis.sigma))
            for k in range(number):
                pieces[count, 0] = start + (stop - start) * k / number
                pieces[count, 1] = start + (stop - start) * (k + 1) / number
                pieces[count, 2] = 1.0
                count += 1
            image += 1.0
        return count
    # So many whole repeats everywhere, and one more around the centre, or opposite it.
    side = BOX_SIDE * axis.sigma
    whole = float(math.floor(side / axis.repeat))
    reach = 0.5 * (side - whole * axis.repeat)
    centre = axis.centre + (0.5 * axis.repeat if whole % 2.0 == 1.0 else 0.0)
    image = float(math.ceil((low - centre - reach) / axis.repeat))
    last = math.floor((high - centre + reach) / axis.repeat)
    cursor = low
    while True:
        middle = centre + image * axis.repeat
        start = min(max(middle - reach, low), high) if image <= last else high
        stop = min(max(middle + reach, low), high) if image <= last else high
        for begin, finish, weight in ((cursor, start, whole), (start, stop, whole + 1.0)):
            if weight > 0.0 and finish > begin:
                pieces[count, 0], pieces[count, 1], pieces[count, 2] = begin, finish, weight / side
                count += 1
        cursor = stop
        if image > last:
            return count
        image += 1.0


@kernel
def cut_parts(
    rectangle: Float64, yarn: Float64, x_axis: Axis, y_axis: Axis, x_pieces: Float64, y_pieces: Float64, parts: Float64
) -> int:
    """Write the parts of a rectangle that the footprint reaches if `parts` has rows; return their number."""
    across_x = rectangle[4] != WEFT
    if across_x:
        columns = _cut(x_axis, rectangle[0], rectangle[1], x_pieces)
        rows = _cut(y_axis, rectangle[2], rectangle[3], y_pieces) if columns > 0 else 0
        low, high, across, along = rectangle[0], rectangle[1], x_pieces, y_pieces
    else:
        columns = _cut(y_axis, rectangle[2], rectangle[3], x_pieces)
        rows = _cut(x_axis, rectangle[0], rectangle[1], y_pieces) if columns > 0 else 0
        low, high, across, along = rectangle[2], rectangle[3], x_pieces, y_pieces
    if len(parts) > 0:
        middle, half = 0.5 * (low + high), 0.5 * (high - low)
        for k in range(columns):
            from_, to = across[k, 0], across[k, 1]
            if rectangle[4] != GAP:
                from_ = math.asin(min(max((from_ - middle) / half, -1.0), 1.0))
                to = math.asin(min(max((to - middle) / half, -1.0), 1.0))
            for n in range(rows):
                part = parts[k * rows + n]
                part[A0], part[A1], part[B0], part[B1] = from_, to, along[n, 0], along[n, 1]
                part[KIND], part[MIDDLE], part[HALF] = rectangle[4], middle, half
                part[BOX_WEIGHT] = across[k, 2] * along[n, 2]
                x, y = (along[n], across[k]) if rectangle[4] == WEFT else (across[k], along[n])
                part[MASS] = part[BOX_WEIGHT] * _mass(x_axis, x[0], x[1]) * _mass(y_axis, y[0], y[1])
                if rectangle[4] != GAP:
                    turn = max(to - from_, rectangle[5] * (along[n, 1] - along[n, 0]))
                    part[TURN] = turn / yarn[int(rectangle[4]), ALPHA]
    return columns * rows
