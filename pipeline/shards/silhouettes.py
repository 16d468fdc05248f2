"""Rows of the kinds `opacity` and `grazing_cosine`: what the silhouette of a curved cloth is learnt from.

A data set's transparency is the share of light that goes straight through the cloth at the points that the viewer sees.
The share of camera rays that miss a curved cloth altogether is another quantity: 1 - `opacity`. The grazing cosine is
the cosine at which a ray just touches the cloth (`pipeline.truth.geometry.opacity`). Both vary near grazing views
alone, so that most queries are drawn there.
"""

import math
from collections.abc import Callable
from typing import Final, Literal

import numpy as np
from pydantic import Field

from pipeline.compiled.arrays import Float32, Float64
from pipeline.fingerprint import stream_seed
from pipeline.shards.queries import uniform_draws
from pipeline.truth.options import TruthOptions
from pipeline.truth.query import Queries
from weaves.fabric import Fabric
from weaves.validation import Frozen

RAYS_A_COSINE: Final = 16
"""A grazing cosine takes some fifty rays to find, so each row has so many times fewer of them than `points`."""

_SPREADS = 1 << 64  # added to the key: the stream of points within the footprints of grazing cosines
_TRIED = 1024  # first rows, whose steepest grazing cosine bounds the views of all
_BEYOND = 1.2  # how far beyond it the views reach, in tangents
_CHUNK = 2048  # rows between two signs of progress; no row depends on it

_Rows = dict[str, Float32]  # columns by name


class SilhouetteRows(Frozen):
    """Which queries about a fabric's silhouette are answered, and how.

    Centres are uniform in the repeat, footprints log-uniform, curvatures uniform in their root up to the largest, and
    so are tangents, up to a little beyond the steepest view that was found to touch the cloth.
    """

    kind: Literal["opacity", "grazing_cosine"]
    """Target: the opacity, or mean and variance of the grazing cosine over the footprint."""
    rows: int = Field(ge=1)
    points: int = Field(ge=32)
    """Rays of an opacity, a power of two; of grazing cosines a sixteenth."""
    sigma: tuple[float, float]
    """Range of the footprints, in yarn spacings."""
    largest_curvature: float = Field(gt=0, le=1)
    """Largest curvature, in 1/yarn spacings."""
    anywhere: float = Field(ge=0, le=1)
    """Share of the views at any angle, their cosines uniform in (0, 1]."""
    footprint: Literal["gaussian", "box"]
    seed: int = Field(ge=0)
    """Seed of the queries and of their rays."""

    def count(self, fabric: Fabric) -> int:
        """Return the number of rows for a fabric."""
        return self.rows

    def answer(
        self, fabric: Fabric, start: int, count: int, progress: Callable[[int], None] = lambda done: None
    ) -> _Rows:
        """Return rows `start` to `start + count` by column; a row depends on fabric, options and its index alone."""
        seed = stream_seed("silhouettes", [fabric.optics(), self.seed])
        steepest = self._steepest(fabric, seed)
        parts: list[_Rows] = []
        for done in range(0, count, _CHUNK):
            part = self._drawn(fabric, seed, start + done, min(_CHUNK, count - done), steepest)
            parts.append(part | self._answered(fabric, seed, start + done, part))
            progress(min(done + _CHUNK, count))
        return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}

    def _steepest(self, fabric: Fabric, seed: int) -> float:
        """Return the largest tangent, over the root of the curvature, at which one of the first rows touches."""
        from pipeline.truth.geometry.opacity import grazing_cosine

        _, u, v, azimuth, curvature = self._positions(fabric, seed, 0, _TRIED)
        square = np.square(grazing_cosine(fabric, u, v, azimuth, curvature))
        return float(np.sqrt(square / (1.0 - square) / curvature).max())

    def _positions(self, fabric: Fabric, seed: int, start: int, count: int) -> tuple[Float64, ...]:
        """Return random numbers (count, 8), and of these centres u and v, azimuths and curvatures, each (count,)."""
        draws = uniform_draws(seed, start, count)
        ends, picks = fabric.weave.repeat
        curvature = self.largest_curvature * np.square(1.0 - draws[:, 3])  # 1 - a draw is never 0
        return draws, draws[:, 0] * ends, draws[:, 1] * picks, 2.0 * np.pi * draws[:, 5], curvature

    def _drawn(self, fabric: Fabric, seed: int, start: int, count: int, steepest: float) -> _Rows:
        draws, u, v, azimuth, curvature = self._positions(fabric, seed, start, count)
        low, high = (math.log(bound) for bound in self.sigma)
        tangent = _BEYOND * steepest * np.sqrt(curvature) * (1.0 - draws[:, 4])
        cosine = np.where(draws[:, 6] < self.anywhere, 1.0 - draws[:, 4], tangent / np.sqrt(1.0 + np.square(tangent)))
        sine = np.sqrt((1.0 - cosine) * (1.0 + cosine))
        columns = {
            "u": u,
            "v": v,
            "sigma": np.exp(low + (high - low) * draws[:, 2]),
            "wo_x": sine * np.cos(azimuth),
            "wo_y": sine * np.sin(azimuth),
            "wo_z": cosine,
            "curvature": curvature,
        }
        return {name: column.astype(np.float32) for name, column in columns.items()}

    def _answered(self, fabric: Fabric, seed: int, start: int, query: _Rows) -> _Rows:
        from pipeline.truth.geometry.opacity import grazing_cosine, opacity

        if self.kind == "opacity":
            wo = np.stack([query["wo_x"], query["wo_y"], query["wo_z"]], axis=-1)
            asked = Queries.round(query["u"], query["v"], query["sigma"], wo, wo)
            options = TruthOptions(footprint=self.footprint, min_count=self.points, max_count=self.points)
            mean, error = opacity(fabric, asked._replace(curvature=query["curvature"]), options, seed, start)
            return {"opacity": mean, "opacity_standard_error": error}

        # Grazing cosines at points of the footprint, in units of the curvature's root.
        u, v, sigma, curvature = (query[name].astype(np.float64)[:, None] for name in ("u", "v", "sigma", "curvature"))
        azimuth = np.arctan2(query["wo_y"], query["wo_x"]).astype(np.float64)[:, None]
        x, y = self._spread(seed, start, len(u))
        touch = grazing_cosine(fabric, u + sigma * x, v + sigma * y, azimuth, curvature) / np.sqrt(curvature)
        mean, variance = touch.mean(axis=1).astype(np.float32), touch.var(axis=1).astype(np.float32)
        return {"grazing_mean": mean, "grazing_variance": variance}

    def _spread(self, seed: int, start: int, count: int) -> tuple[Float64, Float64]:
        """Return points of a footprint of standard deviation 1, x and y, each (count, points of a row)."""
        each = max(self.points // RAYS_A_COSINE, 2)
        generator = np.random.Generator(np.random.Philox(key=seed + _SPREADS).advance(start * each // 2))
        first, second = np.moveaxis(generator.random((count, each, 2)), -1, 0)
        if self.footprint == "box":
            return math.sqrt(12.0) * (first - 0.5), math.sqrt(12.0) * (second - 0.5)
        radius = np.sqrt(-2.0 * np.log(1.0 - first))  # Box and Muller
        return radius * np.cos(2.0 * np.pi * second), radius * np.sin(2.0 * np.pi * second)
