"""A fabric and its queries as kernels read them: both sides of the cloth, the options, and columns in float64."""

from __future__ import annotations

from functools import lru_cache
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from pipeline.compiled.arrays import Float64, Index, Mask
from pipeline.truth.footprint.place import BOX, GAUSSIAN
from pipeline.truth.geometry.heightfield import HeightField, height_field
from pipeline.truth.geometry.pieces import reference_plane
from pipeline.truth.options import TruthOptions
from pipeline.truth.query import Queries
from pipeline.truth.scattering.point import Choices
from weaves.fabric import Fabric

AREA_SUM: Final = 5  # column of the denominator in every array of sums, after the four components and the transparency

POINT_SUMS: Final = 6  # columns of every array of sums


class ClothSide(NamedTuple):
    """One side of a fabric with the options that shape its numbers."""

    front: HeightField
    back: HeightField
    """The side that the viewer sees, and the other, reflected in the fabric plane."""
    choices: Choices  # options of the point's share
    shape: int  # GAUSSIAN or BOX
    projected: bool  # true if the denominator is the footprint's projected area
    parallax: bool  # true if points of the footprint are view rays through the reference plane
    plane: float  # height of that plane


class WideQueries(NamedTuple):
    """N queries in float64 with unit directions, the viewer in front; the fields of `Queries`."""

    u: Float64
    v: Float64
    sigma: Float64
    wi: Float64
    wo: Float64
    sigma_minor: Float64
    angle: Float64
    curvature: Float64

    def take(self, index: npt.NDArray[np.integer] | Mask) -> WideQueries:
        """Return the queries at `index`."""
        return WideQueries(*(np.ascontiguousarray(column[index]) for column in self))


class Raw(NamedTuple):
    """Answers of an estimator, before the calibration of their errors."""

    mean: Float64
    error: Float64
    """Components and transparency, and the error that the estimator reports of each, (N, 5)."""
    count: Index  # type: ignore[assignment]  # the field's word, though tuples have a count too
    """Points or nodes evaluated, (N,)."""
    stage: Index  # the computation that gave the answer: a stage of pipeline.truth.calibration, (N,)

    @classmethod
    def empty(cls, rows: int) -> Raw:
        """Return so many answers of 0, to be filled."""
        return cls(np.zeros((rows, 5)), np.zeros((rows, 5)), np.zeros(rows, np.int64), np.zeros(rows, np.int64))

    def take(self, index: Index | Mask) -> Raw:
        """Return the answers at `index`."""
        return Raw(*(column[index] for column in self))  # type: ignore[arg-type]

    def put(self, index: Index | Mask, mean: Float64, error: Float64, count: Index, stage: Index | int) -> None:
        """Write answers at `index`; their points are added to those that were spent before."""
        self.mean[index], self.error[index], self.stage[index] = mean, error, stage
        self.count[index] += count


def columns_of(queries: Queries, behind: bool = False) -> WideQueries:
    """Return queries for kernels, reflected in the fabric plane if the viewer is `behind` the cloth."""
    wide = WideQueries(*(np.ascontiguousarray(column, np.float64) for column in queries))
    flip = (1.0, 1.0, -1.0 if behind else 1.0)
    wi, wo = (w / np.linalg.norm(w, axis=-1, keepdims=True) * flip for w in (wide.wi, wide.wo))
    return wide._replace(wi=wi, wo=wo)


def cloth_side(fabric: Fabric, options: TruthOptions, behind: bool = False) -> ClothSide:
    """Return the front of a fabric for kernels, or its back if the viewer is `behind` it."""
    front, back, planes = _sides(fabric)
    return ClothSide(
        back if behind else front,
        front if behind else back,
        Choices(options.frame == "macro", options.shadows, options.walls == "rim"),
        BOX if options.footprint == "box" else GAUSSIAN,
        options.normaliser == "projected",
        options.parallax,
        planes[behind],
    )


@lru_cache(maxsize=64)
def _sides(fabric: Fabric) -> tuple[HeightField, HeightField, tuple[float, float]]:
    """Tabulate both sides and their reference planes; the draft of a back repeats as that of the front does."""
    front, back = height_field(fabric), height_field(fabric.back())
    return front, back, (reference_plane(front), reference_plane(back))
