"""One frame of a Mitsuba scene as G-buffers, one for each cloth, by Mitsuba's own AOV integrator.

Every pixel takes one ray through its centre and a box filter, so that nothing is averaged over an edge.

Local frame: z is the shading normal, x the direction of dp_du in the tangent plane, turned by the cloth's `turn`, y the
third. Yarn spacings are measured along dp_du and dp_dv as they are; how unevenly the uv stretch the cloth shows in its
footprints, and shear is ignored (or refused: `largest_shear`).

Footprint: a Gaussian of `pixel_sigma` pixels under J = d(u, v in yarns)/d(pixel), the AOVs duv_dx and duv_dy: its axes
are J's left singular vectors and its standard deviations pixel_sigma times the singular values. Mitsuba takes them over
one pixel to the right and one downwards, on the tangent plane [Igehy1999RayDifferentials].

Curvature along the view ray: with t the unit tangent towards the viewer, kappa = dn.t / dp.t between the two places that
lie `_STEP` yarn spacings off along t and -t, n being the shading normal: Euler's k1 cos^2 + k2 sin^2, exact on a
cylinder. Mitsuba's own derivative of the normal is by uv on its analytic shapes and by barycentric coordinates on its
meshes, so it is not used. It is 0 in concave places and for a viewer behind the cloth.

Light: a light in sight of the place, along a straight ray, is a question; one that another surface hides is none. Cloth
blocks such a ray as if it were opaque. A light on one side of the surface and on the other of its shading normal is
none either.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from pipeline.scenes.gbuffer import GBuffer
from pipeline.scenes.lights import fibonacci
from pipeline.scenes.loading import Camera, Loaded
from pipeline.scenes.options import SceneOptions
from pipeline.scenes.rays import blocked, first_hits
from pipeline.scenes.scene import Cloth
from pipeline.truth.query import STEEPEST_CURVATURE
from weaves.errors import BadInput

Floats = npt.NDArray[np.float64]

_AOVS: Final = {
    "position": 3,
    "uv": 2,
    "geo_normal": 3,
    "sh_normal": 3,
    "dp_du": 3,
    "dp_dv": 3,
    "duv_dx": 2,
    "duv_dy": 2,
    "shape_index": 1,
}
"""What Mitsuba is asked for, and how many channels each has."""
_OFF = 1e-4  # how far beside a surface a ray starts, as a share of the place's distance from the origin, plus 1
_STEP = 0.1  # in yarn spacings
_LEAST_SIGMA = 1e-6
_LOOKS = 128  # directions in which a camera that may be inside the cloth looks around


class Frame(NamedTuple):
    """A frame: what it shows of every cloth, and what is no cloth."""

    gbuffers: dict[str, GBuffer]
    """By the cloth's key; a cloth out of sight has no places."""
    backdrop: Floats
    """Linear RGB of what is seen beside the cloth and, where there is cloth, behind it, (H, W, 3)."""


class _Places(NamedTuple):
    """N places of one cloth in the world, the cloth's own scale and turn applied."""

    position: Floats
    outward: Floats
    """Geometric normal on the shading normal's side, (N, 3)."""
    frame: Floats
    """Rows x, y, z, (N, 3, 3)."""
    uv: Floats
    """In yarn spacings, (N, 2)."""
    jacobian: Floats
    """d(uv)/d(pixel), (N, 2, 2)."""
    tangents: Floats
    """Columns: the world's length along u and along v of one yarn spacing, (N, 3, 2)."""


def render(
    loaded: Loaded,
    frame: float = 0.0,
    size: tuple[int, int] | None = None,
    options: SceneOptions | None = None,
) -> Frame:
    """Return what every pixel of a frame shows.

    Parameters
    ----------
    loaded : Loaded
        The scene.
    frame : float
        Which one; 0 is the first.
    size : (int, int), optional
        Width and height in pixels; the film's unless given.
    options : SceneOptions, optional
        Footprint, curvature and quadrature; those that the scene was loaded with.

    Raises
    ------
    BadInput
        If the camera is inside the cloth, or the cloth's uv coordinates are sheared beyond `largest_shear`.
    """
    options = options or SceneOptions()
    camera = loaded.camera.at(loaded.scene, frame)
    size = size or camera.size
    _refuse_inside(loaded, camera)
    aovs = _aovs(loaded, camera, size)
    gbuffers = {}
    shown = np.zeros((size[1], size[0]), np.bool_)
    for key, (cloth, _) in loaded.cloths.items():
        mask = np.isin(aovs["shape_index"][..., 0], np.array(loaded.worn[key]) + 1)
        gbuffers[key] = _gbuffer(loaded, key, cloth, camera, mask, aovs, options)
        shown |= mask
    return Frame(gbuffers, _backdrop(loaded, camera, size, shown, options))


