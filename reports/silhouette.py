"""The edge of a cloth cylinder against a dark ground: who finds its silhouette, and what light it returns there.

An orthographic camera looks at right angles at a cylinder of radius r; its picture is the strip along one edge, from
`depth` inside the boundary's outline to the outline. A pixel at the distance d from the axis sees the boundary under
the cosine sqrt(1 - (d/r)^2), with the curvature 1/r. Its coverage is the opacity: what the cloth hides of the ground
[Kuznetsov2022Curved]. Its light is coverage times patch BSDF times pi, as under a directional light of irradiance pi.

A method without `transparency` knows no curved cloth. It is asked as a flat material is used on a curved surface: the
same questions with curvature 0, opaque everywhere, and 0 where the light is behind the tangent plane.
"""

from __future__ import annotations

import math
from typing import NamedTuple, Protocol, runtime_checkable

import numpy as np
import numpy.typing as npt
from pydantic import BaseModel, ConfigDict, Field

from pipeline.models.method import Method
from pipeline.scenes.curvature import minimum_curvature
from pipeline.scenes.shade import shade
from pipeline.truth.curved import opacity
from pipeline.truth.estimator import estimate
from pipeline.truth.options import TruthOptions
from pipeline.truth.query import Queries
from weaves.fabric import Fabric

Floats = npt.NDArray[np.float64]


@runtime_checkable
class SeesThrough(Protocol):
    """A method that knows what a curved cloth does not hide."""

    def transparency(self, fabric: Fabric, queries: Queries) -> npt.NDArray[np.float32]:
        """Return the share of each footprint's camera rays that meet no yarn, float32 (N,)."""


class EdgeOptions(BaseModel):
    """Cylinder, camera, light and truth."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False, use_attribute_docstrings=True)

    radius: float = Field(default=10.0, ge=1, le=1e4)
    """Of the boundary, in yarn spacings."""
    depth: float = Field(default=0.24, gt=0)
    """Width of the strip, in yarn spacings; less than the radius. Rays rise again from depths of a few tenths of a
    yarn spacing at most."""
    pixel: float = Field(default=0.02, gt=0, le=1)
    """Side of a pixel, in yarn spacings; its Gaussian has half of it as standard deviation."""
    rows: int = Field(default=200, ge=1, le=4096)
    """Pixels along the edge."""
    light: tuple[float, float] = (60.0, 20.0)
    """In degrees: angle from the camera's direction towards the edge's side, and elevation along the axis."""
    truth: TruthOptions = TruthOptions(relative_error=0.02, max_count=4096)
    """How true the truth is."""
    seed: int = Field(default=0, ge=0, lt=2**63)
    """Of the truth's points."""


class Edge(NamedTuple):
    """Pictures of the strip, the outline at the right, H by W.

    Attributes
    ----------
    coverage : float64 (H, W)
        Share of a pixel that the cloth hides.
    light : float64 (H, W, 3)
        Linear RGB.
    """

    coverage: Floats
    light: Floats


class Silhouette(NamedTuple):
    """A method's edge beside the truth's.

    Attributes
    ----------
    coverage_rmse : float
        Root mean squared error of the coverage.
    displacement : float
        How far the method's edge lies outside the true one, on average over the rows, in yarn spacings.
    light_rmse : float
        Root mean squared error of the light, over pixels and channels.
    """

    coverage_rmse: float
    displacement: float
    light_rmse: float


def edge_queries(options: EdgeOptions, repeat: tuple[int, int]) -> Queries:
    """Return what the strip's pixels ask, row after row, (H W,); the circumference runs along x."""
    radius, pixel = options.radius, options.pixel
    columns = max(round(min(options.depth, radius) / pixel), 1)
    sine = (radius - pixel * (np.arange(columns)[::-1] + 0.5)) / radius
    along = pixel * (np.arange(options.rows) + 0.5)
    v, sine = (grid.ravel() for grid in np.meshgrid(along, sine, indexing="ij"))
    cosine, zero, one = np.sqrt((1.0 - sine) * (1.0 + sine)), np.zeros_like(sine), np.ones_like(sine)

    # World: x towards the edge, y along the axis, z to the camera; local frame: tangent, axis, normal.
    turn, rise = (math.radians(angle) for angle in options.light)
    light = np.array([math.sin(turn) * math.cos(rise), math.sin(rise), math.cos(turn) * math.cos(rise)])
    frame = np.stack(
        [np.stack([cosine, zero, -sine], -1), np.stack([zero, one, zero], -1), np.stack([sine, zero, cosine], -1)], 1
    )
    wi, wo = frame @ light, frame[:, :, 2]
    boundary = np.diag([1.0 / radius**2, 0.0, 1.0 / radius**2])
    curvature = minimum_curvature(boundary, radius * frame[:, 2], np.tile([0.0, 0.0, 1.0], (len(v), 1)))
    asked = Queries.round(
        np.mod(radius * np.arcsin(sine), repeat[0]).astype(np.float32),
        np.mod(v, repeat[1]).astype(np.float32),
        (0.5 * pixel / np.sqrt(cosine)).astype(np.float32),
        wi.astype(np.float32),
        wo.astype(np.float32),
    )
    return asked._replace(curvature=curvature.astype(np.float32))


def true_edge(fabric: Fabric, options: EdgeOptions) -> Edge:
    """Return the truth's pictures."""
    queries = edge_queries(options, fabric.weave.repeat)
    coverage, _ = opacity(fabric, queries, options.truth, options.seed)
    return _edge(fabric, queries, coverage, estimate(fabric, queries, options.truth, options.seed).mean, options)


def edge_of(method: Method, fabric: Fabric, options: EdgeOptions) -> Edge:
    """Return a method's pictures."""
    queries = edge_queries(options, fabric.weave.repeat)
    method.prepare(fabric)
    if isinstance(method, SeesThrough):
        coverage = 1.0 - method.transparency(fabric, queries)
        return _edge(fabric, queries, coverage, method.predict(fabric, queries, options.seed), options)
    front = np.flatnonzero(queries.wi[:, 2] > 0)
    asked = queries._replace(curvature=np.zeros_like(queries.curvature)).take(front)
    components = np.zeros((len(queries.u), 4), np.float32)
    components[front] = method.predict(fabric, asked, options.seed)
    return _edge(fabric, queries, np.ones(len(queries.u), np.float32), components, options)


def silhouette(method: Method, fabric: Fabric, options: EdgeOptions, truth: Edge | None = None) -> Silhouette:
    """Compare a method's edge with the truth's, which is computed unless it is given."""
    truth = truth or true_edge(fabric, options)
    found = edge_of(method, fabric, options)
    covered = found.coverage - truth.coverage
    return Silhouette(
        coverage_rmse=float(np.sqrt(np.square(covered).mean())),
        displacement=float(covered.sum(axis=1).mean() * options.pixel),
        light_rmse=float(np.sqrt(np.square(found.light - truth.light).mean())),
    )


def _edge(
    fabric: Fabric,
    queries: Queries,
    coverage: npt.NDArray[np.float32],
    components: npt.NDArray[np.float32],
    options: EdgeOptions,
) -> Edge:
    behind = queries.wi[:, 2:] < 0
    colour = np.where(behind, shade(fabric, components, transmitted=True), shade(fabric, components))
    cover = coverage.astype(np.float64).reshape(options.rows, -1)
    return Edge(cover, math.pi * cover[..., None] * colour.reshape(*cover.shape, 3))
