"""A BSDF that a fabric or a formula predicts, held against a measured one."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from pipeline.bsdf.klems import Scattering
from pipeline.compiled.arrays import Float64, Mask
from pipeline.fitting.scattered import COLOURS, Scatterer, YarnOptics, pairs_of
from pipeline.fitting.straight import gap_rays, images, straight_of, straight_share
from weaves.fabric import Fabric

BRDF_ANGLE: Final = 65.0  # angle to the normal, degrees, up to which patches count in the error of a BSDF

_RAYS = 1024  # of a patch


class Errors(NamedTuple):
    """Errors: of light straight through, RMS over the mean; of reflectances, mean; of reflected light, RMS over it."""

    straight: float
    reflectance: float
    reflected: float


class Predicted(NamedTuple):
    """Light straight through of patches in the first quarter of azimuths, (P,), and BRDFs of both faces, (2, P, P).

    NaN stands where nothing is predicted.
    """

    straight: Float64
    reflected: Float64

    @classmethod
    def nothing(cls, patches: int) -> Predicted:
        """Return arrays of NaN."""
        return cls(np.full(patches, np.nan), np.full((2, patches, patches), np.nan))

    def joined(self, other: Predicted) -> Predicted:
        """Return these values, and those of another where there are none."""
        return Predicted(*(np.where(np.isfinite(a), a, b) for a, b in zip(self, other, strict=True)))

    def errors(self, scattering: Scattering, band: str) -> Errors:
        """Return the errors; NaN where nothing is predicted, or no light goes straight through."""
        basis, lights = scattering.basis, np.zeros(scattering.basis.patches, np.bool_)
        for patch in np.flatnonzero(np.isfinite(self.straight)):
            lights[images(basis, int(patch))] = True
        straight = straight_of(scattering, band, lights)
        passed = np.nan if straight.closed else straight.error(self.straight[straight.patches])
        measured = np.where(np.isfinite(self.reflected), scattering.bands[band][0], np.nan)
        predicted = np.where(np.isfinite(measured), self.reflected, np.nan)
        low = np.array(basis.bounds[1:])[basis.ring] <= BRDF_ANGLE
        low = np.isfinite(measured) & low[:, None] & low
        faces = [
            float(np.sqrt(np.mean((predicted - measured)[face][low[face]] ** 2)) / measured[face][low[face]].mean())
            for face in (0, 1)
            if low[face].any()
        ]
        size = basis.projected_solid_angle[:, None]
        ours, theirs = ((size * np.nan_to_num(part)).sum(axis=1) for part in (predicted, measured))
        seen = theirs > 0.0
        off = float(np.mean(np.abs(ours[seen] / theirs[seen] - 1.0))) if seen.any() else np.nan
        return Errors(passed, off, float(np.mean(faces)) if faces else np.nan)


def predict(fabric: Fabric, scattering: Scattering, band: str, lights: Mask) -> Predicted:
    """Return what a fabric of grey colours does with some lights (P,), where the BSDF is known."""
    predicted, patches = Predicted.nothing(scattering.basis.patches), straight_of(scattering, band, lights).patches
    if len(patches):
        predicted.straight[patches] = straight_share(fabric, gap_rays(scattering.basis, patches, _RAYS), len(patches))
    pairs = pairs_of(scattering, band, lights)
    pairs = pairs.take(np.flatnonzero(pairs.kind == 0))
    colours = np.array([getattr(y, f"{name}_rgb")[1] for name in COLOURS for y in (fabric.warp, fabric.weft)])
    optics = YarnOptics((fabric.warp.roughness, fabric.weft.roughness), fabric.warp.blend)
    values = Scatterer(fabric, scattering.basis, pairs).values(optics, colours)
    predicted.reflected[pairs.side, pairs.out, pairs.into] = values
    return predicted
