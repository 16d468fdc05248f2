"""Widths, bends and reliefs of a draft from the light that goes straight through its gaps.

Differential evolution [Storn1997Differential] over six numbers: the logarithm of the openness, the part of it that is
the warps', two bends, the logarithms of two reliefs. The interval of a number is a profile: everything that searches
tried whose squared error exceeds the least by no more than noise explains (3.84 variances of a patch over the number
of patches, 95 %). The noise is what the best fit leaves, at least that of measurements.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np
from scipy.optimize import differential_evolution

from pipeline.bsdf.klems import Basis, Scattering
from pipeline.compiled.arrays import Float64, Index, Mask
from pipeline.fitting.fitted import Interval, cloth
from pipeline.fitting.straight import gap_rays, straight_share
from weaves.fabric import Fabric

STRAIGHT_NOISE: Final = 0.067
"""Error of measured light straight through, RMS over the mean: front against back of one shade."""

LEAST_STRAIGHT: Final = 1e-4
"""Share of light that goes straight through a cloth with gaps, at least."""

SEARCHES: Final = 4
"""Searches for a geometry: what one has tried does not tell how far other geometries fit as well."""

_RAYS = 256  # of a patch
_GENERATIONS, _MEMBERS = 45, 7  # members for each number
_SPREAD = 0.8, 1.6  # of the openness, over the largest share that goes straight through
_BOUNDS = [(0.1, 0.9), (0.0, 60.0), (0.0, 60.0), (math.log(0.05), math.log(2.0)), (math.log(0.05), math.log(2.0))]


class Straight(NamedTuple):
    """Light straight through of Q patches, the mean of faces and mirror images, and how many of these there are."""

    patches: Index
    share: Float64
    weight: Float64

    def error(self, share: Float64) -> float:
        """Return the error of other shares, RMS over the mean."""
        squares = np.average((share - self.share) ** 2, weights=self.weight)
        return float(np.sqrt(squares) / np.average(self.share, weights=self.weight))


class Geometry(NamedTuple):
    """The cloth that was found, its error, and all that was tried: numbers (M, 6), errors (M,)."""

    fabric: Fabric
    error: float
    tried: Float64
    errors: Float64


def images(basis: Basis, patch: int) -> list[int]:
    """Return the mirror images of a patch, itself among them."""
    count, turn = basis.counts[basis.ring[patch]], int(basis.number[patch])
    first = patch - turn
    return sorted({first + (sign * turn + half) % count for sign in (1, -1) for half in (0, count // 2)})


def straight_of(scattering: Scattering, band: str, lights: Mask) -> Straight:
    """Return the light straight through of those `lights` (P,) that are known, in the first quarter of azimuths."""
    basis, direct = scattering.basis, scattering.direct(band)
    quarter = [patch for patch in range(basis.patches) if images(basis, patch)[0] == patch]
    rows = []
    for patch in quarter:
        same = [image for image in images(basis, patch) if lights[image]]
        known = direct[:, same][np.isfinite(direct[:, same])]
        if known.size:
            rows.append((patch, known.mean(), len(same)))
    patches, share, weight = np.array(rows, float).reshape(-1, 3).T
    return Straight(patches.astype(int), share, weight)


def fit_geometry(basis: Basis, straight: Straight, draft: str, searches: int = SEARCHES) -> Geometry:
    """Return the geometry of a draft with the least error that some searches find."""
    rays, top = gap_rays(basis, straight.patches, _RAYS), float(straight.share.max())
    tried: list[Float64] = []
    errors: list[float] = []

    def error(numbers: Float64) -> float:
        tried.append(numbers.copy())
        errors.append(straight.error(straight_share(_cloth(draft, numbers), rays, len(straight.patches))))
        return errors[-1]

    openness = math.log(_SPREAD[0] * top), math.log(min(_SPREAD[1] * top, 0.9))
    for seed in range(searches):
        differential_evolution(
            error, [openness, *_BOUNDS], maxiter=_GENERATIONS, popsize=_MEMBERS, tol=1e-3, rng=seed, polish=False
        )
    best = int(np.argmin(errors))
    return Geometry(_cloth(draft, tried[best]), errors[best], np.array(tried), np.array(errors))


def _cloth(draft: str, numbers: Float64) -> Fabric:
    _, warp, weft, *rest = _columns(numbers[None])[:, 0]
    return cloth(draft, (warp, weft), rest[:2], rest[2:])


def _columns(numbers: Float64) -> Float64:
    """Return openness, widths, bends and reliefs, (7, M), of the numbers of a search, (M, 6)."""
    openness, part = np.exp(numbers[:, 0]), numbers[:, 1]
    widths = 1.0 - openness**part, 1.0 - openness ** (1.0 - part)
    return np.stack([openness, *widths, *numbers[:, 2:4].T, *np.exp(numbers[:, 4:]).T])


def geometry_numbers(geometry: Geometry, patches: int) -> dict[str, Interval]:
    """Return the numbers of a cloth that was fitted to so many patches, with intervals."""
    least = geometry.error**2
    noise = max(least * patches / max(patches - geometry.tried.shape[1], 1), STRAIGHT_NOISE**2)
    good = _columns(geometry.tried[geometry.errors**2 <= least + 3.84 * noise / patches])
    best = _columns(geometry.tried[[geometry.errors.argmin()]])[:, 0]
    keys = ("openness", *(f"{yarn}.{name}" for name in ("width", "bend", "relief") for yarn in ("warp", "weft")))
    return {
        key: Interval(float(value), float(tried.min()), float(tried.max()))
        for key, value, tried in zip(keys, best, good, strict=True)
    }
