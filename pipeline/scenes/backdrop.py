"""Everything but cloth: other shapes, matte in their albedo, and the environment where a pixel's ray leaves the scene.

Radiance of a shape = albedo / pi times the sum over the lights in sight of irradiance times cosine, both sides alike:
the lights and shadows of the cloth itself, without noise. Light that shapes or cloth throw on each other is left out.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from pipeline.scenes.aovs import aovs_of
from pipeline.scenes.loading import Camera, Loaded
from pipeline.scenes.places import dot, unit
from pipeline.scenes.rays import blocked, off

Floats = npt.NDArray[np.float64]

_AOVS = {"position": 3, "geo_normal": 3, "sh_normal": 3, "albedo": 3, "shape_index": 1}


def backdrop(loaded: Loaded, camera: Camera, sensor: Any, cloth: npt.NDArray[np.bool_]) -> Floats:
    """Return the linear RGB of a frame without its cloth, (H, W, 3).

    Parameters
    ----------
    loaded, camera : Loaded, Camera
        The scene, and its camera in this frame.
    sensor : Any
        The camera's sensor, of H by W pixels.
    cloth : bool (H, W)
        Pixels that show cloth: there the scene behind it is seen, without its shadows.
    """
    picture = _seen(loaded, loaded.world, camera, sensor, ~cloth)
    return np.where(cloth[..., None], _seen(loaded, loaded.behind, camera, sensor, cloth), picture)


def _seen(loaded: Loaded, world: Any, camera: Camera, sensor: Any, wanted: npt.NDArray[np.bool_]) -> Floats:
    """Return the radiance of the wanted pixels, and that of the environment where a ray leaves the scene."""
    mi = loaded.mi
    integrator = mi.load_dict({"type": "direct"})
    # Where a ray leaves the scene, Mitsuba returns the environment as it is.
    picture = np.asarray(mi.render(world, sensor=sensor, integrator=integrator, spp=1), np.float64)[..., :3].copy()
    aovs = aovs_of(mi, world, sensor, _AOVS)
    mask = wanted & (aovs["shape_index"][..., 0] > 0)
    position, geometric, normal, albedo = (
        aovs[name][mask] for name in ("position", "geo_normal", "sh_normal", "albedo")
    )
    viewer = camera.to_viewer(position)
    geometric, normal = (unit(n * np.where(dot(n, viewer) < 0.0, -1.0, 1.0)[:, None]) for n in (geometric, normal))
    total = np.zeros_like(position)
    for light in loaded.lights:
        direction, distance, irradiance = light.reach(position)
        cosine = np.maximum(dot(normal, direction), 0.0)
        facing = np.flatnonzero((cosine > 0.0) & (dot(geometric, direction) > 0.0))
        start = position[facing] + off(position[facing])[:, None] * geometric[facing]
        free = facing[~blocked(mi, world, start, direction[facing], distance[facing] * (1.0 - 1e-4))]
        total[free] += irradiance[free] * cosine[free, None]
    picture[mask] = albedo * total / math.pi
    return picture
