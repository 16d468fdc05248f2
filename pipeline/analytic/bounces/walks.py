"""Random walks of light from yarn to yarn, backwards from what viewers see, over one repeat seen from above.

A walk starts at a point of the cloth, which many viewers see, and goes on where a diffuse yarn has its light from: with
probability w_d in a direction of density cosine / pi about the ply normal, else about the macro normal, and it ends if
that direction is below the surface. So the yarn receives light from yarns by the rule by which it receives the sun's,
(w_d <wi.n_p> + (1 - w_d) <wi.n_s>) / pi, and no walk weighs more than 1: of white yarns no cloth makes light. It ends
as well where it leaves the cloth. A wall between two floats is a vertical piece of the yarn above.

At each yarn that a walk meets, the sun's light is counted from many directions at once, with exact shadows:

    C2_ab(wi, wo) = mean over points y of family a that wo sees, of the share from wi at the next point x, of family b

Further bounces need less. They are R_abc(wo), the share of what is seen of family a that has its light from family b,
which has it from c; e_bc(wi), the mean of the sun's light on c there; M_bcd, the share of what c sends on that it has
from d. Later points have e'_d and M'_de of their own, the mean of some of them. Where light and transfers are those of
the same points, none is made or lost. What directions of viewer and light have to do with one another in the third
bounce, and what goes on from there of what a viewer sees, is known for all families together.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np

from pipeline.compiled.arrays import Float32, Float64
from pipeline.compiled.decorators import inlined_kernel, kernel
from pipeline.truth.footprint.sequences import derive, uniform
from pipeline.truth.geometry.first_hit import MISSED, ON_WALL, next_hit
from pipeline.truth.geometry.heightfield import BLEND, GAP, RADIUS, UNDER, WARP, WEFT, HeightField, surface_at
from pipeline.truth.geometry.march import ray, wrap
from pipeline.truth.geometry.pieces import cell_pieces, orbits
from pipeline.truth.geometry.visibility import visible

_FEWEST: Final = 16
"""Points of the smallest piece."""
_OFF: Final = 1e-9
"""Distance from a wall at which walks go on, in yarn spacings: beyond its rounding, on the open side."""
_LONGEST: Final = 4
"""Yarns at which a walk counts the sun's light, from its third on."""
_FOUR: Final = 1.16730397826141868
"""Root of x^5 = x + 1: its inverse powers are the steps of the additive sequence in four dimensions [Roberts2018R2]."""


class Start(NamedTuple):
    """Points from which walks start, spread over the visible yarns of a repeat.

    Attributes
    ----------
    x, y : float64 (P,)
        Places in the first cell of each kind.
    area : float64 (P,)
        The area of the fabric plane that each stands for.
    first, second : float64 (P,)
        Random numbers of the first direction.
    """

    x: Float64
    y: Float64
    area: Float64
    first: Float64
    second: Float64


class Transport(NamedTuple):
    """Sums of walks; families a, b, c are 0 for the warp, 1 for the weft.

    Attributes
    ----------
    seen : float64 (O,)
        Visible area towards each viewer.
    reached : float64 (O, 2, 2, 2)
        Of it, what has its light from two yarns and more: seen on a, from b, which has it from c.
    second : float32 (O, 2, 2, I)
        The sun's light of each direction that is seen on a and comes from b.
    third : float32 (O, I)
        The sun's light of each direction that comes from c.
    further : float64 (O,)
        Of the visible area, what has its light from three yarns and more.
    transfers : float64 (6, 2)
        Of walks that have met b and c, in four rows, those that go on to each family; of walks that meet d later, in
        two rows, the same.
    later : float64 (6, I + 1)
        The sun's light of each direction on c, and on d, and the number of these walks in the last column.
    """

    seen: Float64
    reached: Float64
    second: Float32
    third: Float32
    further: Float64
    transfers: Float64
    later: Float64


class _Place(NamedTuple):
    """A point of a walk: place, side and family of its yarn, and normal."""

    x: float
    y: float
    z: float
    side: int
    family: int
    nx: float
    ny: float
    nz: float


