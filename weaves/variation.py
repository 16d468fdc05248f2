"""Variation: what makes woven cloth no exact lattice, over a patch of `PATCH` repeats that tiles.

A place (x, y) of the cloth, in mean yarn spacings, shows the place (u, v) of the lattice:

    u = F(x + a(y))      v = G(y + b(x))

a and b are slow waves, by which yarns lie askew. F takes the borders of the ends, whose spacings differ, to whole
numbers, and is linear between them, so that a yarn and its gaps are wide or narrow together. G does so for the picks.

Pictures show it (`pipeline.scenes.gbuffer`). Rows of truth, models and exports are those of the lattice.
"""

import math
from typing import Final

import numpy as np
import numpy.typing as npt
from pydantic import Field, StrictInt

from weaves.validation import Frozen

PATCH: Final = 64  # repeats along each side
SHADES: Final = 8  # of a colour, at most
_DARKEST = 3.0  # deviations of the darkest shade
_WAVES = 4  # waves, of lengths from that of the patch downwards
_NARROWEST = 0.4  # least spacing

Floats = npt.NDArray[np.float64]


class Variation(Frozen):
    """How much the yarns of a cloth differ.

    Examples
    --------
    >>> place, jacobian = Variation(spacing=0.1).lattice((2, 2), np.array([[0.0, 128.0]]))
    >>> place.tolist(), jacobian[0, 0, 0] > 0.0
    ([[0.0, 128.0]], True)
    """

    spacing: float = Field(default=0.0, ge=0, le=0.3)
    """Standard deviation of the spacings of yarns, in mean spacings."""
    skew: float = Field(default=0.0, ge=0, le=0.2)
    """Standard deviation of the slope of yarns to their mean direction."""
    colour: float = Field(default=0.0, ge=0, le=0.5)
    """How much darker threads are than the brightest: 1 - exp(-colour |g|), g normal."""
    seed: StrictInt = Field(default=0, ge=0, lt=2**32)

    def lattice(self, repeat: tuple[int, int], place: Floats) -> tuple[Floats, Floats]:
        """Return the places of the lattice that N places show, (N, 2), and d(lattice)/d(place), (N, 2, 2)."""
        shown, jacobian = place.astype(np.float64), np.tile(np.eye(2), (len(place), 1, 1))
        for axis, other in ((0, 1), (1, 0)):
            shift, jacobian[:, axis, other] = self._wave(axis, repeat[other], place[:, other])
            borders = self._borders(axis, repeat[axis])
            patch, inside = np.divmod(shown[:, axis] + shift, borders[-1])
            yarn = np.clip(np.searchsorted(borders, inside, "right") - 1, 0, len(borders) - 2)
            jacobian[:, axis] /= np.diff(borders)[yarn, None]
            shown[:, axis] = patch * borders[-1] + np.interp(inside, borders, np.arange(len(borders)))
        return shown, jacobian

    def shades(self, axis: int, count: int, levels: int) -> list[float]:
        """Return the brightness of neighbouring threads, 1 at most, of so many levels."""
        drawn = np.abs(self._random(axis, 2).standard_normal(count))
        level = np.floor(np.minimum(drawn / _DARKEST, 1.0 - 1e-9) * levels)
        return list(np.exp(-self.colour * _DARKEST / levels * level).tolist())

    def _random(self, *purpose: int) -> np.random.Generator:
        return np.random.default_rng([self.seed, *purpose])

    def _borders(self, axis: int, threads: int) -> Floats:
        """Return the borders of the yarns of a patch, from 0 to their number."""
        drawn = 1.0 + self.spacing * self._random(axis, 0).standard_normal(PATCH * threads)
        borders = np.concatenate([[0.0], np.cumsum(np.maximum(drawn, _NARROWEST))])
        return np.asarray(borders * (len(drawn) / borders[-1]))

    def _wave(self, axis: int, threads: int, along: Floats) -> tuple[Floats, Floats]:
        """Return the shift of yarns at N places along them, and its slope."""
        frequency = 2.0 * math.pi * np.arange(1, _WAVES + 1) / (PATCH * threads)
        turn = frequency * along[:, None] + self._random(axis, 1).uniform(0.0, 2.0 * math.pi, _WAVES)
        slope = self.skew * math.sqrt(2.0 / _WAVES)
        return (slope / frequency * np.sin(turn)).sum(axis=1), (slope * np.cos(turn)).sum(axis=1)
