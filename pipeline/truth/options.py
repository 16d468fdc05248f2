"""Every choice of the ground truth that the papers leave open, as named options recorded in the shards."""

from __future__ import annotations

import math
from typing import Any, Final, Literal, NamedTuple

import numpy as np
from pydantic import Field, field_validator, model_validator

from pipeline.compiled.arrays import Float64
from weaves.validation import Frozen

EstimatorName = Literal["mc", "r2", "owen", "quadrature", "node_table", "auto"]
Walls = Literal["left_out", "rim"]

REPLACED_ESTIMATORS: Final = {"jittered": "r2"}  # estimators of earlier versions, and those to take in their place

TABLE_CELLS: Final = 96
"""Most different cells of a cloth that the estimator `node_table` knows; larger tables take too long to build."""

TABLE_SIGMA: Final = 1.25 / 32
"""Smallest standard deviation of a footprint, in yarn spacings, that the estimator `node_table` resolves."""

FEWEST_NODES: Final = 24  # nodes on a yarn spacing of the truth's fine table, at least

WALLS_OF_PLANE: Final[Walls] = "left_out"  # the meaning of `walls` without parallax

RAYS_RESOLVED: Final[dict[Walls, float]] = {"left_out": 0.7, "rim": 2.5}
"""Smallest standard deviation of a footprint of view rays that `node_table` resolves, over `seen_distance`."""


NARROWEST_RIMS: Final = 0.3
"""Least radius of yarns, in yarn spacings, whose rims `node_table` knows: of more open cloth its errors exceed those
that it states, because rays go on below the gaps."""


class UsualWalls(Frozen):
    """Options in which `walls` is that of the fabric plane if they have no parallax and do not say."""

    @model_validator(mode="before")
    @classmethod
    def _usual_walls(cls, options: Any) -> Any:
        if isinstance(options, dict) and options.get("parallax") is False and "walls" not in options:
            return options | {"walls": WALLS_OF_PLANE}
        return options


def steepness(relief: float, width: float, bend: float) -> float:
    """Return how much a yarn rises from one node to the next, over the distance of nodes; the bend in radians."""
    return relief * max(0.5 * math.pi * width, math.tan(bend))


def seen_distance(steepest: float, cosine: Float64, nodes: int) -> Float64:
    """Return how far apart, at most, view rays cross the reference plane that meet neighbouring nodes, (N,).

    `steepest` is the largest `steepness` of the yarns, `cosine` wo.n_s (N,), and there are so many `nodes` on a yarn
    spacing: (1 + steepness tan(theta)) / nodes.
    """
    return np.asarray((1.0 + steepest * np.sqrt(1.0 / cosine**2 - 1.0)) / nodes)


class Limits(NamedTuple):
    """When an estimator stops, as kernels read it; the fields are those of `TruthOptions`."""

    relative_error: float
    absolute_error: float
    min_count: int
    max_count: int


class TruthOptions(UsualWalls):
    """Options of the ground truth: how one patch BSDF value is computed."""

    estimator: EstimatorName = "auto"
    """Estimator of all values; see pipeline.truth.estimator."""
    footprint: Literal["gaussian", "box"] = "gaussian"
    """Kernel k_P; the box has the same standard deviations: sides sigma sqrt(12)."""
    relative_error: float = Field(default=0.02, gt=0, le=1)
    """Stop when the norm of the four errors falls below this share of the norm of the four means. With `auto` these are
    the standard errors that answers state; with other estimators, what the estimator reports before calibration."""
    absolute_error: float = Field(default=1e-5, ge=0, le=1)
    """Also stop when that norm falls below this, 1/sr: dark patches need no more."""
    min_count: int = Field(default=256, ge=32, le=2**24)
    """Points before the error is first estimated; a power of two."""
    max_count: int = Field(default=4096, ge=32, le=2**24)
    """Most points of a query, whatever its error; a power of two. Patches that are almost hidden may take 16 times as
    many."""
    frame: Literal["ply", "macro"] = "ply"
    """Cosines inside the yarn layer, and of the visible area, are taken to the ply normal or to the macro normal."""
    normaliser: Literal["visible", "projected"] = "visible"
    """The denominator: `visible` is the projected area that the viewer sees, A_P; `projected` is |wo.n_s| times the
    area of the footprint, which restores reciprocity."""
    parallax: bool = True
    """True if a footprint is a patch of view rays: its density belongs to the points where they cross the reference
    plane (`pipeline.truth.geometry.pieces`), as a camera sees the cloth. False: it is a patch of the fabric plane, in
    which heights displace nothing [Chen2024Woven]. `quadrature` knows it for Gaussians with walls left out."""
    walls: Walls = "rim"
    """Meaning of a view ray that meets the step between two floats: it sees the rim of the yarn above if that faces the
    viewer, so that the mean over all places hardly depends on the footprint; or it does not count. Without parallax it
    is `left_out`."""
    shadows: bool = True
    """True if points hide one another from light and viewer; without, the integrand is smooth and the value wrong."""

    @model_validator(mode="before")
    @classmethod
    def _without_variation(cls, options: Any) -> Any:
        """Accept data sets of earlier versions, which say that all yarns of a family are alike."""
        if isinstance(options, dict) and "variation" in options and options["variation"] is None:
            return {name: value for name, value in options.items() if name != "variation"}
        return options

    @field_validator("estimator", mode="before")
    @classmethod
    def _named_anew(cls, name: object) -> object:
        if isinstance(name, str) and name in REPLACED_ESTIMATORS:
            raise ValueError(f"this estimator is gone: take {REPLACED_ESTIMATORS[name]!r}")
        return name

    @model_validator(mode="after")
    def _powers_of_two(self) -> TruthOptions:
        for name in ("min_count", "max_count"):
            count = getattr(self, name)
            if count & (count - 1):
                raise ValueError(f"{name} must be a power of two, got {count}")
        if self.max_count < self.min_count:
            raise ValueError(f"max_count ({self.max_count}) must not be below min_count ({self.min_count})")
        return self

    @model_validator(mode="after")
    def _rays_have_one_model(self) -> TruthOptions:
        if self.parallax and (self.frame == "macro" or not self.shadows):
            raise ValueError("parallax needs frame 'ply' and shadows; say parallax = false for others")
        known = (self.walls, self.footprint, self.normaliser) == ("left_out", "gaussian", "visible")
        if self.parallax and self.estimator == "quadrature" and not known:
            raise ValueError(
                "with parallax, quadrature needs walls 'left_out', footprint 'gaussian' and normaliser 'visible': "
                "take auto or owen"
            )
        if self.walls != "left_out" and not self.parallax:
            raise ValueError("walls are met by view rays alone: parallax is needed")
        return self

    @property
    def limits(self) -> Limits:
        """When an estimator stops."""
        return Limits(*(getattr(self, name) for name in Limits._fields))