def starting_points(field: HeightField, count: int) -> Start:
    """Spread about so many points evenly over what is seen from straight above, in x = r sin v across each yarn.

    Cells that a translation maps onto each other share their points.
    """
    pieces = [(orbit, piece) for orbit in orbits(field) for piece in cell_pieces(field, *orbit[0])]
    yarns = [(orbit, piece) for orbit, piece in pieces if piece.family != GAP]
    areas = np.array([2.0 * piece.radius * (piece.along[1] - piece.along[0]) for _, piece in yarns])
    counts = np.maximum(np.ceil(count * areas / areas.sum()).astype(np.int64), _FEWEST)
    columns = []
    for number, ((orbit, piece), points) in enumerate(zip(yarns, counts.tolist(), strict=True)):
        (pick, end), (low, high) = orbit[0], piece.along
        shift = np.array([uniform(np.uint64(0), number, d) for d in range(4)])
        numbers = (shift[:, None] + _FOUR ** -np.arange(1.0, 5.0)[:, None] * np.arange(points)) % 1.0
        v = np.pi * (numbers[0] - 0.5)
        across, along = 0.5 + piece.radius * np.sin(v), low + (high - low) * numbers[1]
        x, y = (across, along) if piece.family == WARP else (along, across)
        share = np.pi * piece.radius * np.cos(v) * (high - low) / points
        columns.append(np.stack([end + x, pick + y, share, numbers[2], numbers[3]]))
    return Start(*np.ascontiguousarray(np.concatenate(columns, axis=1)))


def transport(field: HeightField, count: int, viewers: Float64, lights: Float64) -> Transport:
    """Return the sums over about `count` walks, for unit vectors of viewers, (O, 3), and of lights, (I, 3), z > 0."""
    o, i = len(viewers), len(lights)
    second, third = np.zeros((o, 2, 2, i), np.float32), np.zeros((o, i), np.float32)
    seen, reached, further = np.zeros(o), np.zeros((o, 2, 2, 2)), np.zeros(o)
    sums = Transport(seen, reached, second, third, further, np.zeros((6, 2)), np.zeros((6, i + 1)))
    _walk(field, starting_points(field, count), viewers, lights, sums, np.empty(o, np.float32), np.empty(i, np.float32))
    return sums


@kernel
def _walk(
    field: HeightField,
    start: Start,
    viewers: Float64,
    lights: Float64,
    sums: Transport,
    area: Float32,
    light: Float32,
) -> None:
    """Add walks to the sums; `area` and `light` are scratch."""
    for p in range(len(start.x)):
        x, y = start.x[p], start.y[p]
        family, side, z, nx, ny, nz, _, _, _ = surface_at(field, x, y, int(x), int(y))
        if family == GAP or nz <= 0.0:
            continue
        place = _Place(x, y, z, side, family, nx, ny, nz)
        for k in range(len(viewers)):
            area[k] = start.area[p] / nz * _facing(field, place, viewers[k, 0], viewers[k, 1], viewers[k, 2])[0]
            sums.seen[k] += area[k]
        key, choice = derive(np.uint64(1), p), uniform(np.uint64(2), p, 0)
        met, place = _next(field, place, choice, start.first[p], start.second[p])
        if not met:
            continue
        _count(field, place, lights, light)
        b = place.family
        for k in range(len(viewers)):
            if area[k] > 0.0:
                for i in range(len(lights)):
                    sums.second[k, family, b, i] += area[k] * light[i]
        met, place = _next(field, place, *_numbers(key, 0))
        if not met:
            continue
        _count(field, place, lights, light)
        for k in range(len(viewers)):
            if area[k] > 0.0:
                sums.reached[k, family, b, place.family] += area[k]
                for i in range(len(lights)):
                    sums.third[k, i] += area[k] * light[i]
        weight = start.area[p]
        kind = 2 * b + place.family
        for depth in range(_LONGEST):
            if depth:
                _count(field, place, lights, light)
            for i in range(len(lights)):
                sums.later[kind, i] += weight * light[i]
            sums.later[kind, len(lights)] += weight
            met, place = _next(field, place, *_numbers(key, 1 + depth))
            if not met:
                break
            if depth == 0:
                for k in range(len(viewers)):
                    sums.further[k] += area[k]
            sums.transfers[kind, place.family] += weight
            kind = 4 + place.family


