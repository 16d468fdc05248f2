"""Parts of a repeat: the rectangles of a cell that have one surface, their mean height, and the cells that differ.

A cell shows its top yarn; if that yarn is narrow, also the yarn beneath on either side, and gaps in the corners. A
satin of 8 ends has 64 cells a repeat, of which 8 differ: cells that a translation carries into one another form an
orbit, and their pieces, horizons and nodes are those of one of them.
"""

import math
from functools import lru_cache
from typing import Final, NamedTuple

import numpy as np

import weaves.draft
from pipeline.compiled.arrays import Float64, Index, Mask
from pipeline.compiled.decorators import kernel
from pipeline.truth.geometry import heightfield
from pipeline.truth.geometry.heightfield import GAP, OFFSET, RADIUS, TOP, UNDER, WARP, HeightField

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(24)
_NONE: Final = 1e-6  # width of margins, in yarn spacings, that are not there
_STEEPEST: Final = 0.999  # largest sine of an inclination

Extent = tuple[float, float]


class CellPiece(NamedTuple):
    """A rectangle of a cell with one surface; x runs across a warp and along a weft, and across a gap."""

    family: int
    side: int
    """WARP, WEFT or GAP; TOP or UNDER."""
    across: Extent
    along: Extent
    """Extent within the cell."""
    radius: float  # radius of its yarn; 0 for a gap
    offset: float
    curve: float
    half: float
    """Of its float (`HeightField.floats`): middle of the cell along the yarn, 1 / bend radius, half length, which is
    infinite for a yarn that never changes side."""

    @property
    def sign(self) -> float:
        """1 on top; -1 beneath, where the bend is reversed."""
        return 1.0 if self.side == TOP else -1.0

    @property
    def steepest(self) -> float:
        """Largest sine of the inclination along the yarn; beneath, the arc ends with the float."""
        return min(self.half * self.curve, _STEEPEST) if self.side == UNDER and self.curve else _STEEPEST

    @property
    def box(self) -> tuple[Extent, Extent]:
        """Extent in x and y."""
        return (self.across, self.along) if self.family in (WARP, GAP) else (self.along, self.across)

    @property
    def radii(self) -> tuple[float, float]:
        """The radius for the axis that runs across a yarn, 0 for the other; x and y."""
        return (self.radius, 0.0) if self.family in (WARP, GAP) else (0.0, self.radius)


def cell_pieces(field: HeightField, pick: int, end: int) -> list[CellPiece]:
    """Return everything seen from above in a cell: the yarn on top, the one beneath, low side first, then gaps."""
    top = int(field.top[pick, end])
    beneath = 1 - top
    radius, radius_beneath = float(field.yarn[top, RADIUS]), float(field.yarn[beneath, RADIUS])

    def on_yarn(family: int, side: int, radius: float, along: Extent) -> CellPiece:
        offset, bend, half, _ = field.floats[pick, end, side].tolist()
        across, curve = (0.5 - radius, 0.5 + radius), 1.0 / bend if bend else 0.0
        return CellPiece(family, side, across, along, radius, offset, curve, half)

    found = [on_yarn(top, TOP, radius, (0.0, 1.0))]
    found += [on_yarn(beneath, UNDER, radius_beneath, margin) for margin in _margins(radius)]
    for margin in _margins(radius):
        for gap in _margins(radius_beneath):
            x, y = (margin, gap) if top == WARP else (gap, margin)
            found.append(CellPiece(GAP, UNDER, x, y, 0.0, 0.0, 0.0, 0.5))
    return found


def _margins(radius: float) -> list[Extent]:
    """Return the extents on both sides of a yarn that it does not cover."""
    width = 0.5 - radius
    return [(0.0, width), (1.0 - width, 1.0)] if width > _NONE else []


Cell = tuple[int, int]  # a cell of the repeat, (pick, end)


def translations(field: HeightField) -> tuple[Cell, ...]:
    """Return the shifts by picks and ends that map the cloth onto itself; (0, 0) is the first."""
    return _translations(field.top.shape, field.top.tobytes())


