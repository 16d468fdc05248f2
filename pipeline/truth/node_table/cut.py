"""A row through a node, cut where a point of the cloth goes out of the viewer's sight or out of the light.

`PLACES` evenly spaced places share a random offset, so that their mean is right on average for any border. Bisection
finds the border between two places that differ; what lies between two that agree is taken to agree, after one test in
the middle of the row. Within a part that is seen or lit as a whole the point model is smooth and needs one place or
two.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np

from pipeline.compiled.arrays import Float64, Index
from pipeline.compiled.decorators import inlined_kernel, kernel
from pipeline.truth.cloth import AREA_SUM, POINT_SUMS, ClothSide
from pipeline.truth.geometry.heightfield import GAP, UNDER, surface_at
from pipeline.truth.geometry.visibility import visible
from pipeline.truth.scattering.point import Choices, Directions, lit_from_behind, point_share

PLACES: Final = 8
"""Places of a row: a border is found to an eighth of a node."""

_HIDDEN, _SEEN, _LIT = 0, 1, 2
_LONG = 2  # more places than this need two points of Gauss's rule
_GAUSS = 1.0 / math.sqrt(3.0)
_SMOOTH = Choices(False, False)


class Known(NamedTuple):
    """Knowledge of a node that the table already has."""

    seen: bool
    lit: bool
    """True if the viewer, and the light, clear the horizon all around."""
    every: bool
    """True if the point model must be evaluated at every place: a highlight is narrower than the node."""


class Row(NamedTuple):
    """A row of places through a node."""

    x: float
    y: float
    dx: float
    dy: float
    """Where it starts, in the repeat, and how far it leads."""
    offset: float
    """Place of the first place within its eighth, 0 <= offset < 1."""
    weight: float
    tilt: float
    """Share of the footprint, and its relative change from the start to the end."""


class RowRoom(NamedTuple):
    """Room for a row."""

    states: Index
    """State of each place: hidden, seen, or seen and lit, (PLACES,)."""
    parts: Index
    """First and last place of parts not yet decided, (2 PLACES, 2)."""
    value: Float64
    """The row's sums, (POINT_SUMS,)."""


def row_room() -> RowRoom:
    """Return room for a row."""
    return RowRoom(np.zeros(PLACES, np.int64), np.zeros((2 * PLACES, 2), np.int64), np.zeros(POINT_SUMS))


@kernel
def add_row(cloth: ClothSide, directions: Directions, row: Row, known: Known, room: RowRoom) -> int:
    """Write the sums of a row, without the transparency, to `room.value`; return the number of places tested.

    Shadows are on, the cloth is flat, and cosines go to the ply normal.
    """
    tested = _find_states(cloth, directions, row, known, room)
    states, value = room.states, room.value
    value[:] = 0.0
    first = 0
    while first < PLACES:
        stop = first + 1
        while not known.every and stop < PLACES and states[stop] == states[first]:
            stop += 1
        if states[first] != _HIDDEN:
            points = 2 if stop - first > _LONG else 1
            for point in range(points):
                away = (point - 0.5) * _GAUSS * (stop - first) if points == 2 else 0.0
                along = (0.5 * (first + stop - 1) + away + row.offset) / PLACES
                share = row.weight * (stop - first) / (PLACES * points)
                share *= max(1.0 + row.tilt * (along - 0.5), 0.0)
                x, y = row.x + along * row.dx, row.y + along * row.dy
                family, area, specular, diffuse, _ = point_share(cloth.front, cloth.back, x, y, directions, _SMOOTH)
                if family != GAP and states[first] == _LIT:
                    value[family] += share * specular
                    value[2 + family] += share * diffuse
                value[AREA_SUM] += share * (directions.viewer.z if cloth.projected else area)
        first = stop
    return tested


@kernel
def _find_states(cloth: ClothSide, directions: Directions, row: Row, known: Known, room: RowRoom) -> int:
    """Write the state of each place; return how many were tested."""
    states, parts = room.states, room.parts
    for place in (0, PLACES - 1):
        states[place] = _state(cloth, directions, row, place, known)
    tested, open_parts = 2, 1
    parts[0, 0], parts[0, 1] = 0, PLACES - 1
    while open_parts > 0:
        open_parts -= 1
        low, high = parts[open_parts, 0], parts[open_parts, 1]
        if high - low <= 1:
            continue
        if states[low] == states[high] and high - low < PLACES - 1:
            for place in range(low + 1, high):
                states[place] = states[low]
            continue
        middle = (low + high) // 2
        states[middle] = _state(cloth, directions, row, middle, known)
        tested += 1
        parts[open_parts, 0], parts[open_parts, 1] = low, middle
        parts[open_parts + 1, 0], parts[open_parts + 1, 1] = middle, high
        open_parts += 2
    return tested


@inlined_kernel
def _state(cloth: ClothSide, directions: Directions, row: Row, place: int, known: Known) -> int:
    """Return whether a place is hidden, seen, or seen and lit; a gap that is seen counts as lit."""
    along = (place + row.offset) / PLACES
    x, y = row.x + along * row.dx, row.y + along * row.dy
    front, light, viewer = cloth.front, directions.light, directions.viewer
    family, side, z, nx, ny, nz, _, _, _ = surface_at(front, x, y, int(x), int(y))
    if family == GAP:
        through = visible(front, x, y, 0.0, UNDER, viewer) and visible(
            cloth.back, x, y, 0.0, UNDER, directions.viewer_behind
        )
        return _LIT if through else _HIDDEN
    if viewer.x * nx + viewer.y * ny + viewer.z * nz <= 0.0:
        return _HIDDEN
    if not known.seen and not visible(front, x, y, z, side, viewer):
        return _HIDDEN
    cos_i = light.x * nx + light.y * ny + light.z * nz
    if light.z > 0.0:
        return _LIT if cos_i > 0.0 and (known.lit or visible(front, x, y, z, side, light)) else _SEEN
    behind = cos_i < 0.0 and lit_from_behind(cloth.back, x, y, directions.light_behind, cloth.choices)
    return _LIT if behind else _SEEN
