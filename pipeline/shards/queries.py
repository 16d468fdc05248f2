"""Random queries of a data set: a pure function of the options, a seed and the row's index.

Row n of a stream is the same query whether it is drawn alone or among a million, by any worker: the generator (Philox,
counter based [Salmon2011Philox]) is advanced to the row, never run up to it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Literal

import numpy as np
from pydantic import Field, model_validator

from pipeline.compiled.arrays import Float32, Float64
from pipeline.truth.options import TruthOptions
from pipeline.truth.query import STEEPEST_CURVATURE, Answers, Queries
from weaves.fabric import Fabric
from weaves.validation import Frozen

Kind = Literal["components", "angular_samples", "opacity", "grazing_cosine"]
"""Kinds of rows, each with its columns (`pipeline.shards.schema`): a data set's own, and those of extra rows."""

_CHUNK = 2048  # rows between two signs of progress; no row depends on it
_DRAWS = 8  # numbers reserved for each row; Philox yields four a step
_SHAPES = 1 << 64  # added to the key: the stream of what makes a query other than round, flat, and lit from the front


class QueryOptions(Frozen):
    """The distribution of queries."""

    sigma: tuple[float, float] = (0.05, 32.0)
    """Range of the footprint's standard deviation, in yarn spacings; drawn log-uniformly."""
    directions: Literal["projected_disc", "hemisphere"] = "projected_disc"
    """`projected_disc`: density proportional to the cosine; `hemisphere`: uniform in solid angle."""
    max_angle: float = Field(default=89.0, gt=0, le=89.9)
    """Largest angle of either direction to the macro normal, in degrees."""
    behind: float = Field(default=0.0, ge=0, le=1)
    """Share of the queries with the light on the other side of the cloth: their answers are its transmission."""
    stretch: float = Field(default=1.0, ge=1, le=1024)
    """Largest ratio of a footprint's axes; drawn log-uniformly from 1, the longer axis in any direction. The drawn
    standard deviation is then the root of the product of both."""
    curvature: tuple[float, float] = (0.0, 0.0)
    """Range of the curvature, in 1/yarn spacings; drawn log-uniformly. [0, 0]: flat cloth."""

    @model_validator(mode="after")
    def _ranges(self) -> QueryOptions:
        low, high = self.sigma
        if not 0 < low <= high:
            raise ValueError(f"sigma must be [low, high] with 0 < low <= high, got [{low}, {high}]")
        low, high = self.curvature
        if (low, high) != (0.0, 0.0) and not 0 < low <= high <= STEEPEST_CURVATURE:
            allowed = f"[0, 0] or [low, high] with 0 < low <= high <= {STEEPEST_CURVATURE:g}"
            raise ValueError(f"curvature must be {allowed}, got [{low}, {high}]")
        return self

    @property
    def kinds(self) -> frozenset[str]:
        """Kinds drawn, of `behind`, `stretch` and `curvature`; none: round footprints on flat cloth, lit in front."""
        drawn = {"behind": self.behind > 0, "stretch": self.stretch > 1, "curvature": self.curvature[1] > 0}
        return frozenset(kind for kind, there in drawn.items() if there)


def draw_queries(options: QueryOptions, repeat: tuple[int, int], seed: int, start: int, count: int) -> Queries:
    """Return rows `start` to `start + count` of the stream `seed`, 0 <= seed < 2^64.

    Centres are uniform in the fabric's `repeat`, its extent in x and y in yarn spacings.
    """
    draws = uniform_draws(seed, start, count)
    low, high = (math.log(bound) for bound in options.sigma)
    u, v = ((draws[:, axis] * repeat[axis]).astype(np.float32) for axis in (0, 1))
    sigma = np.exp(low + (high - low) * draws[:, 2]).astype(np.float32)
    wi, wo = (_directions(options, draws[:, first], draws[:, first + 1]) for first in (3, 5))
    queries = Queries.round(u, v, sigma, wi, wo)
    return _shaped(options, queries, seed, start) if options.kinds else queries


def uniform_draws(seed: int, start: int, count: int) -> Float64:
    """Return the numbers in [0, 1) of rows `start` to `start + count` of a stream, (count, 8)."""
    generator = np.random.Generator(np.random.Philox(key=seed).advance(start * _DRAWS // 4))
    return generator.random((count, _DRAWS))


def answered(
    fabric: Fabric, queries: Queries, truth: TruthOptions, seed: int, start: int, progress: Callable[[int], None]
) -> Answers:
    """Return the answers of the truth to rows from `start` on; `progress` receives the number of finished rows."""
    from pipeline.truth.estimator import estimate  # here, so that a plan loads no compiler

    parts, count = [], len(queries.u)
    for first in range(0, count, _CHUNK):
        parts.append(estimate(fabric, queries.take(slice(first, first + _CHUNK)), truth, seed, start + first))
        progress(min(first + _CHUNK, count))
    return Answers(*(np.concatenate(columns) for columns in zip(*parts, strict=True)))


def _shaped(options: QueryOptions, queries: Queries, seed: int, start: int) -> Queries:
    """Return queries with the light behind some of them, their footprints stretched and the cloth curved."""
    generator = np.random.Generator(np.random.Philox(key=seed + _SHAPES).advance(start))
    draws = generator.random((len(queries.u), 4))
    side = np.where(draws[:, 0] < options.behind, -1.0, 1.0).astype(np.float32)
    half = np.exp(0.5 * math.log(options.stretch) * draws[:, 1])
    curvature = np.zeros(len(draws))
    if options.curvature[1] > 0:
        low, high = (math.log(bound) for bound in options.curvature)
        curvature = np.clip(np.exp(low + (high - low) * draws[:, 3]), *options.curvature)
    return queries._replace(
        wi=queries.wi * np.stack([np.ones_like(side), np.ones_like(side), side], axis=-1),
        sigma=(queries.sigma * half).astype(np.float32),
        sigma_minor=(queries.sigma / half).astype(np.float32),
        angle=(math.pi * draws[:, 2] if options.stretch > 1.0 else np.zeros(len(draws))).astype(np.float32),
        curvature=curvature.astype(np.float32),
    )


def _directions(options: QueryOptions, radius: Float64, turn: Float64) -> Float32:
    """Return unit vectors of the upper hemisphere, (N, 3)."""
    limit = math.radians(options.max_angle)
    if options.directions == "projected_disc":
        sine = math.sin(limit) * np.sqrt(radius)
        cosine = np.sqrt(1.0 - sine * sine)
    else:
        cosine = 1.0 - (1.0 - math.cos(limit)) * radius
        sine = np.sqrt((1.0 - cosine) * (1.0 + cosine))
    azimuth = 2.0 * math.pi * turn
    return np.stack([sine * np.cos(azimuth), sine * np.sin(azimuth), cosine], axis=-1).astype(np.float32)
