"""Places of a cloth in the world: its own frame, scale and turn, and how it curves.

Local frame: z is the shading normal, x the direction of dp_du in the tangent plane, turned by the cloth's `turn`, y the
third. Yarn spacings are measured along dp_du and dp_dv as they are; how unevenly the uv stretch the cloth shows in its
footprints, and shear is ignored (or refused: `largest_shear`).

Curvature along the view ray: with t the unit tangent towards the viewer, kappa = dn.t / dp.t between the two places
that lie `_STEP` yarn spacings off along t and -t, n being the shading normal: Euler's k1 cos^2 + k2 sin^2, exact on a
cylinder. Mitsuba's own derivative of the normal is by uv on its analytic shapes and by barycentric coordinates on its
meshes, so it is not used. It is 0 in concave places and for a viewer behind the cloth.

The parabola of a view ray takes this curvature for that of its whole way. Where a bend ends, a ray would then leave the
boundary that in truth sinks into it. `least_curvature` is the least on that way [Kuznetsov2022Curved]: over a stretch
of the surface past the place, in the plane of ray and normal, as long as the ray takes to come up again, or to sink by
a yarn spacing if that is shorter. It is kappa = dn.dp / dp.dp from each of `_PROBES` places to the next, exact on a
cylinder; it is sought where a view ray may leave the boundary again.

Such a place is at a silhouette if past it the ray meets no other cloth, which could not be shown there.
"""

import math
from typing import Final, NamedTuple

import numpy as np

from pipeline.compiled.arrays import Float64, Index, Mask
from pipeline.scenes.loading import Loaded
from pipeline.scenes.rays import first_hits, in_sight
from pipeline.scenes.scene import Cloth
from pipeline.truth.query import STEEPEST_CURVATURE
from weaves.errors import BadInput

_STEP = 0.1  # in yarn spacings
_PROBES = 6
_DEEPEST = 4.0  # yarn spacings by which the heights of a cloth differ at most
LEAST_CURVATURE: Final = 1e-4
"""Curvature that counts as 0, 1/yarn spacings: rounding makes it of planes; it drops .001 over four spacings."""


class Places(NamedTuple):
    """N places of one cloth in the world, the cloth's own scale and turn applied."""

    position: Float64
    outward: Float64  # geometric normal on the shading normal's side, (N, 3)
    frame: Float64  # rows x, y, z, (N, 3, 3)
    uv: Float64  # in yarn spacings, (N, 2)
    jacobian: Float64  # d(uv)/d(pixel), (N, 2, 2)
    tangents: Float64  # columns: the world's length along u and along v of one yarn spacing, (N, 3, 2)


def places_of(loaded: Loaded, key: str, cloth: Cloth, found: dict[str, Float64]) -> Places:
    """Bring the AOVs of a cloth's pixels into its scale and turn."""
    normal = unit(found["sh_normal"])
    outward = found["geo_normal"] * np.where(dot(found["geo_normal"], normal) < 0.0, -1.0, 1.0)[:, None]
    du, dv = found["dp_du"], found["dp_dv"]
    # Left-handed coordinates count v backwards.
    handed = np.where(dot(np.cross(du, dv), normal) < 0.0, -1.0, 1.0)
    yarns = np.stack([np.ones_like(handed), handed], axis=-1) * cloth.yarns
    jacobian = np.stack([found["duv_dx"], found["duv_dy"]], axis=-1) * yarns[..., None]
    _refuse_shear(loaded, key, du, dv)

    # From u, v in yarns to the coordinates along weft and warp.
    cosine, sine = math.cos(math.radians(cloth.turn)), math.sin(math.radians(cloth.turn))
    turn = np.array([[cosine, sine], [-sine, cosine]])
    x = unit(du - dot(du, normal)[:, None] * normal)
    y = np.cross(normal, x)
    across = np.einsum("ij,njk->nik", turn, np.stack([x, y], axis=1))
    frame = np.concatenate([across, normal[:, None]], axis=1)
    tangents = np.stack([du, dv], axis=-1) / cloth.yarns
    return Places(found["position"], outward, frame, (found["uv"] * yarns) @ turn.T, turn @ jacobian, tangents)


def tilted(wo: Float64, side: Float64, largest_angle: float) -> Float64:
    """Lift directions that are more grazing than allowed, or on the wrong side, up to the limit."""
    least = math.cos(math.radians(largest_angle))
    grazing = side * wo[:, 2] < least
    flat = wo[grazing, :2] / np.linalg.norm(wo[grazing, :2], axis=-1, keepdims=True)
    lifted = wo.copy()
    lifted[grazing, :2], lifted[grazing, 2] = math.sqrt(1.0 - least**2) * flat, least * side[grazing]
    return lifted


