"""One frame of a Mitsuba scene as G-buffers, one for each cloth, by Mitsuba's own AOV integrator.

Every pixel takes one ray through its centre and a box filter, so that nothing is averaged over an edge.

Footprint: a Gaussian of `pixel_sigma` pixels under J = d(u, v in yarns)/d(pixel), the AOVs duv_dx and duv_dy: its axes
are J's left singular vectors and its standard deviations pixel_sigma times the singular values. Mitsuba takes them over
one pixel to the right and one downwards, on the tangent plane [Igehy1999RayDifferentials].

Light: a light in sight of the place, along a straight ray, is a query; one that another surface hides is none, and one
that is hidden in parts is as strong as those in sight. Cloth blocks such a ray as if it were opaque. A light on one
side of the surface and on the other of its shading normal is none either.

Backdrop: other shapes are matte in their albedo; the environment is seen where a pixel's ray leaves the scene.
Radiance of a shape = albedo / pi times the sum over the lights in sight of irradiance times cosine, both sides alike:
the lights and shadows of the cloth itself, without noise. Light that shapes or cloth throw on each other is left out.
"""

import math
from itertools import chain
from typing import Any, Final, NamedTuple

import numpy as np

from pipeline.compiled.arrays import Float64, Index, Mask
from pipeline.scenes.gbuffer import LEAST_SIGMA, GBuffer
from pipeline.scenes.lights import fibonacci
from pipeline.scenes.loading import Camera, FilmWindow, Loaded
from pipeline.scenes.places import Places, curvature_of, dot, least_curvature, places_of, rims_of, tilted, unit
from pipeline.scenes.rays import aovs_of, first_hits, in_sight, off
from pipeline.scenes.scene import Cloth
from weaves.errors import BadInput

_AOVS: Final = ("position", "uv", "geo_normal", "sh_normal", "dp_du", "dp_dv", "duv_dx", "duv_dy", "shape_index")
_AOVS_BESIDE: Final = ("position", "geo_normal", "sh_normal", "albedo", "shape_index")
_LOOKS = 128  # directions in which a camera that may be inside the cloth looks around


class SceneFrame(NamedTuple):
    """A frame: what it shows of every cloth, and what is no cloth."""

    gbuffers: dict[str, GBuffer]  # by the cloth's key; a cloth out of sight has no places
    backdrop: Float64
    """Linear RGB of what is seen beside the cloth and, where there is cloth, behind it, (H, W, 3): there without the
    cloth's shadows."""
    depth: Float64
    """Distance of what is seen along the camera's axis, in the world's lengths, (H, W); 0 where nothing is."""
    normal: Float64  # shading normal of what is seen, in the world, (H, W, 3); 0 where nothing is


def render(
    loaded: Loaded, frame: float = 0.0, size: tuple[int, int] | None = None, window: FilmWindow | None = None
) -> SceneFrame:
    """Return what every pixel of a frame shows; frame 0 is the first.

    `size` is width and height in pixels, the film's unless given; `window` the part that is rendered, H by W pixels.
    BadInput if the camera is inside the cloth, or the cloth's uv coordinates are sheared beyond `largest_shear`.
    """
    camera = loaded.camera.at(loaded.scene, frame)
    size = size or camera.size
    _refuse_inside(loaded, camera)
    sensor = camera.sensor(loaded.mi, size, window)
    aovs = aovs_of(loaded.mi, loaded.world, sensor, _AOVS)
    gbuffers, shown = {}, np.zeros(aovs["uv"].shape[:2], np.bool_)
    for key, (cloth, _) in loaded.cloths.items():
        mask = np.isin(aovs["shape_index"][..., 0], loaded.worn[key])
        gbuffers[key] = _gbuffer(loaded, key, cloth, camera, mask, aovs)
        shown |= mask
    forward = camera.to_world[:3, 2] / np.linalg.norm(camera.to_world[:3, 2])
    away = (aovs["position"] - camera.to_world[:3, 3]) @ forward
    depth = np.where(aovs["shape_index"][..., 0] > 0, away, 0.0)
    backdrop = _seen(loaded, loaded.world, camera, sensor, ~shown)
    backdrop = np.where(shown[..., None], _seen(loaded, loaded.behind, camera, sensor, shown), backdrop)
    return SceneFrame(gbuffers, backdrop, depth, aovs["sh_normal"])


