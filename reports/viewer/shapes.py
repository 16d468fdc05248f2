"""Cloth on a plane, a sphere and a drape as the viewer sees it: the geometry of `cloth.slang` in NumPy.

The world has z up; lengths are in yarn spacings. The sphere has its axis along z, so that weft yarns run around it.
The drape hangs in folds: arcs of circles, by turns towards the viewer and away, along which no yarn is stretched.
"""

import math
from typing import Final, Literal, NamedTuple

import numpy as np

from pipeline.compiled.arrays import Float64, Mask
from pipeline.truth.query import Queries

Shape = Literal["plane", "sphere", "drape"]

VIEW_SPREAD: Final = 0.27  # tangent of half the angle of view
HALF_ARC: Final = math.radians(72.0)  # half of the angle of an arc of the drape

RADII: Final = (11.0, 13.0, 9.0, 12.0, 15.0, 10.0, 14.0, 11.0, 8.0, 13.0, 12.0, 10.0)
"""Radii of the arcs, from left to right; the first one comes towards the viewer."""

HALF_HEIGHT: Final = 110.0  # half of the height of the drape
SPHERE_RADIUS: Final = 60.0  # radius of the sphere, rounded so that repeats close around it
_SHADOW = 0.01  # a ray to the light starts so far above the cloth


class Viewpoint(NamedTuple):
    """Shape that the cloth covers, and viewer and light around it, in degrees; a turn of 0 comes from -y.

    `turn` and `tilt` are the direction from the cloth to the viewer, around z and above the horizon, `distance` > 0 is
    in yarn spacings; `target` is the point in the middle of the picture, on the plane alone.
    """

    shape: Shape
    turn: float
    tilt: float
    distance: float
    light_turn: float
    light_tilt: float
    target: tuple[float, float] = (0.0, 0.0)


class Seen(NamedTuple):
    """Pixels that show the cloth, (H, W), row 0 the lowest; those of them that are lit; the queries of these."""

    cloth: Mask
    lit: Mask
    queries: Queries


class _Places(NamedTuple):
    """Where rays meet the cloth: reach (N,), negative if nowhere; uv and its scale (N, 2); x, y and normal (N, 3)."""

    reach: Float64
    uv: Float64
    scale: Float64
    x: Float64
    y: Float64
    n: Float64


def direction(turn: float, tilt: float) -> Float64:
    """Return the unit vector of a turn and a tilt, in degrees."""
    a, b = math.radians(turn), math.radians(tilt)
    return np.array([math.sin(a) * math.cos(b), -math.cos(a) * math.cos(b), math.sin(b)])


def sphere_radius(ends: int) -> float:
    """Return the radius of the sphere for a repeat of `ends` ends: a whole number of repeats closes around it."""
    return max(1, round(2.0 * math.pi * SPHERE_RADIUS / ends)) * ends / (2.0 * math.pi)


def arcs() -> Float64:
    """Return the arcs of the drape, (arcs, 4): middle in x, radius, 1 above or -1 beneath, middle along the cloth."""
    radii = np.array(RADII)
    ends, lengths = np.cumsum(2.0 * radii * math.sin(HALF_ARC)), np.cumsum(2.0 * radii * HALF_ARC)
    middle = len(radii) // 2
    x, along = ends - radii * math.sin(HALF_ARC), lengths - radii * HALF_ARC
    return np.stack([x - x[middle], radii, 1.0 - 2.0 * (np.arange(len(radii)) % 2), along - along[middle]], axis=-1)


def seen(camera: Viewpoint, size: int, ends: int, through: bool = False) -> Seen:
    """Return the pixels of a square picture of `size` pixels with lit cloth; `ends` are those of the repeat.

    With `through` light from behind counts, where nothing is between it and the cloth.
    """
    toward = direction(camera.turn, camera.tilt)
    turn = math.radians(camera.turn)
    right = np.array([math.cos(turn), math.sin(turn), 0.0])
    radius = sphere_radius(ends)
    eye = camera.distance * toward + _middle(camera, toward, radius)
    step = 2.0 * VIEW_SPREAD / size
    to_right, upwards = step * right, step * np.cross(toward, right)
    pixel = np.arange(size) + 0.5 - 0.5 * size
    across, up = (values.ravel() for values in np.meshgrid(pixel, pixel))
    rays = -toward + across[:, None] * to_right + up[:, None] * upwards
    length = np.linalg.norm(rays, axis=1)
    rays /= length[:, None]
    eyes = np.broadcast_to(eye, rays.shape)
    if camera.shape == "sphere":
        places = _on_sphere(eyes, rays, radius)
    else:
        places = _on_plane(eyes, rays) if camera.shape == "plane" else _on_drape(eyes, rays)
    facing = -_dot(rays, places.n)
    cloth = (places.reach > 0.0) & (facing > 0.0)
    light = direction(camera.light_turn, camera.light_tilt)
    side = np.sign(places.n @ light)
    lit = cloth & (side != 0.0 if through and camera.shape != "sphere" else side > 0.0)
    if camera.shape == "drape":
        start = eyes + places.reach[:, None] * rays + _SHADOW * side[:, None] * places.n
        lit &= _on_drape(start, np.broadcast_to(light, rays.shape)).reach <= 0.0
    chosen = _Places(*(column[lit] for column in places))
    ray, reach = rays[lit], (places.reach / length)[lit]
    steps = np.stack([_moves(own, chosen, ray, reach, facing[lit]) for own in (to_right, upwards)], axis=-1)
    frame = np.stack([chosen.x, chosen.y, chosen.n], axis=1)
    wi, wo = frame @ light, -np.einsum("nij,nj->ni", frame, ray)
    axes, sizes, _ = np.linalg.svd(steps)
    angle = np.arctan2(axes[:, 1, 0], axes[:, 0, 0])
    flat = np.zeros(len(wi))
    columns = (*chosen.uv.T, 0.5 * sizes[:, 0], wi, wo, 0.5 * sizes[:, 1], angle, flat)
    queries = Queries(*(np.ascontiguousarray(column, np.float32) for column in columns))
    return Seen(cloth.reshape(size, size), lit.reshape(size, size), queries)


