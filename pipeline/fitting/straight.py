"""Light straight through the gaps of a cloth, exactly by its geometry, and the geometry that has measured light.

A ray passes if it crosses the fabric plane in a gap and neither face of the cloth hides that point from the direction
it comes from or goes to (pipeline.truth). No colour and no layer of fibres plays a part. The share of a patch is that
of its middle, where a goniophotometer's lamp stands, and the mean over places of all gaps. The places are a Sobol
sequence, the same for all cloths, so that shares change little where a cloth changes little. A cloth and its mirror
image count as one, because measurements of shades do: half of the rays are mirrored.

Widths, bends and reliefs of a draft are found by differential evolution [Storn1997Differential] over six numbers: the
logarithm of the openness, the part of it that is the warps', two bends, the logarithms of two reliefs. The interval of
a number is a profile: everything that searches tried whose squared error exceeds the least by no more than noise
explains (3.84 variances of a patch over the number of patches, 95 %). The noise is what the best fit leaves, at least
that of measurements.
"""

import math
from typing import Final, NamedTuple

import numpy as np
from scipy.optimize import differential_evolution
from scipy.stats import qmc

from pipeline.bsdf.klems import Basis, Scattering
from pipeline.compiled.arrays import Float64, Index, Mask
from pipeline.compiled.decorators import kernel
from pipeline.fitting.fitted import Interval, cloth
from pipeline.truth.geometry.heightfield import HeightField, height_field
from pipeline.truth.geometry.march import ray
from pipeline.truth.geometry.visibility import gap_clear
from weaves.fabric import Fabric

STRAIGHT_NOISE: Final = 0.067
"""Error of measured light straight through, RMS over the mean: front against back of one shade."""

SEARCHES: Final = 4  # searches for a geometry: what one has tried does not tell how far other geometries fit as well

_LEAST = 1e-4  # share of light that goes straight through a cloth with gaps
_RAYS = 256  # of a patch
_GENERATIONS, _MEMBERS = 45, 7  # members for each number
_SPREAD = 0.8, 1.6  # of the openness, over the largest share that goes straight through
_BOUNDS = [(0.1, 0.9), (0.0, 60.0), (0.0, 60.0), (math.log(0.05), math.log(2.0)), (math.log(0.05), math.log(2.0))]


class GapRays(NamedTuple):
    """Rays of Q patches, K each: directions (Q K, 3); place within a gap and number of the gap, (Q K, 3) in [0, 1)."""

    directions: Float64
    places: Float64


def middles(patches: Index) -> Float64:
    """Return the places of the middles of patches, (2, N), as `Basis.directions` takes them; 0 is the normal."""
    return np.where(patches == 0, 0.0, np.full((2, len(patches)), 0.5))


def gap_rays(basis: Basis, patches: Index, points: int) -> GapRays:
    """Return rays through the middles of patches, a power of two `points` each."""
    numbers = np.tile(qmc.Sobol(4, seed=0).random(points), (len(patches), 1))
    directions = np.repeat(basis.directions(patches, *middles(patches)), points, axis=0)
    directions[:, 1] *= np.where(numbers[:, 3] < 0.5, -1.0, 1.0)
    return GapRays(directions, np.ascontiguousarray(numbers[:, :3]))


def straight_share(fabric: Fabric, rays: GapRays, patches: int) -> Float64:
    """Return the share of light that goes straight through, for the rays of so many patches, (patches,)."""
    front, back = height_field(fabric), height_field(fabric.back())
    picks, ends = front.top.shape
    cell = (rays.places[:, 2] * (picks * ends)).astype(np.int64)
    # Gaps lie around the corners of cells.
    x = (cell % ends + (rays.places[:, 0] - 0.5) * (1.0 - fabric.warp.width)) % ends
    y = (cell // ends + (rays.places[:, 1] - 0.5) * (1.0 - fabric.weft.width)) % picks
    passed = np.empty(len(x), np.bool_)
    _pass(front, back, x, y, rays.directions, passed)
    return np.asarray((1.0 - fabric.warp.width) * (1.0 - fabric.weft.width) * passed.reshape(patches, -1).mean(axis=1))


@kernel
def _pass(front: HeightField, back: HeightField, x: Float64, y: Float64, directions: Float64, passed: Mask) -> None:
    """Write which rays through points of gaps neither face hides."""
    for n in range(len(x)):
        dx, dy, dz = directions[n, 0], directions[n, 1], directions[n, 2]
        passed[n] = gap_clear(front, back, x[n], y[n], ray(dx, dy, dz, 0.0), ray(-dx, -dy, dz, 0.0))


class Straight(NamedTuple):
    """Light straight through of Q patches, the mean of faces and mirror images, and how many of these there are."""

    patches: Index
    share: Float64
    weight: Float64

    @property
    def closed(self) -> bool:
        """True if no light goes straight through."""
        return bool(self.share.max(initial=0.0) < _LEAST)

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