def _aovs(loaded: Loaded, camera: Camera, size: tuple[int, int]) -> dict[str, Floats]:
    """Render the AOVs of one ray a pixel, each (H, W, channels)."""
    mi = loaded.mi
    asked = ",".join(f"{name}:{name}" for name in _AOVS)
    integrator = mi.load_dict({"type": "aov", "aovs": asked})
    planes = np.asarray(mi.render(loaded.world, sensor=camera.sensor(mi, size), integrator=integrator, spp=1))
    ends = np.cumsum(list(_AOVS.values()))[:-1]
    return dict(zip(_AOVS, np.split(planes.astype(np.float64), ends, axis=-1), strict=True))


def _gbuffer(
    loaded: Loaded,
    key: str,
    cloth: Cloth,
    camera: Camera,
    mask: npt.NDArray[np.bool_],
    aovs: dict[str, Floats],
    options: SceneOptions,
) -> GBuffer:
    """Return the G-buffer of one cloth, whose pixels are `mask`."""
    found = {name: plane[mask] for name, plane in aovs.items()}
    for name in ("duv_dx", "duv_dy"):
        found[name] = found[name] * camera.widening(found["position"])[:, None]
    places = _places(loaded, key, cloth, found, options)
    axes, sizes, _ = np.linalg.svd(places.jacobian)
    sigma = np.clip(options.pixel_sigma * sizes, _LEAST_SIGMA, options.largest_sigma)
    viewer = camera.to_viewer(places.position)
    side = np.where(np.einsum("ni,ni->n", places.outward, viewer) < 0.0, -1.0, 1.0)
    wo = _tilted(np.einsum("nij,nj->ni", places.frame, viewer), side, options.largest_angle)
    curvature = np.zeros(len(wo))
    front = side > 0.0
    if options.curvature == "at_point" and front.any():
        seen = _Places(*(column[front] for column in places))
        curvature[front] = _curvature(loaded, seen, wo[front])
    place, wi, irradiance = _lit(loaded, places)
    return GBuffer(
        mask,
        np.flatnonzero(mask),
        places.uv[:, 0],
        places.uv[:, 1],
        sigma[:, 0],
        sigma[:, 1],
        np.arctan2(axes[:, 1, 0], axes[:, 0, 0]),
        curvature,
        wo,
        place,
        wi,
        irradiance,
    )


def _places(loaded: Loaded, key: str, cloth: Cloth, found: dict[str, Floats], options: SceneOptions) -> _Places:
    """Bring the AOVs of a cloth's pixels into its scale and turn."""
    normal = _unit(found["sh_normal"])
    outward = found["geo_normal"] * np.where(_dot(found["geo_normal"], normal) < 0.0, -1.0, 1.0)[:, None]
    du, dv = found["dp_du"], found["dp_dv"]
    # Left-handed coordinates count v backwards.
    handed = np.where(_dot(np.cross(du, dv), normal) < 0.0, -1.0, 1.0)
    yarns = np.stack([np.ones_like(handed), handed], axis=-1) * cloth.yarns
    jacobian = np.stack([found["duv_dx"], found["duv_dy"]], axis=-1) * yarns[..., None]
    _refuse_shear(loaded, key, du, dv, options)

    turn = _turn(cloth)
    x = _unit(du - _dot(du, normal)[:, None] * normal)
    y = np.cross(normal, x)
    across = np.einsum("ij,njk->nik", turn, np.stack([x, y], axis=1))
    frame = np.concatenate([across, normal[:, None]], axis=1)
    tangents = np.stack([du, dv], axis=-1) / cloth.yarns
    return _Places(found["position"], outward, frame, (found["uv"] * yarns) @ turn.T, turn @ jacobian, tangents)


def _turn(cloth: Cloth) -> Floats:
    """Return the matrix from u, v in yarns to the coordinates along weft and warp."""
    cosine, sine = math.cos(math.radians(cloth.turn)), math.sin(math.radians(cloth.turn))
    return np.array([[cosine, sine], [-sine, cosine]])


def _tilted(wo: Floats, side: Floats, largest_angle: float) -> Floats:
    """Lift directions that are more grazing than allowed, or on the wrong side, up to the limit."""
    least = math.cos(math.radians(largest_angle))
    grazing = side * wo[:, 2] < least
    flat = wo[grazing, :2] / np.linalg.norm(wo[grazing, :2], axis=-1, keepdims=True)
    lifted = wo.copy()
    lifted[grazing, :2], lifted[grazing, 2] = math.sqrt(1.0 - least**2) * flat, least * side[grazing]
    return lifted


