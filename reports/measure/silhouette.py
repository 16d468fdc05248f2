"""The edge of a cloth cylinder against a dark ground: errors of its silhouette and of the light there.

An orthographic camera looks at right angles at a cylinder of radius r; its picture is the strip along one edge, from
`depth` inside the boundary's outline to the outline. A pixel at the distance d from the axis sees the boundary under
the cosine sqrt(1 - (d/r)^2), with the curvature 1/r. Its coverage is the opacity: what the cloth hides of the ground
[Kuznetsov2022Curved]. Its light is coverage times patch BSDF times pi, as under a directional light of irradiance pi.

A method without `missed` knows no curved cloth. It is evaluated as a flat material is on a curved surface: the
same queries with curvature 0, opaque everywhere, and 0 where the light is behind the tangent plane.

A query knows one curvature, that of the boundary along the ray. On a cylinder it is Euler's k1 cos^2 + k2 sin^2 in the
plane of ray and normal. Elsewhere it changes along the way, and a ray that grazes a strongly curved place may still
meet the flatter ground behind it: the mean of the curvatures would inflate silhouettes. So the minimum over a short
stretch past the shading point is taken, along the section of the boundary by that plane [Kuznetsov2022Curved].
Curvatures are lengths to the power -1: cloth whose yarns are s times as wide sees s times the curvature.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import NamedTuple, Protocol, runtime_checkable

import numpy as np
import numpy.typing as npt

from pipeline.models.method import Method
from pipeline.scenes.shade import shade
from pipeline.truth.estimator import estimate
from pipeline.truth.geometry.opacity import opacity
from pipeline.truth.query import Queries
from reports.images.exr import read_exr, write_exr
from reports.options import EdgeOptions, Role
from reports.record import TRUTH, Provenance, Record
from weaves.fabric import Fabric

Floats = npt.NDArray[np.float64]


@runtime_checkable
class SeesThrough(Protocol):
    """A method that knows which share of camera rays misses a curved cloth."""

    def missed(self, fabric: Fabric, queries: Queries) -> npt.NDArray[np.float32]:
        """Return the share of each footprint's camera rays that meet no yarn, float32 (N,)."""


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
        Distance of the method's edge outside the true one, mean over the rows, in yarn spacings.
    light_rmse : float
        Root mean squared error of the light, over pixels and channels.
    """

    coverage_rmse: float
    displacement: float
    light_rmse: float


def edge_queries(options: EdgeOptions, repeat: tuple[int, int]) -> Queries:
    """Return the queries of the strip's pixels, row after row, (H W,); the circumference runs along x."""
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
    result = Queries.round(
        np.mod(radius * np.arcsin(sine), repeat[0]).astype(np.float32),
        np.mod(v, repeat[1]).astype(np.float32),
        (0.5 * pixel / np.sqrt(cosine)).astype(np.float32),
        wi.astype(np.float32),
        wo.astype(np.float32),
    )
    return result._replace(curvature=curvature.astype(np.float32))


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
        coverage = 1.0 - method.missed(fabric, queries)
        return _edge(fabric, queries, coverage, method.predict(fabric, queries, options.seed), options)
    front = np.flatnonzero(queries.wi[:, 2] > 0)
    flat = queries._replace(curvature=np.zeros_like(queries.curvature)).take(front)
    components = np.zeros((len(queries.u), 4), np.float32)
    components[front] = method.predict(fabric, flat, options.seed)
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


def render_edge(fabric: Fabric, options: EdgeOptions, path: Path) -> None:
    """Write the truth's pictures to `path`: R, G, B the light, A the coverage."""
    edge = true_edge(fabric, options)
    planes = {name: edge.light[..., index] for index, name in enumerate("RGB")} | {"A": edge.coverage}
    write_exr(path, planes, {"fabric": fabric.name, "scene": "edge", "method": TRUTH})


def read_edge(path: Path) -> Edge:
    """Read what `render_edge` wrote; BadInput if there is nothing."""
    exr = read_exr(path)
    return Edge(exr.channels["A"].astype(np.float64), exr.stack("R", "G", "B").astype(np.float64))


