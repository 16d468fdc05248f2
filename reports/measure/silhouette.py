"""The edge of a cloth cylinder against a dark ground: errors of its silhouette and of the light there.

An orthographic camera looks at right angles at a cylinder of radius r; its picture is the strip along one edge, from
`depth` inside the boundary's outline to the outline. A pixel at the distance d from the axis sees the boundary under
the cosine sqrt(1 - (d/r)^2), with the curvature 1/r. Its coverage is the share of view rays that do not leave the cloth
again [Kuznetsov2022Curved]. Its light is pi times coverage times patch BSDF, as under a sun of irradiance pi.

A method without `coverage` knows no curved cloth. It is evaluated as a flat material is on a curved surface: the
same queries with curvature 0, covered everywhere, and 0 where the light is behind the tangent plane.

The camera looks along the plane of the normals: all queries have the curvature 1/r, by Euler's k1 cos^2 + k2 sin^2.
"""

import math
from pathlib import Path
from typing import NamedTuple

import numpy as np

from pipeline.compiled.arrays import Float32, Float64
from pipeline.models.method import Method
from pipeline.scenes.shade import shade
from pipeline.truth.estimator import estimate
from pipeline.truth.geometry.opacity import coverage
from pipeline.truth.query import Queries
from reports.images.exr import read_exr, write_exr
from reports.options import EdgeOptions
from reports.record import TRUTH, Record
from weaves.fabric import Fabric


class Edge(NamedTuple):
    """Pictures of the strip, the outline at the right."""

    coverage: Float64  # share of a pixel that the cloth covers, (H, W)
    light: Float64  # linear RGB, (H, W, 3)


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
    axes = [cosine, zero, -sine], [zero, one, zero], [sine, zero, cosine]
    frame = np.stack([np.stack(axis, -1) for axis in axes], 1)
    u, v = np.mod(radius * np.arcsin(sine), repeat[0]), np.mod(v, repeat[1])
    places = u, v, 0.5 * pixel / np.sqrt(cosine), frame @ light, frame[:, :, 2]
    result = Queries.round(*(place.astype(np.float32) for place in places))
    return result._replace(curvature=np.full(len(v), 1.0 / radius, np.float32))


def edge_of(method: Method, fabric: Fabric, options: EdgeOptions) -> Edge:
    """Return a method's pictures."""
    queries = edge_queries(options, fabric.weave.repeat)
    method.prepare(fabric)
    if knows_rims := getattr(method, "coverage", None):
        covered = knows_rims(fabric, queries)
        return _edge(fabric, queries, covered, method.predict(fabric, queries, options.seed), options)
    front = np.flatnonzero(queries.wi[:, 2] > 0)
    flat = queries._replace(curvature=np.zeros_like(queries.curvature)).take(front)
    components = np.zeros((len(queries.u), 4), np.float32)
    components[front] = method.predict(fabric, flat, options.seed)
    return _edge(fabric, queries, np.ones(len(queries.u), np.float32), components, options)


def render_edge(fabric: Fabric, options: EdgeOptions, path: Path) -> None:
    """Write the truth's pictures to `path`: R, G, B the light, A the coverage."""
    queries = edge_queries(options, fabric.weave.repeat)
    covered, _ = coverage(fabric, queries, options.truth, options.seed)
    edge = _edge(fabric, queries, covered, estimate(fabric, queries, options.truth, options.seed).mean, options)
    planes = {name: edge.light[..., index] for index, name in enumerate("RGB")} | {"A": edge.coverage}
    write_exr(path, planes, {"fabric": fabric.name, "scene": "edge", "method": TRUTH})


def read_edge(path: Path) -> Edge:
    """Read what `render_edge` wrote; BadInput if there is nothing."""
    exr = read_exr(path)
    return Edge(exr.channels["A"].astype(np.float64), exr.stack("R", "G", "B").astype(np.float64))


def measure_silhouette(method: Method, fabric: Fabric, options: EdgeOptions, truth: Path) -> list[Record]:
    """Measure a method's edge against the truth's, the pictures that `render_edge` wrote with the same options.

    Records are root mean squared errors of the coverage, and of the light over pixels and channels; between them the
    distance of the method's edge outside the true one, the mean over the rows, in yarn spacings.
    """
    reference, edge = read_edge(truth), edge_of(method, fabric, options)
    covered, pixels = edge.coverage - reference.coverage, reference.coverage.size
    subject = Record(method=method.name, setting=method.setting, fabric=fabric.name)
    return [
        subject.of("silhouette_coverage", float(np.sqrt(np.square(covered).mean())), pixels),
        subject.of("silhouette_displacement", float(covered.sum(axis=1).mean() * options.pixel), options.rows),
        subject.of("silhouette_light", float(np.sqrt(np.square(edge.light - reference.light).mean())), pixels),
    ]


def _edge(fabric: Fabric, queries: Queries, covered: Float32, components: Float32, options: EdgeOptions) -> Edge:
    colour = shade(fabric, components, queries)
    cover = covered.astype(np.float64).reshape(options.rows, -1)
    return Edge(cover, math.pi * cover[..., None] * colour.reshape(*cover.shape, 3))
