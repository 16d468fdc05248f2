"""The BSDF of a fabric: the ground truth over the whole repeat, as means over pairs of patches.

Every pair has the same few points of a Sobol sequence in the four dimensions of both directions, turned by random
numbers of its own (Cranley and Patterson). A footprint covers the cloth evenly: no place counts more than another.

The truth is not reciprocal: the diffuse part of a point weighs the macro normal's cosine to the light (blend), and view
rays see rims, which light does not meet. A BSDF file has to be, so each pair is the mean of both ways. Light that goes
straight through is a delta lobe; in a patch it is T / projected solid angle, with T the transparency.
"""

from typing import Final, NamedTuple

import numpy as np
from scipy.stats import qmc

from pipeline.bsdf.klems import KLEMS_FULL, Basis, Scattering, exchanged
from pipeline.compiled.arrays import Float64, Index
from pipeline.scenes.shade import shade
from pipeline.truth.estimator import estimate
from pipeline.truth.options import TruthOptions
from pipeline.truth.query import Queries
from weaves.colour import LUMINANCE
from weaves.errors import BadInput
from weaves.fabric import Fabric

PAIR_POINTS: Final = 4  # points of a pair of patches, a power of two

EVEN_SIGMA: Final = 32.0  # standard deviation of the footprint, in yarn spacings, at least: it covers the cloth evenly

_TRUTH: Final = TruthOptions()
_OF_DIRECT: Final = 64  # points of a patch for light that goes straight through; a quarter if patches are small
_STEEPEST: Final = np.sin(np.radians(88.9)) ** 2  # the truth has no view rays from 89 degrees on
_LABELS = np.array([-1.0, -1.0, 1.0])  # from the label of light to the direction to its source


class FabricBsdf(NamedTuple):
    """The BSDF of a fabric, its bands, and how far the truth is from reciprocal."""

    scattering: Scattering  # ``visible``, and ``solar`` if another fabric gave its colours
    direct: Float64  # share of light of each patch that goes straight through, (P,)
    asymmetry: float  # largest of `Scattering.reciprocity` before both ways are averaged


def fabric_bsdf(
    fabric: Fabric, solar: Fabric | None = None, basis: Basis = KLEMS_FULL, points: int = PAIR_POINTS
) -> FabricBsdf:
    """Compute the BSDF of a fabric; its front is the side z > 0.

    Its colours, as luminance, are those of the visible band; those of `solar` are of the solar band, the mean of the
    three channels; BadInput if that is another cloth. `points` of a pair of patches are a power of two, at least 1.
    """
    if solar is not None and solar.optics() != fabric.optics():
        raise BadInput("export", "solar", solar.name, f"has to be the cloth {fabric.name!r} in other colours")
    cloths = {"visible": (fabric, np.array(LUMINANCE))}
    if solar is not None:
        cloths["solar"] = solar, np.full(3, 1.0 / 3.0)
    count = basis.patches
    seen, lit = (np.repeat(index, points) for index in np.indices((count, count)))
    u, v, s, t = _places(basis, points).reshape(-1, 4).T
    bands = {band: np.empty((2, 2, count, count)) for band in cloths}
    for kind, side in np.ndindex(2, 2):
        queries = pair_queries(fabric, basis, (lit, s, t), (seen, u, v), side, side ^ kind)
        answers = estimate(fabric, queries, _TRUTH, 4 * kind + side)
        for band, (cloth, weights) in cloths.items():
            value = shade(cloth, answers.mean, queries) @ weights / np.abs(queries.wi[:, 2])
            bands[band][kind, side] = value.reshape(count, count, points).mean(axis=-1)
    whole = Scattering(basis, bands)
    asymmetry = float(max(whole.reciprocity(band).max() for band in bands))
    direct = _direct(fabric, basis.of_lobes)
    lobe = np.diag(basis.means(direct) / basis.projected_solid_angle)
    for blocks in bands.values():
        for side in (0, 1):
            blocks[0, side] = 0.5 * (blocks[0, side] + exchanged(basis, blocks[0, side]))
        blocks[1, 0] = 0.5 * (blocks[1, 0] + exchanged(basis, blocks[1, 1])) + lobe
        blocks[1, 1] = exchanged(basis, blocks[1, 0])
    return FabricBsdf(whole.checked("export"), direct, asymmetry)


def _places(basis: Basis, points: int) -> Float64:
    """Return where in their patches the points of each pair lie, those of what is scattered first, (P, P, points, 4).

    A pair with light and viewer exchanged has the same points.
    """
    count, random = basis.patches, np.random.default_rng(0)
    place = qmc.Sobol(4, scramble=False).random(points) + random.random((count, count, 1, 4))
    other = place[np.ix_(basis.opposite, basis.opposite)].swapaxes(0, 1)[..., [2, 3, 0, 1]]
    index = np.arange(count * count).reshape(count, count)
    later = index > index[np.ix_(basis.opposite, basis.opposite)].T
    return np.asarray(np.where(later[..., None, None], other, place) % 1.0)


PatchPoints = tuple[Index, Float64, Float64]  # patches and where in them points lie, as `Basis.directions` takes them


def pair_queries(
    fabric: Fabric, basis: Basis, lit: PatchPoints, seen: PatchPoints, lit_from: int | Index, seen_from: int | Index
) -> Queries:
    """Return queries about the whole cloth of N pairs of points in patches; sides are 0, the front, or 1."""
    wi, wo = _not_grazing(basis.directions(*lit)) * _LABELS, _not_grazing(basis.directions(*seen))
    wi[:, 2] *= 1 - 2 * lit_from
    wo[:, 2] *= 1 - 2 * seen_from
    nothing = np.zeros(len(wi))
    return Queries.round(nothing, nothing, nothing + max(EVEN_SIGMA, *fabric.weave.repeat), wi, wo)


def _not_grazing(labels: Float64) -> Float64:
    """Return labels (N, 3) no lower than the lowest view of the truth."""
    square = (labels[:, :2] ** 2).sum(axis=1)
    lowered = np.minimum(square, _STEEPEST)
    scale = np.sqrt(lowered / np.where(square > 0.0, square, 1.0))
    return np.stack([labels[:, 0] * scale, labels[:, 1] * scale, np.sqrt(1.0 - lowered)], axis=-1)


def _direct(fabric: Fabric, basis: Basis) -> Float64:
    """Return the share of light of each patch that goes straight through, (P,): the mean of both ways."""
    place = qmc.Sobol(2, scramble=False).random(_OF_DIRECT if basis.patches < _OF_DIRECT**2 else _OF_DIRECT // 4)
    patch, (u, v) = np.repeat(np.arange(basis.patches), len(place)), np.tile(place, (basis.patches, 1)).T
    # The light plays no part in the transparency; in front it is cheap.
    through = estimate(fabric, pair_queries(fabric, basis, (patch, u, v), (patch, u, v), 0, 0), _TRUTH, 9).transparency
    share = through.reshape(basis.patches, -1).mean(axis=1).astype(np.float64)
    return np.asarray(0.5 * (share + share[basis.opposite]))