def _gbuffer(loaded: Loaded, key: str, cloth: Cloth, camera: Camera, mask: Mask, aovs: dict[str, Float64]) -> GBuffer:
    """Return the G-buffer of one cloth, whose pixels are `mask`."""
    options = loaded.options
    # At a pole of Mitsuba's sphere, say, there are no derivatives: such a pixel is cloth, but no place.
    pixel = np.flatnonzero(mask & np.all([np.isfinite(plane).all(axis=-1) for plane in aovs.values()], axis=0))
    found = {name: plane.reshape(-1, plane.shape[-1])[pixel] for name, plane in aovs.items()}
    for name in ("duv_dx", "duv_dy"):
        found[name] = found[name] * camera.widening(found["position"])[:, None]
    places = places_of(loaded, key, cloth, found)
    axes, sizes, _ = np.linalg.svd(places.jacobian)
    sigma = np.clip(options.pixel_sigma * sizes, LEAST_SIGMA, options.largest_sigma)
    viewer = camera.to_viewer(places.position)
    side = np.where(dot(places.outward, viewer) < 0.0, -1.0, 1.0)
    straight = np.einsum("nij,nj->ni", places.frame, viewer)
    wo = tilted(straight, side, options.largest_angle)
    curvature, rim = np.zeros(len(wo)), np.zeros(0, np.int64)
    front = np.flatnonzero(side > 0.0)
    if options.curvature != "none" and front.size:
        seen = Places(*(column[front] for column in places))
        curvature[front] = curvature_of(loaded, seen, wo[front])
        if options.curvature == "minimum":
            curvature[front] = least_curvature(loaded, seen, straight[front], curvature[front])
        rim = front[rims_of(loaded, seen, straight[front], curvature[front])]
    (u, v), (sigma_major, sigma_minor) = places.uv.T, sigma.T
    angle, lit = np.arctan2(axes[:, 1, 0], axes[:, 0, 0]), _lit(loaded, places)
    return GBuffer(mask, pixel, u, v, sigma_major, sigma_minor, angle, curvature, wo, *lit, rim, straight[rim])


def _lit(loaded: Loaded, places: Places) -> tuple[Index, Float64, Float64]:
    """Return of each query, sorted by place: the place, the direction to a light in sight, and its irradiance."""
    beside = off(places.position)
    index, towards, power = [], [], []
    for light in loaded.lights:
        direction, _, _ = light.reach(places.position)
        wi = np.einsum("nij,nj->ni", places.frame, direction)
        facing = dot(places.outward, direction)
        candidates = (wi[:, 2] * facing > 0.0) & (np.abs(wi[:, 2]) > 1e-6)
        start = places.position + (beside * np.sign(facing))[:, None] * places.outward
        irradiance = np.zeros_like(direction)
        for part in light.parts or (light,):
            towards_part, distance, strength = part.reach(places.position)
            # What lies beyond the surface is as much in sight as the light itself.
            beyond = dot(places.outward, towards_part) * facing <= 0.0
            ray = np.where(beyond[:, None], direction, towards_part)
            free = in_sight(loaded.mi, loaded.world, start, ray, distance, candidates)
            irradiance[free] += strength[free]
        lit = np.flatnonzero(irradiance.any(axis=1))
        index.append(lit)
        towards.append(wi[lit])
        power.append(irradiance[lit])
    place = np.concatenate(index)
    order = np.argsort(place, kind="stable")
    return place[order], np.concatenate(towards)[order], np.concatenate(power)[order]


def _refuse_inside(loaded: Loaded, camera: Camera) -> None:
    """Refuse a camera within a yarn spacing of cloth, and one that sees the back of cloth wherever it looks."""
    around = fibonacci(_LOOKS)
    origin = np.broadcast_to(camera.to_world[:3, 3], around.shape)
    hits = first_hits(loaded.mi, loaded.dressed, origin, around)
    finest = max(max(cloth.yarns) for cloth, _ in loaded.cloths.values())
    touching = hits.distance < np.linalg.norm(hits.dp_du, axis=-1) / finest
    if touching.any() or (dot(hits.normal, around) > 0.0).all():
        place = tuple(round(float(x), 4) for x in camera.to_world[:3, 3])
        raise BadInput(f"scene {loaded.scene.name}", "camera", place, "inside the cloth; a camera must be outside it")


def _seen(loaded: Loaded, world: Any, camera: Camera, sensor: Any, wanted: Mask) -> Float64:
    """Return the radiance of the wanted pixels, and that of the environment where a ray leaves the scene."""
    mi = loaded.mi
    integrator = mi.load_dict({"type": "direct"})
    # Where a ray leaves the scene, Mitsuba returns the environment as it is.
    picture = np.asarray(mi.render(world, sensor=sensor, integrator=integrator, spp=1), np.float64)[..., :3].copy()
    aovs = aovs_of(mi, world, sensor, _AOVS_BESIDE)
    mask = wanted & (aovs["shape_index"][..., 0] > 0)
    position, geometric, normal, albedo = (aovs[name][mask] for name in _AOVS_BESIDE[:4])
    viewer = camera.to_viewer(position)
    geometric, normal = (unit(n * np.where(dot(n, viewer) < 0.0, -1.0, 1.0)[:, None]) for n in (geometric, normal))
    total, start = np.zeros_like(position), position + off(position)[:, None] * geometric
    for light in chain.from_iterable(light.parts or (light,) for light in loaded.lights):
        direction, distance, irradiance = light.reach(position)
        cosine = np.maximum(dot(normal, direction), 0.0)
        free = in_sight(mi, world, start, direction, distance, (cosine > 0.0) & (dot(geometric, direction) > 0.0))
        total[free] += irradiance[free] * cosine[free, None]
    picture[mask] = albedo * total / math.pi
    return picture
