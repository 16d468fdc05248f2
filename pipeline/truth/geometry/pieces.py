"""Pieces: the rectangles of a cell as seen from above, each with one surface.

A cell shows its top yarn; if that yarn is narrow, also the yarn beneath on either side, and gaps in the corners.
"""

from __future__ import annotations

from typing import Final, NamedTuple

from pipeline.truth.geometry.heightfield import (
    BEND_RADIUS,
    GAP,
    HALF_LENGTH,
    OFFSET,
    RADIUS,
    TOP,
    UNDER,
    WARP,
    HeightField,
)

_NONE: Final = 1e-6  # width of margins, in yarn spacings, that are not there

Extent = tuple[float, float]


class Piece(NamedTuple):
    """A rectangle of a cell with one surface; x runs across a warp and along a weft, and across a gap.

    Attributes
    ----------
    family, side : int
        WARP, WEFT or GAP; TOP or UNDER.
    across, along : (low, high)
        Extent within the cell.
    radius : float
        Radius of its yarn; 0 for a gap.
    offset, curve, half : float
        Of its float (`HeightField.floats`): middle of the cell along the yarn, 1 / bend radius, half length, which is
        infinite for a yarn that never changes side.
    """

    family: int
    side: int
    across: Extent
    along: Extent
    radius: float
    offset: float
    curve: float
    half: float

    @property
    def sign(self) -> float:
        """1 on top; -1 beneath, where the bend is reversed."""
        return 1.0 if self.side == TOP else -1.0

    @property
    def steepest(self) -> float:
        """Largest sine of the inclination along the yarn; beneath, the arc ends with the float."""
        return self.half * self.curve if self.side == UNDER and self.curve else 1.0

    @property
    def box(self) -> tuple[Extent, Extent]:
        """Extent in x and y."""
        return (self.across, self.along) if self.family in (WARP, GAP) else (self.along, self.across)

    @property
    def radii(self) -> tuple[float, float]:
        """The radius for the axis that runs across a yarn, 0 for the other; x and y."""
        return (self.radius, 0.0) if self.family in (WARP, GAP) else (0.0, self.radius)


def cell_pieces(field: HeightField, pick: int, end: int) -> list[Piece]:
    """Return everything seen from above in a cell: the yarn on top, the one beneath, low side first, then gaps."""
    top = int(field.top[pick, end])
    beneath = 1 - top
    radius, radius_beneath = float(field.yarn[top, RADIUS]), float(field.yarn[beneath, RADIUS])

    def on_yarn(family: int, side: int, radius: float, along: Extent) -> Piece:
        own = field.floats[pick, end, side]
        bend = float(own[BEND_RADIUS])
        curve = 1.0 / bend if bend else 0.0
        across = (0.5 - radius, 0.5 + radius)
        return Piece(family, side, across, along, radius, float(own[OFFSET]), curve, float(own[HALF_LENGTH]))

    found = [on_yarn(top, TOP, radius, (0.0, 1.0))]
    found += [on_yarn(beneath, UNDER, radius_beneath, margin) for margin in _margins(radius)]
    for margin in _margins(radius):
        for gap in _margins(radius_beneath):
            x, y = (margin, gap) if top == WARP else (gap, margin)
            found.append(Piece(GAP, UNDER, x, y, 0.0, 0.0, 0.0, 0.5))
    return found


def _margins(radius: float) -> list[Extent]:
    """Return the extents on both sides of a yarn that it does not cover."""
    width = 0.5 - radius
    return [(0.0, width), (1.0 - width, 1.0)] if width > _NONE else []