@lru_cache(maxsize=256)
def _translations(shape: Cell, top: bytes) -> tuple[Cell, ...]:
    """Return the shifts of `HeightField.top`: which yarn is on top says where every float begins and ends."""
    shifts = weaves.draft.translations(np.frombuffer(top, np.int8).reshape(shape) == WARP)
    return tuple((pick, end) for pick, end in shifts.tolist())


def orbits(field: HeightField) -> list[list[Cell]]:
    """Return the cells of the repeat in orbits, each orbit from its first cell on."""
    cells = (leaders(field)[:, None] + np.array(translations(field))) % field.top.shape
    return [[(pick, end) for pick, end in orbit] for orbit in cells.tolist()]


def leaders(field: HeightField) -> Index:
    """Return the first cell of each orbit, (n, 2)."""
    length, height, _ = lattice(field)
    return np.stack(np.divmod(np.arange(height * length), length), axis=-1)


def different_cells(field: HeightField) -> int:
    """Return the number of orbits."""
    return field.top.size // len(translations(field))


def first_cells(field: HeightField) -> Mask:
    """Return for each cell, (picks, ends), whether it is the first of its orbit."""
    first = np.zeros(field.top.shape, np.bool_)
    first[tuple(leaders(field).T)] = True
    return first


def lattice(field: HeightField) -> tuple[int, int, int]:
    """Return the translations as those of rectangles in rows: length and height of one, and a row's shift to the next.

    In ends and picks: the cloth at (x, y) is that at (x + length, y) and that at (x + shift, y + height).
    """
    picks, ends = field.top.shape
    shifts = translations(field)
    length = min([e for p, e in shifts if p == 0 and e > 0], default=ends)
    height, shift = min([(p, e % length) for p, e in shifts if p > 0], default=(picks, 0))
    return length, height, shift


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


def reference_plane(field: HeightField) -> float:
    """Return the height of the reference plane, the mean height of what is seen from straight above, without gaps.

    A view ray belongs to the point at which it crosses this plane. The height is in yarn spacings above the axes of the
    yarns at the ends of floats; Gauss-Legendre along a yarn, and across it in the angle v, x = r sin v.
    """
    height, area = _sums(field, _NODES, _WEIGHTS)
    return float(height / area)


@kernel
def _sums(field: HeightField, nodes: Float64, weights: Float64) -> tuple[float, float]:
    """Return the integrals of the height and of 1 over everything that is seen from straight above."""
    height, area = 0.0, 0.0
    picks, ends = field.top.shape
    for pick in range(picks):
        for end in range(ends):
            top = int(field.top[pick, end])
            radius = field.yarn[top, RADIUS]
            for side, low, high in ((TOP, -0.5, 0.5), (UNDER, -0.5, -radius), (UNDER, radius, 0.5)):
                if low < high:
                    family = top if side == TOP else 1 - top
                    h, a = _piece(field, family, side, pick, end, low, high, nodes, weights)
                    height, area = height + h, area + a
    return height, area


@kernel
def _piece(
    field: HeightField, family: int, side: int, pick: int, end: int, low: float, high: float, nodes: Float64,
    weights: Float64,
) -> tuple[float, float]:  # fmt: skip
    """Return the same for one piece, from `low` to `high` along its yarn, from the middle of the cell."""
    yarn, own = field.yarn[family], field.floats[pick, end, side]
    radius, middle, half = yarn[RADIUS], own[OFFSET] + 0.5 * (low + high), 0.5 * (high - low)
    height, area = 0.0, 0.0
    for i in range(len(nodes)):
        v = 0.5 * math.pi * nodes[i]
        share = 0.5 * math.pi * weights[i] * radius * math.cos(v) * half
        for k in range(len(nodes)):
            y = middle + half * nodes[k]
            h, _, _ = heightfield.float_height(yarn, own, side, radius * math.sin(v), y)
            height += share * weights[k] * h
            area += share * weights[k]
    return height, area
