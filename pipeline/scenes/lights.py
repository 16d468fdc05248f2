"""Lights of a Mitsuba scene: directional and point lights as they are, environments by a quadrature.

An environment becomes `environment_directions` distant lights on a Fibonacci lattice, which parts the sphere into equal
solid angles. Each carries the mean radiance of the `environment_samples` places of a finer lattice that lie nearest to
it, times their solid angle: irradiances sum to that of the whole environment.

Shadows of an environment are soft: each of its lights is in sight by parts, `_PARTS` smaller lights around it, one
shadow ray each. They share its power as the environment has it, and shine from its own direction.
"""

from __future__ import annotations

import math
from typing import Any, Final, NamedTuple

import numpy as np
from scipy.spatial import KDTree

from pipeline.compiled.arrays import Float64
from pipeline.scenes.options import SceneOptions
from pipeline.scenes.rays import radiance
from weaves.errors import BadInput

_PARTS: Final = 4  # shadow rays of a direction of an environment, on average
_GOLDEN = math.pi * (3.0 - math.sqrt(5.0))


class Light(NamedTuple):
    """A light without extent."""

    distant: bool  # true if it shines from one direction everywhere
    place: Float64  # unit vector to it if distant, else its position, (3,)
    power: Float64  # linear RGB irradiance on a surface that faces it, (3,); of a point light, at distance 1
    parts: tuple[Light, ...] = ()  # lights that it stands for, of which each may be in shadow; none: it is one itself

    def reach(self, position: Float64) -> tuple[Float64, Float64, Float64]:
        """Return unit vectors to the light (N, 3), distances (N,), irradiances on facing surfaces (N, 3)."""
        if self.distant:
            ones = np.ones((len(position), 1))
            return ones * self.place, np.full(len(position), np.inf), ones * self.power
        towards = self.place - position
        distance = np.linalg.norm(towards, axis=-1)
        return towards / distance[:, None], distance, self.power / np.square(distance)[:, None]


def fibonacci(count: int) -> Float64:
    """Return `count` unit vectors that part the sphere into equal solid angles, (count, 3)."""
    k = np.arange(count)
    z = 1.0 - (2.0 * k + 1.0) / count
    across = np.sqrt(1.0 - z * z)
    return np.stack([across * np.cos(_GOLDEN * k), across * np.sin(_GOLDEN * k), z], axis=-1)


def lights_of(mi: Any, world: Any, where: str, options: SceneOptions) -> list[Light]:
    """Return the lights of a scene; BadInput for one that is neither directional, point nor environment."""
    lights: list[Light] = []
    for emitter in world.emitters():
        kind = emitter.class_name()
        if emitter.is_environment():
            lights += _quadrature(mi, emitter, options)
        elif kind in ("DirectionalEmitter", "PointLight"):
            lights.append(_delta(mi, emitter, distant=kind == "DirectionalEmitter"))
        else:
            raise BadInput(where, "emitter", kind, "lights must be directional, point, constant or envmap")
    if not lights:
        raise BadInput(where, "emitter", "none", "a scene needs a light: directional, point, constant or envmap")
    return lights


def _delta(mi: Any, emitter: Any, distant: bool) -> Light:
    """Return a directional light, or a point light with its strength at distance 1."""
    import drjit

    seen_from = drjit.zeros(mi.SurfaceInteraction3f)
    sample, power = emitter.sample_direction(seen_from, mi.Point2f(0.5, 0.5))
    if distant:
        return Light(True, _vector(sample.d), _vector(power))
    place = _vector(sample.p)
    x, y, z = place.tolist()  # Mitsuba's LLVM variant takes no numbers of NumPy
    seen_from.p = mi.Point3f(x + 1.0, y, z)
    return Light(False, place, _vector(emitter.sample_direction(seen_from, mi.Point2f(0.5, 0.5))[1]))


def _quadrature(mi: Any, environment: Any, options: SceneOptions) -> list[Light]:
    towards = fibonacci(options.environment_directions)
    smaller = fibonacci(options.environment_directions * _PARTS)
    fine = fibonacci(options.environment_directions * options.environment_samples)
    power = radiance(mi, environment, fine) * (4.0 * math.pi / len(fine))
    cells = KDTree(towards)
    (_, of_smaller), (_, of_fine) = cells.query(smaller), cells.query(fine)
    lights = []
    for cell, direction in enumerate(towards):
        own, around = power[of_fine == cell], smaller[of_smaller == cell]
        _, nearest = KDTree(around).query(fine[of_fine == cell])
        shares = (own[nearest == part].sum(axis=0) for part in range(len(around)))
        parts = (Light(True, d, share) for d, share in zip(around, shares, strict=True) if share.any())
        lights.append(Light(True, direction, own.sum(axis=0), tuple(parts)))
    return [light for light in lights if light.parts]


def _vector(value: Any) -> Float64:
    return np.asarray(value, np.float64).reshape(-1)
