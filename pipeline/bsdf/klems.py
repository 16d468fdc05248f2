"""Patches of directions after Klems, and the BSDF of a layer as matrices between them.

A direction is known by its label (x, y) in the plane, the layer's z through it. The label of light is where it goes to,
seen from above: (-x, -y) of the direction to its source. The label of what is scattered is (x, y) of its own direction.
So light that goes straight through keeps its label, and so does light that a mirror reflects. A patch lies between two
angles to the normal and two azimuths around its centre; a ring has patches of equal size, the first around azimuth 0.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final, NamedTuple

import numpy as np

from pipeline.compiled.arrays import Float64, Index
from weaves.errors import BadInput

SCATTERED: Final = ("reflection", "transmission")
FACES: Final = ("front", "back")  # faces of a layer; of a block, the face that the light meets

LARGEST_SUM: Final = 1.005  # largest reflectance and transmittance of a direction together that a layer may have


class Basis(NamedTuple):
    """Rings of patches."""

    name: str  # as in files
    bounds: tuple[float, ...]  # angles to the normal between the rings, degrees, from 0 to 90
    counts: tuple[int, ...]  # patches of each ring

    @property
    def patches(self) -> int:
        """Number of all patches."""
        return sum(self.counts)

    @property
    def ring(self) -> Index:
        """Ring of each patch, (P,)."""
        return np.repeat(np.arange(len(self.counts)), self.counts)

    @property
    def number(self) -> Index:
        """Number of each patch within its ring, (P,)."""
        return np.concatenate([np.arange(count) for count in self.counts])

    @property
    def projected_solid_angle(self) -> Float64:
        """Integral of the cosine over each patch, (P,), sr: pi (sin^2 high - sin^2 low) / count."""
        return np.asarray(np.pi * np.diff(np.sin(np.radians(self.bounds)) ** 2) / self.counts)[self.ring]

    @property
    def opposite(self) -> Index:
        """Patch of the label (-x, -y) of each patch, (P,): reciprocity exchanges light and viewer with it."""
        counts = np.array(self.counts)[self.ring]
        return np.asarray(np.arange(self.patches) - self.number + (self.number + counts // 2) % counts)

    @property
    def mirror(self) -> Index:
        """Patch of the label (-x, y) of each patch, (P,): azimuth a becomes 180 degrees - a."""
        counts = np.array(self.counts)[self.ring]
        return np.asarray(np.arange(self.patches) - self.number + (counts // 2 - self.number) % counts)

    @property
    def normal(self) -> int:
        """Patch of the normal, or one of those beside it."""
        return 0

    @property
    def of_lobes(self) -> Basis:
        """Basis in which files have light that goes straight through."""
        return self

    def means(self, shares: Float64) -> Float64:
        """Return means over patches of numbers in `of_lobes`, (P,)."""
        return shares

    def directions(self, patch: Index, u: Float64, v: Float64) -> Float64:
        """Return labels (N, 3), z > 0, of N points of patches: u, v in [0, 1) are even in projected solid angle."""
        square, counts = np.sin(np.radians(self.bounds)) ** 2, np.array(self.counts)
        ring = self.ring[patch]
        sine = np.sqrt(square[ring] + u * (square[ring + 1] - square[ring]))
        azimuth = 2.0 * np.pi * (self.number[patch] + v - 0.5) / counts[ring]
        z = np.sqrt(np.maximum(1.0 - sine * sine, 0.0))
        return np.stack([sine * np.cos(azimuth), sine * np.sin(azimuth), z], axis=-1)


BASES: Final = {
    basis.name: basis
    for basis in (
        Basis("LBNL/Klems Full", (0, 5, 15, 25, 35, 45, 55, 65, 75, 90), (1, 8, 16, 20, 24, 24, 24, 16, 12)),
        Basis("LBNL/Klems Half", (0, 6.5, 19.5, 32.5, 46.5, 61.5, 76.5, 90), (1, 8, 12, 16, 20, 12, 4)),
        Basis("LBNL/Klems Quarter", (0, 9, 27, 46, 66, 90), (1, 8, 12, 12, 8)),
    )
}
"""Bases by their names in files."""

KLEMS_FULL: Final = BASES["LBNL/Klems Full"]


class Scattering(NamedTuple):
    """The BSDF of a layer, in 1/sr and without the cosine, means over pairs of P patches."""

    basis: Basis  # patches of light and of what is scattered
    bands: Mapping[str, Float64]
    """By band, such as ``visible``: [kind, side, patch scattered to, patch of the light], in the order of `SCATTERED`
    and `FACES`; NaN where nothing is known, (2, 2, P, P)."""

    def hemispherical(self, band: str) -> Float64:
        """Return reflectance and transmittance of each face and patch of the light, (2, 2, P).

        Viewers of whom nothing is known count as the mean of the others; NaN if there are none.
        """
        known = np.einsum("ksoi,o->ksi", np.isfinite(self.bands[band]), self.basis.projected_solid_angle) / np.pi
        return np.asarray(np.divide(self._sums(band), known, out=np.full(known.shape, np.nan), where=known > 0.0))

    def _sums(self, band: str) -> Float64:
        """Return the same without the viewers of whom nothing is known."""
        return np.asarray(np.einsum("ksoi,o->ksi", np.nan_to_num(self.bands[band]), self.basis.projected_solid_angle))

    def mirrored(self) -> Scattering:
        """Return the layer with labels (-x, y) in place of (x, y)."""
        mirror = self.basis.mirror
        return Scattering(self.basis, {band: x[..., mirror[:, None], mirror] for band, x in self.bands.items()})

    def direct(self, band: str) -> Float64:
        """Return the share of light that keeps its patch in transmission, (2, P), what is scattered there included."""
        return np.asarray(np.diagonal(self.bands[band][1], axis1=1, axis2=2) * self.basis.projected_solid_angle)

    def reciprocity(self, band: str) -> Float64:
        """Return the mean difference of exchanged pairs over their mean, of reflection front, back and transmission."""
        blocks = self.bands[band]
        pairs = [(blocks[0, 0],) * 2, (blocks[0, 1],) * 2, (blocks[1, 0], blocks[1, 1])]
        return np.array([_asymmetry(block, exchanged(self.basis, other)) for block, other in pairs])

    def checked(self, where: str) -> Scattering:
        """Return the same; BadInput if a value is negative or a face sends on more light than arrives."""
        for band, blocks in self.bands.items():
            if (blocks < 0.0).any():
                raise BadInput(where, band, float(np.nanmin(blocks)), "values of a BSDF are at least 0")
            most = float(self._sums(band).sum(axis=0).max())
            if most > LARGEST_SUM:
                allowed = f"reflectance and transmittance of a direction are at most {LARGEST_SUM} together"
                raise BadInput(where, band, round(most, 4), allowed)
        return self


def exchanged(basis: Basis, block: Float64) -> Float64:
    """Return a block (P, P) with light and viewer exchanged.

    A reciprocal layer has the same in reflection, and in transmission the block of its other face.
    """
    turn = basis.opposite
    return np.asarray(block[np.ix_(turn, turn)].T)


def _asymmetry(block: Float64, other: Float64) -> float:
    known = np.isfinite(block) & np.isfinite(other)
    mean = 0.5 * float((block + other)[known].mean()) if known.any() else 0.0
    return float(np.abs(block - other)[known].mean()) / mean if mean > 0.0 else 0.0
