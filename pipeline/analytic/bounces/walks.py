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

Yarns that transmit light, and gaps, take walks to the other face of the cloth, whose heights are those of its back,
reflected in the fabric plane. A point sends on light in two ways. It reflects what comes from its own side. It
transmits what its place on the other face receives, by the same rule with opposite directions, if that face sees where
it comes from; walls transmit nothing. A walk that passes the fabric plane in a gap goes on over the other face. Light
is that of the sun on either side, and a, b, c, d are families with a way each: colours k_d, then k_dt.
"""

import math
from concurrent.futures import ThreadPoolExecutor
from functools import reduce
from typing import Final, NamedTuple

import numpy as np

from pipeline.compiled.arrays import Float32, Float64
from pipeline.compiled.decorators import inlined_kernel, kernel
from pipeline.cores import cores
from pipeline.truth.footprint.sequences import derive, uniform
from pipeline.truth.geometry.first_hit import MISSED, ON_WALL, first_hit
from pipeline.truth.geometry.heightfield import BLEND, GAP, RADIUS, UNDER, WARP, WEFT, HeightField, surface_at
from pipeline.truth.geometry.march import ray, wrap
from pipeline.truth.geometry.pieces import Cell, CellPiece, cell_pieces, leaders
from pipeline.truth.geometry.visibility import gap_clear, visible

_FEWEST: Final = 16  # points of the smallest piece; fewer of a cloth with so many that all walks are shared out
_OFF: Final = 1e-9  # distance from a wall at which walks go on: beyond its rounding, on the open side
_IN_GAP: Final = 64  # points of a gap
_OF_CELL: Final = 4  # walks from a cell, at least
_PARTS: Final = 4  # of the walks, whose sums are added in their order: no bit depends on the number of threads
_LONGEST: Final = 4  # yarns at which a walk counts the sun's light, from its third on
# Root of x^5 = x + 1: its inverse powers are the steps of the additive sequence in four dimensions [Roberts2018R2].
_FOUR: Final = 1.16730397826141868


class Start(NamedTuple):
    """Points from which walks start, spread over the visible yarns of a repeat."""

    x: Float64
    y: Float64
    """Places in the first cell of each kind, (P,)."""
    area: Float64  # the area of the fabric plane that each stands for, (P,)
    first: Float64
    second: Float64
    """Random numbers of the first direction, (P,)."""


class Transport(NamedTuple):
    """Sums of walks of W ways: 1 if yarns reflect light alone, 2 if they transmit it as well.

    Families f are 0 for the warp, 1 for the weft; way 0 reflects, 1 transmits. Places are 2 face + f, P = 2 W of them;
    colours, a and b, are 2 way + f; c and d are P way + place, Q = W P of them. Lights behind follow those in front.
    """

    seen: Float64  # visible area towards each viewer, gaps included, (O,)
    reached: Float64
    """Of it, what has its light from two yarns and more: seen as a, from b, which has it from a place, (O, P, P, P)."""
    second: Float32  # the sun's light of each direction that is seen as a and comes from b, (O, P, P, W I)
    third: Float32  # the sun's light of each direction that comes from c, by the way of a, (O, W, W I)
    further: Float64  # of the visible area, what has its light from three yarns and more, by the way of a, (O, W)
    transfers: Float64
    """Of walks that have met b and then c, in P Q rows, those that go on to each place; of walks that meet d later, in
    Q rows, the same, (P Q + Q, P)."""
    later: Float64
    """The sun's light on c, and on d, of each direction on the side where they have it from, and the number of these
    walks in the last column, (P Q + Q, I + 1)."""


class _Place(NamedTuple):
    """A point of a walk: its face of the cloth, and there place, side and family of its yarn, and normal."""

    face: int
    x: float
    y: float
    z: float
    side: int
    family: int
    nx: float
    ny: float
    nz: float


class _Job(NamedTuple):
    """Input and sums of all walks: both faces of the cloth, ways, directions of light, and scratch for these."""

    front: HeightField
    back: HeightField
    ways: int
    lights: Float64
    light: Float32
    sums: Transport


def starting_points(field: HeightField, count: int) -> Start:
    """Spread about so many points evenly over what is seen from straight above, in x = r sin v across each yarn.

    Cells that a translation maps onto each other share their points. Of a cloth with very many different cells some
    are chosen at random.
    """
    pieces, factor = _pieces(field, count)
    yarns = [(cell, piece) for cell, piece in pieces if piece.family != GAP]
    areas = np.array([2.0 * piece.radius * (piece.along[1] - piece.along[0]) for _, piece in yarns])
    fewest = min(_FEWEST, max(count // len(yarns), 1))
    counts = np.maximum(np.ceil(count * areas / areas.sum()).astype(np.int64), fewest)
    shift = np.array([[uniform(np.uint64(0), number, d) for number in range(len(yarns))] for d in range(4)])
    rows = [(*cell, *piece.along, piece.radius, piece.family) for cell, piece in yarns]
    of = np.repeat(np.arange(len(yarns)), counts)  # the piece of each point
    pick, end, low, high, radius, family = np.array(rows, np.float64)[of].T
    point = np.arange(len(of)) - (np.cumsum(counts) - counts)[of]
    numbers = (shift[:, of] + _FOUR ** -np.arange(1.0, 5.0)[:, None] * point) % 1.0
    v = np.pi * (numbers[0] - 0.5)
    across, along = 0.5 + radius * np.sin(v), low + (high - low) * numbers[1]
    x, y = np.where(family == WARP, (across, along), (along, across))
    share = np.pi * radius * np.cos(v) * (high - low) / counts[of] * factor
    return Start(*np.stack([end + x, pick + y, share, numbers[2], numbers[3]]))


def transport(
    field: HeightField, count: int, viewers: Float64, lights: Float64, back: HeightField | None = None
) -> Transport:
    """Return the sums over about `count` walks, for unit vectors of viewers, (O, 3), and of lights, (I, 3), z > 0.

    With the back of the cloth, yarns transmit light as well, and lights are on both sides, those behind reflected.
    """
    o, i, ways = len(viewers), len(lights), 1 if back is None else 2
    places, events = 2 * ways, 2 * ways * ways
    faces, starts = (field, field if back is None else back), starting_points(field, count)
    borders = np.linspace(0, len(starts.x), _PARTS + 1).astype(np.int64)

    def part(index: int) -> Transport:
        own = Transport(
            np.zeros(o),
            np.zeros((o, places, places, places)),
            np.zeros((o, places, places, ways * i), np.float32),
            np.zeros((o, ways, ways * i), np.float32),
            np.zeros((o, ways)),
            np.zeros(((places + 1) * events, places)),
            np.zeros(((places + 1) * events, i + 1)),
        )
        job = _Job(*faces, ways, lights, np.empty(i, np.float32), own)
        _walk(job, starts, borders[index], borders[index + 1], viewers, np.empty(o, np.float32))
        return own

    with ThreadPoolExecutor(min(cores(), _PARTS)) as pool:
        sums = Transport(*(reduce(np.add, s) for s in zip(*pool.map(part, range(_PARTS)), strict=True)))
    _see_gaps(*faces, *_gap_points(field, count), viewers, sums.seen)
    return sums


def _gap_points(field: HeightField, count: int) -> tuple[Float64, Float64, Float64]:
    """Return places spread evenly over the gaps of the first cell of each kind, and the area that each stands for."""
    pieces, factor = _pieces(field, count)
    gaps = np.array([(*cell, *piece.box[0], *piece.box[1]) for cell, piece in pieces if piece.family == GAP])
    if not len(gaps):
        return np.empty(0), np.empty(0), np.empty(0)
    points = min(_IN_GAP, max(count // len(gaps), 1))
    pick, end, left, right, low, high = gaps.T[..., None]
    x, y = (0.5 + _FOUR ** -np.arange(1.0, 3.0)[:, None] * np.arange(points)) % 1.0
    area = (right - left) * (high - low) / points * factor * np.ones(points)
    return (end + left + (right - left) * x).ravel(), (pick + low + (high - low) * y).ravel(), area.ravel()


def _pieces(field: HeightField, count: int) -> tuple[list[tuple[Cell, CellPiece]], float]:
    """Return pieces of the first cell of each kind, or of random ones, and the number of kinds over that of these."""
    cells, most = leaders(field), max(count // _OF_CELL, 1)
    factor = max(len(cells) / most, 1.0)
    if factor > 1.0:
        cells = cells[np.sort(np.random.default_rng(0).permutation(len(cells))[:most])]
    return [((pick, end), piece) for pick, end in cells.tolist() for piece in cell_pieces(field, pick, end)], factor


@kernel
def _see_gaps(
    front: HeightField, back: HeightField, x: Float64, y: Float64, area: Float64, viewers: Float64, seen: Float64
) -> None:
    """Add the area of gaps that each viewer sees through: neither face hides it."""
    for p in range(len(x)):
        for k in range(len(viewers)):
            dx, dy, dz = viewers[k, 0], viewers[k, 1], viewers[k, 2]
            if gap_clear(front, back, x[p], y[p], ray(dx, dy, dz, 0.0), ray(-dx, -dy, dz, 0.0)):
                seen[k] += area[p] * dz


@kernel
def _walk(job: _Job, start: Start, begin: int, end: int, viewers: Float64, area: Float32) -> None:
    """Add the walks of some starts to the sums; `area` is scratch."""
    front, ways, light, sums, count = job.front, job.ways, job.light, job.sums, len(job.lights)
    events = 2 * ways * ways
    for p in range(begin, end):
        x, y = start.x[p], start.y[p]
        family, side, z, nx, ny, nz, _, _, _ = surface_at(front, x, y, int(x), int(y))
        if family == GAP or nz <= 0.0:
            continue
        first = _Place(0, x, y, z, side, family, nx, ny, nz)
        for k in range(len(viewers)):
            area[k] = start.area[p] / nz * _facing(front, first, viewers[k, 0], viewers[k, 1], viewers[k, 2])[0]
            sums.seen[k] += area[k]
        choice = uniform(np.uint64(2), p, 0)
        for way_of_a in range(ways):
            a, key = 2 * way_of_a + family, derive(np.uint64(1 + 2 * way_of_a), p)
            met, second = _next(job, first, way_of_a, choice, start.first[p], start.second[p])
            if not met:
                continue
            for way_of_b in range(ways):
                b, lit = 2 * way_of_b + second.family, (second.face ^ way_of_b) * count
                _count(job, second, way_of_b)
                for k in range(len(viewers)):
                    if area[k] > 0.0:
                        for i in range(count):
                            sums.second[k, a, b, lit + i] += area[k] * light[i]
                met, third = _next(job, second, way_of_b, *_numbers(key, 0))
                if not met:
                    continue
                at = 2 * third.face + third.family
                for k in range(len(viewers)):
                    sums.reached[k, a, b, at] += area[k]
                for way in range(ways):
                    lit = (third.face ^ way) * count
                    _count(job, third, way)
                    for k in range(len(viewers)):
                        if area[k] > 0.0:
                            for i in range(count):
                                sums.third[k, way_of_a, lit + i] += area[k] * light[i]
                    kind = b * events + 2 * ways * way + at
                    if _go_on(job, third, way, kind, key, start.area[p]):
                        for k in range(len(viewers)):
                            sums.further[k, way_of_a] += area[k]


@kernel
def _go_on(job: _Job, place: _Place, way: int, kind: int, key: np.uint64, weight: float) -> bool:
    """Add what a walk meets from its third yarn on, whose light is known; return whether it meets a fourth."""
    ways, sums, count = job.ways, job.sums, len(job.lights)
    events = 2 * ways * ways
    for depth in range(_LONGEST):
        if depth:
            _count(job, place, way)
        for i in range(count):
            sums.later[kind, i] += weight * job.light[i]
        sums.later[kind, count] += weight
        met, place = _next(job, place, way, *_numbers(key, 1 + depth))
        if not met:
            return depth > 0
        at = 2 * place.face + place.family
        sums.transfers[kind, at] += weight
        # From the fourth yarn on a walk takes one way of all.
        way = 0 if ways == 1 else int(2.0 * uniform(key, depth, 3))
        kind = 2 * ways * events + 2 * ways * way + at
    return True


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
def _count(job: _Job, place: _Place, way: int) -> None:
    """Write the share of the light of each direction that a point sends on, 1/sr; what it transmits is from behind."""
    field, other = (job.front, job.back) if place.face == 0 else (job.back, job.front)
    blend = field.yarn[place.family, BLEND]
    there = _across(other, place)
    for i in range(len(job.lights)):
        x, y, z = job.lights[i, 0], job.lights[i, 1], job.lights[i, 2]
        if way == 0:
            ply, macro = _facing(field, place, x, y, z)
        else:
            # Light from behind, reflected: its opposite as the point's own face sees it is (-x, -y, z).
            ply, macro = z * place.nz - x * place.nx - y * place.ny, z
            if ply <= 0.0 or place.nz == 0.0 or _facing(other, there, x, y, z)[0] <= 0.0:
                ply, macro = 0.0, 0.0
        job.light[i] = (blend * ply + (1.0 - blend) * macro) / math.pi


@inlined_kernel
def _across(other: HeightField, place: _Place) -> _Place:
    """Return the same place on the other face of the cloth."""
    family, side, z, nx, ny, nz, _, _, _ = surface_at(other, place.x, place.y, int(place.x), int(place.y))
    return _Place(1 - place.face, place.x, place.y, z, side, family, nx, ny, nz)


@kernel
def _next(job: _Job, place: _Place, way: int, choice: float, a: float, b: float) -> tuple[bool, _Place]:
    """Return whether a walk goes on to another yarn, and where it meets it; three numbers in [0, 1) choose where to."""
    field, other = (job.front, job.back) if place.face == 0 else (job.back, job.front)
    if choice < field.yarn[place.family, BLEND]:
        dx, dy, dz = _cosine_about(place.nx, place.ny, place.nz, a, b)
    else:
        dx, dy, dz = _cosine_about(0.0, 0.0, 1.0, a, b)
    if dx * place.nx + dy * place.ny + dz * place.nz <= 0.0:
        return False, place
    if way == 1:
        if place.nz == 0.0:
            return False, place
        field, other, place = other, field, _across(other, place)
        dx, dy = -dx, -dy
        if dx * place.nx + dy * place.ny + dz * place.nz <= 0.0:
            return False, place
    x, y, z = place.x, place.y, place.z
    hit = first_hit(field, x, y, z, ray(dx, dy, dz, 0.0), place.side)
    face = place.face
    if job.ways == 2 and dz < 0.0 and z > 0.0:
        down = -z / dz
        if hit.what == MISSED or hit.distance > down * math.hypot(dx, dy):
            picks, ends = field.top.shape
            x, y = wrap(x + down * dx, ends), wrap(y + down * dy, picks)
            family, _, _, _, _, _, _, _, _ = surface_at(field, x, y, int(x), int(y))
            if family == GAP:
                face, field, z, dz = 1 - face, other, 0.0, -dz
                hit = first_hit(field, x, y, z, ray(dx, dy, dz, 0.0))
    if hit.what == MISSED:
        return False, place
    if hit.what != ON_WALL:
        family, side, z, nx, ny, nz, _, _, _ = surface_at(field, hit.x, hit.y, hit.end, hit.pick)
        return family != GAP, _Place(face, hit.x, hit.y, z, side, family, nx, ny, nz)
    picks, ends = field.top.shape
    z = z + hit.distance / math.sqrt(dx * dx + dy * dy) * dz
    # Walls stand on borders of the cell and on sides of yarns.
    along_x = _off_border(hit.x - hit.end, field.yarn[WARP, RADIUS])
    along_y = _off_border(hit.y - hit.pick, field.yarn[WEFT, RADIUS])
    nx, ny = (-math.copysign(1.0, dx), 0.0) if along_x < along_y else (0.0, -math.copysign(1.0, dy))
    # The wall is the end of the yarn behind it; walks go on before it.
    family, _, _, _, _, _, _, _, _ = surface_at(field, hit.x - _OFF * nx, hit.y - _OFF * ny, hit.end, hit.pick)
    x, y = wrap(hit.x + _OFF * nx, ends), wrap(hit.y + _OFF * ny, picks)
    return family != GAP, _Place(face, x, y, z, UNDER, family, nx, ny, 0.0)


@kernel
def _cosine_about(nx: float, ny: float, nz: float, a: float, b: float) -> tuple[float, float, float]:
    """Return a unit vector of density cosine / pi about a unit normal, nz >= 0."""
    radius, turn = math.sqrt(a), 2.0 * math.pi * b
    u, v, w = radius * math.cos(turn), radius * math.sin(turn), math.sqrt(1.0 - a)
    # The rotation that turns z into the normal by the shortest way.
    share = (u * nx + v * ny) / (1.0 + nz)
    return u + w * nx - share * nx, v + w * ny - share * ny, w * nz - (u * nx + v * ny)


@inlined_kernel
def _off_border(x: float, radius: float) -> float:
    """Return the distance of a place in a cell from its borders, or from the sides of the yarn along its middle."""
    return min(x, 1.0 - x, abs(abs(x - 0.5) - radius))