def measure_silhouette(
    method: Method,
    fabric: Fabric,
    role: Role,
    options: EdgeOptions,
    truth: Path,
    provenance: Provenance | None = None,
) -> list[Record]:
    """Measure a method's edge against the truth's: errors of coverage and light, and how far the edge lies outside.

    Parameters
    ----------
    method : Method
        Must cover the fabric.
    truth : Path
        The pictures that `render_edge` wrote with the same options.
    """
    reference = read_edge(truth)
    found = silhouette(method, fabric, options, reference)
    subject = Record(
        method=method.name,
        setting=method.setting,
        fabric=fabric.name,
        role=role,
        provenance=provenance or Provenance(),
    )
    pixels = reference.coverage.size
    return [
        subject.of("silhouette_coverage", found.coverage_rmse, pixels),
        subject.of("silhouette_displacement", found.displacement, options.rows),
        subject.of("silhouette_light", found.light_rmse, pixels),
    ]


def _edge(
    fabric: Fabric,
    queries: Queries,
    coverage: npt.NDArray[np.float32],
    components: npt.NDArray[np.float32],
    options: EdgeOptions,
) -> Edge:
    colour = shade(fabric, components, queries)
    cover = coverage.astype(np.float64).reshape(options.rows, -1)
    return Edge(cover, math.pi * cover[..., None] * colour.reshape(*cover.shape, 3))


_STEPS = 32  # along a stretch
_CORRECTIONS = 3  # of Newton, which bring a step along the tangent back to the curve


def minimum_curvature(
    quadric: npt.ArrayLike, point: npt.ArrayLike, wo: npt.ArrayLike, spacing: float = 1.0, stretch: float = 4.0
) -> Floats:
    """Return the least curvature of a quadric over a stretch past each point, in 1/yarn spacings, at least 0.

    Parameters
    ----------
    quadric : float (3, 3)
        Symmetric A of the boundary p.Ap = 1 with outward normals Ap: diag(1/r^2, 1/r^2, 0) is a cylinder of radius r
        around z. In the world's lengths.
    point : float (N, 3)
        Shading points on it.
    wo : float (N, 3)
        Unit vectors to the viewer; the stretch runs away from it.
    spacing : float
        Length of a yarn spacing in the world, > 0.
    stretch : float
        Length of the stretch, in yarn spacings; 0: the curvature at the point. The paper does not say how long.

    Returns
    -------
    float64 (N,)
        Concave places count as flat.
    """
    matrix, position, viewer = (np.asarray(array, np.float64) for array in (quadric, point, wo))
    gradient = position @ matrix
    length = np.linalg.norm(gradient, axis=-1, keepdims=True)
    normal = gradient / length
    ahead = _unit_along(-viewer, normal)

    # The section by the plane of ray and normal: points x = (ahead, up) with x.Mx + 2 x.(0, length) = 0.
    basis = np.stack([ahead, normal], axis=1)
    section = np.einsum("nij,jk,nlk->nil", basis, matrix, basis)
    linear = np.concatenate([np.zeros_like(length), length], axis=-1)
    x, step = np.zeros_like(linear), stretch * spacing / _STEPS
    least = np.full(len(x), np.inf)
    for walked in range(_STEPS + 1):
        slope = np.einsum("nij,nj->ni", section, x) + linear
        steepness = np.linalg.norm(slope, axis=-1)
        along = np.stack([slope[:, 1], -slope[:, 0]], axis=-1) / steepness[:, None]
        least = np.minimum(least, np.einsum("ni,nij,nj->n", along, section, along) / steepness)
        if walked == _STEPS or step == 0.0:
            break
        x = x + step * along
        for _ in range(_CORRECTIONS):
            slope = np.einsum("nij,nj->ni", section, x) + linear
            value = np.einsum("ni,ni->n", slope + linear, x)
            x = x - slope * (0.5 * value / np.square(slope).sum(axis=-1))[:, None]
    return np.asarray(np.maximum(least, 0.0) * spacing)


def _unit_along(direction: Floats, normal: Floats) -> Floats:
    """Return the unit vectors of directions in the tangent planes; any tangent for a direction along the normal."""
    flat = direction - np.sum(direction * normal, axis=-1, keepdims=True) * normal
    size = np.linalg.norm(flat, axis=-1, keepdims=True)
    any_tangent = np.cross(normal, np.eye(3)[np.abs(normal).argmin(axis=-1)])
    any_tangent /= np.linalg.norm(any_tangent, axis=-1, keepdims=True)
    return np.where(size > 1e-9, flat / np.maximum(size, 1e-300), any_tangent)