def _curvature(loaded: Loaded, places: _Places, wo: Floats) -> Floats:
    """Return the curvature along the view ray in 1/yarn spacings."""
    # A viewer on the normal looks along x.
    flat = np.where(np.linalg.norm(wo[:, :2], axis=-1, keepdims=True) > 1e-6, wo[:, :2], [1.0, 0.0])
    tangent = _unit(np.einsum("ni,nij->nj", flat, places.frame[:, :2]))
    yarns = np.linalg.norm(np.einsum("nij,nj->ni", np.linalg.pinv(places.tangents), tangent), axis=-1)
    spacing = 1.0 / np.maximum(yarns, 1e-12)
    step, normal = _STEP * spacing[:, None], places.frame[:, 2]
    moves, turns = [], []
    for sign in (1.0, -1.0):
        start = places.position + step * (sign * tangent + normal)
        hits = first_hits(loaded.mi, loaded.dressed, start, -normal)
        # What is missed, or lies on another surface, stays where it is.
        near = (hits.distance < 3.0 * step[:, 0])[:, None]
        moves.append(np.where(near, sign * step * tangent, 0.0))
        turns.append(np.where(near, hits.normal, normal))
    moved = _dot(moves[0] - moves[1], tangent)
    bend = _dot(turns[0] - turns[1], tangent) / np.where(moved > 0.0, moved, 1.0)
    return np.clip(bend * spacing, 0.0, STEEPEST_CURVATURE)


def _lit(loaded: Loaded, places: _Places) -> tuple[npt.NDArray[np.int64], Floats, Floats]:
    """Return which places each light in sight reaches, from where, and with which irradiance."""
    off = _off(places.position)
    index, towards, power = [], [], []
    for light in loaded.lights:
        direction, distance, irradiance = light.reach(places.position)
        wi = np.einsum("nij,nj->ni", places.frame, direction)
        facing = _dot(places.outward, direction)
        asked = np.flatnonzero((wi[:, 2] * facing > 0.0) & (np.abs(wi[:, 2]) > 1e-6))
        start = places.position + (off * np.sign(facing))[:, None] * places.outward
        hidden = blocked(loaded.mi, loaded.world, start[asked], direction[asked], distance[asked] * (1.0 - 1e-4))
        free = asked[~hidden]
        index.append(free)
        towards.append(wi[free])
        power.append(irradiance[free])
    return np.concatenate(index), np.concatenate(towards), np.concatenate(power)


def _backdrop(
    loaded: Loaded, camera: Camera, size: tuple[int, int], shown: npt.NDArray[np.bool_], options: SceneOptions
) -> Floats:
    """Render what is no cloth: with the cloth's shadows beside it, without the cloth behind it."""
    mi = loaded.mi
    integrator = mi.load_dict({"type": "direct", "emitter_samples": options.backdrop_samples, "bsdf_samples": 0})
    sensor = camera.sensor(mi, size)
    seen = [
        np.asarray(mi.render(world, sensor=sensor, integrator=integrator, spp=1), np.float64)[..., :3]
        for world in (loaded.behind, loaded.world)
    ]
    return np.where(shown[..., None], *seen)


def _refuse_shear(loaded: Loaded, key: str, du: Floats, dv: Floats, options: SceneOptions) -> None:
    """Refuse cloth whose coordinates are sheared more than allowed."""
    where = f"scene {loaded.scene.name}"
    cosine = np.abs(_dot(_unit(du), _unit(dv)))
    shear = math.degrees(math.asin(min(float(cosine.max(initial=0.0)), 1.0)))
    if shear > options.largest_shear:
        raise BadInput(where, f"fabric_{key}", f"sheared by {shear:.1f} degrees", f"at most {options.largest_shear:g}")


def _refuse_inside(loaded: Loaded, camera: Camera) -> None:
    """Refuse a camera within a yarn spacing of cloth, and one that sees the back of cloth wherever it looks."""
    around = fibonacci(_LOOKS)
    origin = np.broadcast_to(camera.to_world[:3, 3], around.shape)
    hits = first_hits(loaded.mi, loaded.dressed, origin, around)
    finest = max(max(cloth.yarns) for cloth, _ in loaded.cloths.values())
    touching = hits.distance < np.linalg.norm(hits.dp_du, axis=-1) / finest
    if touching.any() or (_dot(hits.normal, around) > 0.0).all():
        place = tuple(round(float(x), 4) for x in camera.to_world[:3, 3])
        raise BadInput(
            f"scene {loaded.scene.name}", "camera", place, "the camera is inside the cloth; move it out of it"
        )


def _off(position: Floats) -> Floats:
    return np.asarray(_OFF * (1.0 + np.abs(position).max(axis=-1, initial=0.0)))


def _dot(a: Floats, b: Floats) -> Floats:
    return np.asarray(np.einsum("ni,ni->n", a, b))


def _unit(vectors: Floats) -> Floats:
    return np.asarray(vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-300))
