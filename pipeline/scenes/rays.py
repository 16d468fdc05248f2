"""Rays in bulk through a Mitsuba scene, whichever variant is set: one at a time where it is scalar."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]


_OFF = 2e-5  # float32 knows a position to 6e-8 of its size


class Hits(NamedTuple):
    """Where N rays hit first; NaN where they miss."""

    distance: Floats
    """In lengths of the direction, (N,)."""
    normal: Floats
    """Shading normal, (N, 3)."""
    dp_du: Floats
    """Change of position with u, (N, 3)."""


def blocked(mi: Any, world: Any, origin: Floats, direction: Floats, distance: Floats) -> npt.NDArray[np.bool_]:
    """Return which of N rays hit anything nearer than `distance` (inf: anything)."""
    if mi.variant().startswith("scalar") or not len(origin):
        # Points and vectors made here: Mitsuba takes longer to convert lists than to trace the ray.
        rays = zip(origin.tolist(), direction.tolist(), distance.tolist(), strict=True)
        made = (mi.Ray3f(mi.Point3f(*o), mi.Vector3f(*d), t, 0.0, []) for o, d, t in rays)
        return np.fromiter(map(world.ray_test, made), np.bool_, len(origin))
    return np.asarray(world.ray_test(_rays(mi, origin, direction, distance)))


def first_hits(mi: Any, world: Any, origin: Floats, direction: Floats) -> Hits:
    """Return where N rays hit first."""
    if mi.variant().startswith("scalar") or not len(origin):
        found = np.full((len(origin), 7), np.nan)
        for row, (o, d) in enumerate(zip(origin.tolist(), direction.tolist(), strict=True)):
            hit = world.ray_intersect(mi.Ray3f(mi.Point3f(*o), mi.Vector3f(*d)))
            if hit.is_valid():
                found[row] = [hit.t, *hit.sh_frame.n, *hit.dp_du]
    else:
        hit = world.ray_intersect(_rays(mi, origin, direction, np.full(len(origin), np.inf)))
        planes = [
            np.asarray(column, np.float64).reshape(-1, len(origin)).T for column in (hit.t, hit.sh_frame.n, hit.dp_du)
        ]
        found = np.where(np.asarray(hit.is_valid())[:, None], np.concatenate(planes, axis=1), np.nan)
    return Hits(found[:, 0], found[:, 1:4], found[:, 4:])


def radiance(mi: Any, environment: Any, direction: Floats) -> Floats:
    """Return an environment light's linear RGB radiance from N directions, (N, 3)."""
    if mi.variant().startswith("scalar"):
        hit = mi.SurfaceInteraction3f()
        found = np.empty((len(direction), 3))
        for row, backwards in enumerate((-direction).tolist()):
            hit.wi = backwards
            found[row] = environment.eval(hit)
        return found
    import drjit

    hit = drjit.zeros(mi.SurfaceInteraction3f, len(direction))
    hit.wi = mi.Vector3f(*(-direction.T.astype(np.float32)))
    return np.broadcast_to(np.asarray(environment.eval(hit), np.float64).T, (len(direction), 3))


def off(position: Floats) -> Floats:
    """Return how far beside each place of a surface a ray should start, (N,)."""
    return np.asarray(_OFF * (1.0 + np.abs(position).max(axis=-1, initial=0.0)))


def _rays(mi: Any, origin: Floats, direction: Floats, distance: Floats) -> Any:
    o, d = (vector.T.astype(np.float32) for vector in (origin, direction))
    return mi.Ray3f(mi.Point3f(*o), mi.Vector3f(*d), mi.Float(distance.astype(np.float32)), 0.0, [])
