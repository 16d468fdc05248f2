"""G-buffer: the pixels of one fabric as queries.

A pixel that shows the fabric is a *place*: a footprint on the cloth and a direction to the viewer, in the local frame
x along the weft, y along the warp, z = normal. A place under one light is a *query*; its answer f_P, which already
contains the incident cosine (pipeline.truth.conventions), times the light's irradiance is added to the pixel. So N
places under several lights are M queries, and one light that reaches every place gives M = N.
"""

from dataclasses import dataclass, field, replace
from typing import Final, Self

import numpy as np
import numpy.typing as npt

from pipeline.compiled.arrays import Float32, Float64, Index, Mask
from pipeline.truth.query import Queries
from weaves.fabric import Fabric

LEAST_SIGMA: Final = 1e-6  # least standard deviation of a footprint, in yarn spacings


@dataclass(frozen=True)
class GBuffer:
    """N places of one fabric in a picture of H by W pixels, and M queries about them."""

    mask: Mask  # pixels that show the fabric; places are among them, bool (H, W)
    pixel: Index  # where each place is: row * W + column, int64 (N,)
    u: Float64
    v: Float64
    """Centre of the footprint, in yarn spacings, not reduced, float64 (N,)."""
    sigma: Float64
    sigma_minor: Float64
    """Standard deviations of the footprint along its two axes, in yarn spacings, float64 (N,)."""
    angle: Float64  # angle from x to the first axis, radians, float64 (N,)
    curvature: Float64  # of the cloth along the view ray, 1/yarn spacings, 0 to 1, float64 (N,)
    wo: Float64  # unit vectors to the viewer, in the local frame, float64 (N, 3)
    place: Index
    """Which place each query is about, int64 (M,); methods share what lights of a place have in common if these
    queries follow each other."""
    wi: Float64  # unit vectors to the light, in the place's local frame, float64 (M, 3)
    irradiance: Float64  # linear RGB irradiance that the light would bring to a surface facing it there, float64 (M, 3)
    rim: Index = field(default_factory=lambda: np.zeros(0, np.int64))
    """Places at a silhouette: curved cloth whose view rays may leave it again and show what is behind it, int64
    (R,)."""
    rim_wo: Float64 = field(default_factory=lambda: np.zeros((0, 3)))
    """Unit vectors from them to the viewer, tilted nowhere; z may have any sign, float64 (R, 3)."""

    @property
    def lit(self) -> Mask:
        """Pixels that any query is about, (H, W)."""
        lit = np.zeros(self.mask.size, np.bool_)
        lit[self.pixel[self.place]] = True
        return lit.reshape(self.mask.shape)

    def queries(self, repeat: tuple[int, int]) -> Queries:
        """Return the M queries in float32, centres reduced modulo `repeat` (extent in x and y) in float64 first."""
        return self.looks(repeat).take(self.place)._replace(wi=self.wi.astype(np.float32))

    def looks(self, repeat: tuple[int, int]) -> Queries:
        """Return one query a place, lit from the viewer: for the transparency, which no light changes."""
        u, v = reduced(self.u, repeat[0]), reduced(self.v, repeat[1])
        columns = (self.sigma, self.wo, self.wo, self.sigma_minor, self.angle, self.curvature)
        return Queries(u, v, *(column.astype(np.float32) for column in columns))

    def rims(self, repeat: tuple[int, int]) -> Queries:
        """Return one query for each place at a silhouette: for the coverage, which no light changes."""
        wo = self.rim_wo.astype(np.float32)
        return self.looks(repeat).take(self.rim)._replace(wi=wo, wo=wo)

    def coverage(self, of_rims: npt.ArrayLike) -> Float64:
        """Return the coverage of each place, (N,), from those of the rims, (R,): cloth covers all other places."""
        result = np.ones(len(self.pixel))
        result[self.rim] = of_rims
        return result

    def varied(self, fabric: Fabric) -> Self:
        """Return a G-buffer whose places are those of the lattice that a cloth of this fabric shows (`Variation`).

        A footprint is stretched by d(lattice)/d(place) at its middle. Directions turn by the nearest rotation to it.
        """
        if fabric.variation is None:
            return self
        place, jacobian = fabric.variation.lattice(fabric.weave.repeat, np.stack([self.u, self.v], axis=-1))
        cosine, sine = np.cos(self.angle), np.sin(self.angle)
        axes = np.stack([cosine, -sine, sine, cosine], axis=-1).reshape(-1, 2, 2)
        lengths = np.stack([self.sigma, self.sigma_minor], axis=-1)
        turned, lengths, _ = np.linalg.svd(jacobian @ (axes * lengths[:, None]))
        sigma, sigma_minor = np.maximum(lengths, LEAST_SIGMA).T
        angle = np.arctan2(turned[:, 1, 0], turned[:, 0, 0])
        by = np.arctan2(jacobian[:, 1, 0] - jacobian[:, 0, 1], jacobian[:, 0, 0] + jacobian[:, 1, 1])
        wo, wi, rim_wo = (
            _turned(vectors, angles)
            for vectors, angles in ((self.wo, by), (self.wi, by[self.place]), (self.rim_wo, by[self.rim]))
        )
        columns = {"sigma": sigma, "sigma_minor": sigma_minor, "angle": angle, "wo": wo, "wi": wi, "rim_wo": rim_wo}
        return replace(self, u=place[:, 0], v=place[:, 1], **columns)


def reduced(coordinate: Float64, period: int) -> Float32:
    """Reduce modulo the repeat in float64; what float32 rounds up to the period becomes 0."""
    result = np.mod(coordinate, period).astype(np.float32)
    return np.where(result >= period, np.float32(0), result).astype(np.float32)


def _turned(vectors: Float64, angles: Float64) -> Float64:
    """Return vectors (N, 3) turned about z by angles (N,)."""
    cosine, sine, (x, y, z) = np.cos(angles), np.sin(angles), vectors.T
    return np.stack([cosine * x - sine * y, sine * x + cosine * y, z], axis=-1)