@inlined_kernel
def _numbers(key: np.uint64, depth: int) -> tuple[float, float, float]:
    return uniform(key, depth, 0), uniform(key, depth, 1), uniform(key, depth, 2)


@inlined_kernel
def _facing(field: HeightField, place: _Place, x: float, y: float, z: float) -> tuple[float, float]:
    """Return the cosines of a direction to the normal of a point and to the macro normal; 0 if the point is hidden."""
    cosine = x * place.nx + y * place.ny + z * place.nz
    if cosine <= 0.0 or not visible(field, place.x, place.y, place.z, place.side, ray(x, y, z, 0.0)):
        return 0.0, 0.0
    return cosine, z


@kernel
def _count(field: HeightField, place: _Place, lights: Float64, light: Float32) -> None:
    """Write the share of the sun's light that a point sends on, 1/sr, for each direction of the sun."""
    blend = field.yarn[place.family, BLEND]
    for i in range(len(lights)):
        ply, macro = _facing(field, place, lights[i, 0], lights[i, 1], lights[i, 2])
        light[i] = (blend * ply + (1.0 - blend) * macro) / math.pi


@kernel
def _next(field: HeightField, place: _Place, choice: float, a: float, b: float) -> tuple[bool, _Place]:
    """Return whether a walk goes on to another yarn, and where it meets it; three numbers in [0, 1) choose the way."""
    if choice < field.yarn[place.family, BLEND]:
        dx, dy, dz = _cosine_about(place.nx, place.ny, place.nz, a, b)
    else:
        dx, dy, dz = _cosine_about(0.0, 0.0, 1.0, a, b)
    if dx * place.nx + dy * place.ny + dz * place.nz <= 0.0:
        return False, place
    hit = next_hit(field, place.x, place.y, place.z, place.side, ray(dx, dy, dz, 0.0))
    if hit.what == MISSED:
        return False, place
    if hit.what != ON_WALL:
        family, side, z, nx, ny, nz, _, _, _ = surface_at(field, hit.x, hit.y, hit.end, hit.pick)
        return family != GAP, _Place(hit.x, hit.y, z, side, family, nx, ny, nz)
    picks, ends = field.top.shape
    z = place.z + hit.distance / math.sqrt(dx * dx + dy * dy) * dz
    nx, ny = _wall_normal(field, hit.x - hit.end, hit.y - hit.pick, dx, dy)
    # The wall is the end of the yarn behind it; walks go on before it.
    family, _, _, _, _, _, _, _, _ = surface_at(field, hit.x - _OFF * nx, hit.y - _OFF * ny, hit.end, hit.pick)
    x, y = wrap(hit.x + _OFF * nx, ends), wrap(hit.y + _OFF * ny, picks)
    return family != GAP, _Place(x, y, z, UNDER, family, nx, ny, 0.0)


@kernel
def _cosine_about(nx: float, ny: float, nz: float, a: float, b: float) -> tuple[float, float, float]:
    """Return a unit vector of density cosine / pi about a unit normal, nz >= 0."""
    radius, turn = math.sqrt(a), 2.0 * math.pi * b
    u, v, w = radius * math.cos(turn), radius * math.sin(turn), math.sqrt(1.0 - a)
    # The rotation that turns z into the normal by the shortest way.
    share = (u * nx + v * ny) / (1.0 + nz)
    return u + w * nx - share * nx, v + w * ny - share * ny, w * nz - (u * nx + v * ny)


@kernel
def _wall_normal(field: HeightField, x: float, y: float, dx: float, dy: float) -> tuple[float, float]:
    """Return the normal of the wall at a point of a cell: walls stand on borders of the cell and on sides of yarns."""
    along_x, along_y = _off_border(x, field.yarn[WARP, RADIUS]), _off_border(y, field.yarn[WEFT, RADIUS])
    if along_x < along_y:
        return -math.copysign(1.0, dx), 0.0
    return 0.0, -math.copysign(1.0, dy)


@inlined_kernel
def _off_border(x: float, radius: float) -> float:
    """Return the distance of a place in a cell from its borders, or from the sides of the yarn along its middle."""
    return min(x, 1.0 - x, abs(abs(x - 0.5) - radius))
