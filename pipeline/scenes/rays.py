"""Rays in bulk through a Mitsuba scene, whichever variant is set, and AOVs: what is known of the surface they meet."""

from collections.abc import Sequence
from typing import Any, Final, NamedTuple

import numpy as np

from pipeline.compiled.arrays import Float64, Index, Mask

_OFF = 2e-5  # float32 knows a position to 6e-8 of its size
_CHANNELS: Final = {"uv": 2, "duv_dx": 2, "duv_dy": 2, "shape_index": 1}  # of AOVs; all others have 3


class FirstHits(NamedTuple):
    """Where N rays hit first; NaN where they miss."""

    distance: Float64  # in lengths of the direction, (N,)
    normal: Float64  # shading normal, (N, 3)
    dp_du: Float64  # change of position with u, (N, 3)


def in_sight(mi: Any, world: Any, origin: Float64, direction: Float64, distance: Float64, among: Mask) -> Index:
    """Return which rays `among` N, (N,), hit nothing nearer than `distance` (inf: nothing at all), as indices."""
    index = np.flatnonzero(among)
    origin, direction, distance = origin[index], direction[index], distance[index] * (1.0 - 1e-4)
    if mi.variant().startswith("scalar") or not len(origin):
        # Points and vectors made here: Mitsuba takes longer to convert lists than to trace the ray.
        rays = zip(origin.tolist(), direction.tolist(), distance.tolist(), strict=True)
        made = (mi.Ray3f(mi.Point3f(*o), mi.Vector3f(*d), t, 0.0, []) for o, d, t in rays)
        blocked = np.fromiter(map(world.ray_test, made), np.bool_, len(origin))
    else:
        blocked = np.asarray(world.ray_test(_rays(mi, origin, direction, distance)))
    return index[~blocked]


def first_hits(mi: Any, world: Any, origin: Float64, direction: Float64) -> FirstHits:
    """Return where N rays hit first."""
    if mi.variant().startswith("scalar") or not len(origin):
        found = np.full((len(origin), 7), np.nan)
        for row, (o, d) in enumerate(zip(origin.tolist(), direction.tolist(), strict=True)):
            hit = world.ray_intersect(mi.Ray3f(mi.Point3f(*o), mi.Vector3f(*d)))
            if hit.is_valid():
                found[row] = [hit.t, *hit.sh_frame.n, *hit.dp_du]
    else:
        hit = world.ray_intersect(_rays(mi, origin, direction, np.full(len(origin), np.inf)))
        columns = (np.asarray(column, np.float64) for column in (hit.t, hit.sh_frame.n, hit.dp_du))
        planes = np.concatenate([column.reshape(-1, len(origin)).T for column in columns], axis=1)
        found = np.where(np.asarray(hit.is_valid())[:, None], planes, np.nan)
    return FirstHits(found[:, 0], found[:, 1:4], found[:, 4:])


def radiance(mi: Any, environment: Any, direction: Float64) -> Float64:
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


def off(position: Float64) -> Float64:
    """Return how far beside each place of a surface a ray should start, (N,)."""
    return np.asarray(_OFF * (1.0 + np.abs(position).max(axis=-1, initial=0.0)))


def _rays(mi: Any, origin: Float64, direction: Float64, distance: Float64) -> Any:
    o, d = (vector.T.astype(np.float32) for vector in (origin, direction))
    return mi.Ray3f(mi.Point3f(*o), mi.Vector3f(*d), mi.Float(distance.astype(np.float32)), 0.0, [])


def aovs_of(mi: Any, world: Any, sensor: Any, names: Sequence[str]) -> dict[str, Float64]:
    """Render AOVs by name, each (H, W, channels), with one ray a pixel and a box filter; 0 where it hits nothing."""
    integrator = mi.load_dict({"type": "aov", "aovs": ",".join(f"{name}:{name}" for name in names)})
    planes = np.asarray(mi.render(world, sensor=sensor, integrator=integrator, spp=1), np.float64)
    ends = np.cumsum([_CHANNELS.get(name, 3) for name in names])[:-1]
    return dict(zip(names, np.split(planes, ends, axis=-1), strict=True))


def shape_numbers(mi: Any, shapes: Sequence[Any]) -> list[int]:
    """Return the number that the AOV `shape_index` has where each of a scene's shapes is seen.

    That is 1, 2, … in the order of the scene in Mitsuba's scalar variants. In the others it is the number under which
    Mitsuba has registered the shape, which depends on what was made first.
    """
    if mi.variant().startswith("scalar"):
        return list(range(1, len(shapes) + 1))
    import drjit

    numbers: list[Any] = [drjit.reinterpret_array(mi.UInt32, mi.ShapePtr(shape)) for shape in shapes]
    return [int(number[0]) for number in numbers]