def curvature_of(loaded: Loaded, places: Places, wo: Float64) -> Float64:
    """Return the curvature along the view ray in 1/yarn spacings."""
    tangent, spacing = _along_view(places, wo)
    step, normal = _STEP * spacing[:, None], places.frame[:, 2]
    moves, turns = [], []
    for sign in (1.0, -1.0):
        start = places.position + step * (sign * tangent + normal)
        hits = first_hits(loaded.mi, loaded.dressed, start, -normal)
        # What is missed, or lies on another surface, stays where it is.
        near = ((hits.distance < 3.0 * step[:, 0]) & (dot(hits.normal, normal) > 0.0))[:, None]
        moves.append(np.where(near, sign * step * tangent, 0.0))
        turns.append(np.where(near, hits.normal, normal))
    moved = dot(moves[0] - moves[1], tangent)
    bend = dot(turns[0] - turns[1], tangent) / np.where(moved > 0.0, moved, 1.0)
    kappa = np.where(bend * spacing > LEAST_CURVATURE, bend * spacing, 0.0)
    return np.asarray(np.minimum(kappa, STEEPEST_CURVATURE))


def least_curvature(loaded: Loaded, places: Places, wo: Float64, at_place: Float64) -> Float64:
    """Return the least curvature along the view ray past N places, which have `at_place`, (N,).

    `wo` are tilted nowhere. Where no ray leaves the boundary, it is that at the place.
    """
    slope, shallow = _shallow(wo, at_place)
    result = at_place.copy()
    if not shallow.any():
        return result
    places, least = Places(*(column[shallow] for column in places)), at_place[shallow]
    tangent, spacing = _along_view(places, wo[shallow])
    slope = np.maximum(slope[shallow], 1e-6)
    stretch = np.maximum(np.minimum(2.0 * slope / least, 1.0 / slope), _PROBES * _STEP)
    normal = places.frame[:, 2]
    place, turned = places.position, normal
    for probe in range(1, _PROBES + 1):
        along = (stretch * spacing * probe / _PROBES)[:, None] * -tangent
        start = places.position + along + (_STEP * spacing)[:, None] * normal
        hits = first_hits(loaded.mi, loaded.dressed, start, -normal)
        met = start - hits.distance[:, None] * normal
        square = dot(met - place, met - place)
        # What is missed, or lies on another surface, says nothing.
        near = (hits.distance < (stretch + 2.0 * _STEP) * spacing) & (dot(hits.normal, normal) > 0.0) & (square > 0.0)
        bend = dot(hits.normal - turned, met - place) / np.where(near, square, 1.0) * spacing
        least = np.where(near, np.minimum(least, bend), least)
        place, turned = (np.where(near[:, None], new, old) for new, old in ((met, place), (hits.normal, turned)))
    result[shallow] = np.where(least > LEAST_CURVATURE, least, 0.0)
    return result


def rims_of(loaded: Loaded, places: Places, wo: Float64, curvature: Float64) -> Index:
    """Return which of N places are at a silhouette, as indices; `wo` are tilted nowhere."""
    slope, shallow = _shallow(wo, curvature)
    # Past the place where a ray comes up again.
    _, spacing = _along_view(places, wo)
    chord = 2.0 * np.maximum(slope, 0.0) / np.where(shallow, curvature, 1.0)
    away = -np.einsum("nij,ni->nj", places.frame, wo)
    start = places.position + ((2.0 * chord + 1.0) * spacing)[:, None] * away
    return in_sight(loaded.mi, loaded.dressed, start, away, np.full(len(wo), np.inf), shallow)


def _shallow(wo: Float64, curvature: Float64) -> tuple[Float64, Mask]:
    """Return the slopes of view rays to the tangent plane, (N,), and whether they may leave the cloth again."""
    slope = wo[:, 2] / np.maximum(np.linalg.norm(wo[:, :2], axis=-1), 1e-12)
    return slope, (curvature > 0.0) & ((slope <= 0.0) | (slope * slope < 2.0 * _DEEPEST * curvature))


def _along_view(places: Places, wo: Float64) -> tuple[Float64, Float64]:
    """Return the unit tangents towards the viewer, (N, 3), and the world's length of a yarn spacing along them."""
    # A viewer on the normal looks along x.
    flat = np.where(np.linalg.norm(wo[:, :2], axis=-1, keepdims=True) > 1e-6, wo[:, :2], [1.0, 0.0])
    tangent = unit(np.einsum("ni,nij->nj", flat, places.frame[:, :2]))
    yarns = np.linalg.norm(np.einsum("nij,nj->ni", np.linalg.pinv(places.tangents), tangent), axis=-1)
    return tangent, 1.0 / np.maximum(yarns, 1e-12)


def _refuse_shear(loaded: Loaded, key: str, du: Float64, dv: Float64) -> None:
    """Refuse cloth whose coordinates are sheared more than allowed."""
    cosine = np.abs(dot(unit(du), unit(dv)))
    shear = math.degrees(math.asin(min(float(cosine.max(initial=0.0)), 1.0)))
    if shear > loaded.options.largest_shear:
        allowed = f"at most {loaded.options.largest_shear:g}"
        raise BadInput(f"scene {loaded.scene.name}", f"fabric_{key}", f"sheared by {shear:.1f} degrees", allowed)


def dot(a: Float64, b: Float64) -> Float64:
    """Return the dot products of N pairs of vectors, (N,)."""
    return np.asarray(np.einsum("ni,ni->n", a, b))


def unit(vectors: Float64) -> Float64:
    """Return the unit vectors along N vectors, (N, 3); 0 for 0."""
    return np.asarray(vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-300))
