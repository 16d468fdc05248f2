"""Symmetry of a cloth: the translations that map it onto itself, and the cells that remain different.

A satin of 8 ends has 64 cells a repeat, of which 8 differ. Cells that a translation carries into one another form an
orbit: their pieces, horizons and nodes are those of one of them.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from pipeline.compiled.arrays import Mask
from pipeline.truth.geometry.heightfield import HeightField

Cell = tuple[int, int]
"""A cell of the repeat, (pick, end)."""


def translations(field: HeightField) -> tuple[Cell, ...]:
    """Return the shifts by picks and ends that map the cloth onto itself; (0, 0) is the first."""
    return _translations(field.top.shape, field.top.tobytes(), field.floats.tobytes())


@lru_cache(maxsize=256)
def _translations(shape: Cell, top: bytes, floats: bytes) -> tuple[Cell, ...]:
    """Return the shifts; the bytes are those of `HeightField.top` and `HeightField.floats`."""
    cells = np.frombuffer(top, np.int8).reshape(shape)
    of_cells = np.frombuffer(floats, np.float64).reshape(*shape, -1)
    return tuple(
        shift
        for shift in np.ndindex(shape)
        if np.array_equal(np.roll(cells, shift, (0, 1)), cells)
        and np.array_equal(np.roll(of_cells, shift, (0, 1)), of_cells)
    )


def orbits(field: HeightField) -> list[list[Cell]]:
    """Return the cells of the repeat in orbits, each orbit from its first cell on."""
    picks, ends = field.top.shape
    shifts = translations(field)
    left = dict.fromkeys(np.ndindex(picks, ends))
    found = []
    while left:
        pick, end = next(iter(left))
        found.append([((pick + p) % picks, (end + e) % ends) for p, e in shifts])
        for cell in found[-1]:
            del left[cell]
    return found


def different_cells(field: HeightField) -> int:
    """Return the number of orbits."""
    return field.top.size // len(translations(field))


def first_cells(field: HeightField) -> Mask:
    """Return for each cell, (picks, ends), whether it is the first of its orbit."""
    first = np.zeros(field.top.shape, np.bool_)
    for orbit in orbits(field):
        first[orbit[0]] = True
    return first


def longest_period(field: HeightField) -> float:
    """Return the longest wavelength of a function with the cloth's translations, in yarn spacings."""
    picks, ends = field.top.shape
    shifts = translations(field)
    shortest = min(
        math.hypot(m / ends, n / picks)
        for m in range(ends + 1)
        for n in range(-picks, picks + 1)
        if (m or n) and all((m * e * picks + n * p * ends) % (ends * picks) == 0 for p, e in shifts)
    )
    return 1.0 / shortest
