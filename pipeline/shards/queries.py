"""Which questions a data set asks: a pure function of the options, a seed and the row's index.

Row n of a stream is the same query whether it is drawn alone or among a million, by any worker: the generator (Philox,
counter based [Salmon2011Philox]) is advanced to the row, never run up to it.
"""

from __future__ import annotations

import math
from typing import Literal

import numpy as np
import numpy.typing as npt
from pydantic import BaseModel, ConfigDict, Field, model_validator

from pipeline.truth.query import Queries

_DRAWS = 8  # numbers reserved for each row; Philox yields four a step


class QueryOptions(BaseModel):
    """The distribution of queries."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False, use_attribute_docstrings=True)

    sigma: tuple[float, float] = (0.05, 32.0)
    """Range of the footprint's standard deviation, in yarn spacings; drawn log-uniformly."""
    directions: Literal["projected_disc", "hemisphere"] = "projected_disc"
    """`projected_disc`: density proportional to the cosine; `hemisphere`: uniform in solid angle."""
    max_angle: float = Field(default=89.0, gt=0, le=89.9)
    """Largest angle of either direction to the macro normal, in degrees."""

    @model_validator(mode="after")
    def _sigma_is_a_range(self) -> QueryOptions:
        low, high = self.sigma
        if not 0 < low <= high:
            raise ValueError(f"sigma must be [low, high] with 0 < low <= high, got [{low}, {high}]")
        return self


def draw_queries(options: QueryOptions, repeat: tuple[int, int], seed: int, start: int, count: int) -> Queries:
    """Return rows `start` to `start + count` of the stream `seed`.

    Parameters
    ----------
    options : QueryOptions
        The distribution.
    repeat : tuple of int
        Extent of the fabric's repeat in x and y, in yarn spacings; centres are uniform in it.
    seed : int
        Name of the stream, 0 <= seed < 2^64.
    start, count : int
        Rows wanted.
    """
    generator = np.random.Generator(np.random.Philox(key=seed).advance(start * _DRAWS // 4))
    draws = generator.random((count, _DRAWS))
    low, high = (math.log(bound) for bound in options.sigma)
    return Queries.round(
        u=(draws[:, 0] * repeat[0]).astype(np.float32),
        v=(draws[:, 1] * repeat[1]).astype(np.float32),
        sigma=np.exp(low + (high - low) * draws[:, 2]).astype(np.float32),
        wi=_directions(options, draws[:, 3], draws[:, 4]),
        wo=_directions(options, draws[:, 5], draws[:, 6]),
    )


def _directions(
    options: QueryOptions, radius: npt.NDArray[np.float64], turn: npt.NDArray[np.float64]
) -> npt.NDArray[np.float32]:
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