def _middle(camera: Viewpoint, toward: Float64, radius: float) -> Float64:
    """Return the point in the middle of the picture."""
    if camera.shape == "plane":
        return np.array([*camera.target, 0.0])
    if camera.shape == "sphere":
        return radius * toward
    return np.array([0.0, -RADII[len(RADII) // 2] * (1.0 - math.cos(HALF_ARC)), 0.0])


def _moves(step: Float64, places: _Places, ray: Float64, reach: Float64, facing: Float64) -> Float64:
    """Return by how much uv moves if the ray moves by `step`, on the tangent plane, (N, 2)."""
    moved = reach[:, None] * (step + ray * ((places.n @ step) / facing)[:, None])
    return places.scale * np.stack([_dot(moved, places.x), _dot(moved, places.y)], axis=-1)


def _on_plane(eye: Float64, ray: Float64) -> _Places:
    down = ray[:, 2] < 0.0
    reach = np.where(down, -eye[:, 2] / np.where(down, ray[:, 2], 1.0), -1.0)
    axes = (np.broadcast_to(axis, ray.shape) for axis in np.eye(3))
    return _Places(reach, eye[:, :2] + reach[:, None] * ray[:, :2], np.ones((len(ray), 2)), *axes)


def _on_sphere(eye: Float64, ray: Float64, radius: float) -> _Places:
    b = _dot(eye, ray)
    inside = b * b - (_dot(eye, eye) - radius * radius)
    hit = (inside > 0.0) & (b < 0.0)
    reach = np.where(hit, -b - np.sqrt(np.maximum(inside, 0.0)), -1.0)
    n = eye + reach[:, None] * ray
    n /= np.linalg.norm(n, axis=-1, keepdims=True)
    level = np.maximum(np.hypot(n[:, 0], n[:, 1]), 1e-4)
    x = np.stack([-n[:, 1], n[:, 0], np.zeros(len(n))], axis=-1) / level[:, None]
    uv = radius * np.stack([np.arctan2(n[:, 0], -n[:, 1]), np.arcsin(np.clip(n[:, 2], -1.0, 1.0))], axis=-1)
    return _Places(reach, uv, np.stack([1.0 / level, np.ones(len(n))], axis=-1), x, np.cross(n, x), n)


def _on_drape(eye: Float64, ray: Float64) -> _Places:
    places = _Places(
        np.full(len(ray), -1.0), np.zeros((len(ray), 2)), np.ones((len(ray), 2)),
        *(np.tile(axis, (len(ray), 1)) for axis in np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])),
    )  # fmt: skip
    a = np.maximum(ray[:, 0] ** 2 + ray[:, 1] ** 2, 1e-12)
    along = ray[:, :2] * (1.0, -1.0)
    for x, radius, side, middle in arcs():
        start = np.stack([eye[:, 0] - x, -eye[:, 1] + side * radius * math.cos(HALF_ARC)], axis=-1)
        b = _dot(start, along)
        inside = b * b - a * (_dot(start, start) - radius * radius)
        for root in (-1.0, 1.0):
            reach = (-b + root * np.sqrt(np.maximum(inside, 0.0))) / a
            at = (start + reach[:, None] * along) / radius
            height = eye[:, 2] + reach * ray[:, 2]
            own = (inside > 0.0) & (np.abs(at[:, 0]) <= math.sin(HALF_ARC)) & (side * at[:, 1] > 0.0)
            own &= (np.abs(height) <= HALF_HEIGHT) & (reach > 0.0)
            own &= (places.reach < 0.0) | (reach < places.reach)
            n = side * np.stack([at[:, 0], -at[:, 1], np.zeros(len(at))], axis=-1)
            places.reach[own] = reach[own]
            places.n[own] = n[own]
            places.x[own] = np.stack([-n[:, 1], n[:, 0], n[:, 2]], axis=-1)[own]
            turned = np.arctan2(at[:, 0], side * at[:, 1])
            places.uv[own] = np.stack([middle + radius * turned, height], axis=-1)[own]
    return places


def _dot(a: Float64, b: Float64) -> Float64:
    return np.asarray((a * b).sum(axis=-1))
