"""Lobes of a patch: the flakes' lobes at a few points of the footprint and two cosines, to draw directions from.

The points are a fixed set in the footprint, the same at every call, so that the density of a sample is known exactly.
How much of a point the viewer sees is read from a coarse grid of horizons. Each point represents its surroundings:
where tangents differ from point to point by s, its roughness is widened to alpha^2 + (widening s / points)^2; and one
broad lobe a family, as wide as all its tangents, has `BROAD` of its share, so that nothing between the points is
without a sample. At a small footprint all points are alike, and the mixture is the sampler of a point
(pipeline.analytic.importance.mixture) beside the cosines of the diffuse light.

A lobe's share is its visible area, times k_s, times the light scattered once by the layer and not shadowed, about
`SCATTERED` of 1 - exp(-T Lambda); a cosine's is visible area times k_d, on the other side k_dt; that of the light
straight through is the area of gaps, and that of yarns times exp(-T Lambda). Cosines and light straight through have a
little more, because few points may miss what the footprint has: without a sample, light would be lost. Where the light
comes from plays no part: shares change the variance, not the density.
"""

import math
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from pipeline.analytic.soft_horizons import AZIMUTHS, above, around, ramp
from pipeline.analytic.soft_nodes import nodes
from pipeline.analytic.soft_nodes.nodes import BLOCK, BOUND, CURVE, FAMILY, LEVELS, SHIFT, X_HIGH, X_LOW, Y_HIGH, Y_LOW
from pipeline.analytic.torus_frame import Fibre, bend, normal, sigma, tangent
from pipeline.compiled.arrays import Float32, Index
from pipeline.compiled.decorators import inlined_fast_kernel, inlined_kernel, kernel
from pipeline.compiled.float32 import arcsine
from pipeline.compiled.normal import normal_quantile
from pipeline.truth.cloth import cloth_side
from pipeline.truth.footprint.mixture import Footprints, footprints
from pipeline.truth.footprint.sequences import r2_pair
from pipeline.truth.geometry import heightfield
from pipeline.truth.geometry.heightfield import GAP, INVERSE_RADIUS, WARP, WEFT
from pipeline.truth.geometry.pieces import longest_period
from pipeline.truth.options import TruthOptions
from pipeline.truth.query import Queries
from pipeline.truth.scattering.slab_float32 import unscattered
from weaves.colour import luminance
from weaves.fabric import Fabric

FLAKE_ROWS: Final = 6  # rows of `Lobes.flakes`

TX, TY, TZ, SQUARE, SHARE, HEIGHT = range(FLAKE_ROWS)
"""Tangent; alpha^2, widened; probability; that times alpha^3 / (4 pi sigma(wo)), the density at q = 1."""

NEAR, FAR, STRAIGHT = range(3)
"""Columns of `Lobes.rest`: the cosine on the viewer's side, that on the other, light straight through."""

SPECULAR, DIFFUSE, THROUGH = range(3)  # rows of `LobeSurface.luminance`: k_s, k_d and k_dt

SCATTERED: Final = 0.2
"""Light that leaves after one flake and meets no other yarn, as a share of what meets a flake, roughly."""

BROAD: Final = 0.2  # share of a family's lobes that its broad one has

_GRID = 12  # cells of a grid along each axis: some tens of kilobytes, which stay in the cache
_POINT_ROWS = 7  # of the scratch
_SINE, _PLACE, _CURVE, _LIMIT, _SEEN, _WARPNESS, _YARNNESS = range(_POINT_ROWS)
_SCATTERED, _BROAD = np.float32(SCATTERED), np.float32(BROAD)
_ASTRAY = np.float32(0.15)  # share of the flakes' light that the cosine takes: no point finds it
_CLEAR = np.float32(0.05)  # light straight through a yarn at least: few points may all be opaque, the footprint is not
_LEAST = np.float32(0.02)  # share of each cosine and of light straight through at least: none is without a sample
_HIDDEN = (np.float32(0.45), np.float32(0.1))  # shares of each and of light straight through where no point is seen
_SHARPNESS = np.float32(20.0)  # 1 over the width of the ramp of a horizon
_STEEPEST = np.float32(0.99999)
_ALONE = np.float32(0.999)  # sum of squared shares from which on a family has one point
_0, _1, _HALF, _TINY = np.float32(0.0), np.float32(1.0), np.float32(0.5), np.float32(1e-30)
_INVERSE_PI, _HEIGHT = np.float32(1.0 / math.pi), np.float32(0.25 / math.pi)
_LEVELS = np.float32(LEVELS)


class LobeSurface(NamedTuple):
    """One side of a cloth as lobes need it."""

    repeat: Index  # ends and picks, (2,)
    yarn: Float32  # `HeightField.yarn`, (2, 8)
    thickness: np.float32  # optical thickness T
    uniform: float  # deviation from which on a Gaussian covers the cloth evenly
    piece_starts: Index
    pieces: Index
    bounds: Float32
    grid: npt.NDArray[np.uint8]
    """As in `pipeline.analytic.soft_nodes.nodes.SoftNodeTable`, the grid flat."""
    size: int  # cells of a grid along each axis
    luminance: Float32  # luminances of the mean colours of warp and weft: SPECULAR, DIFFUSE, THROUGH, (3, 2)


def tabulate_surface(fabric: Fabric) -> LobeSurface:
    """Return the front of a fabric, as the default model of the truth sees it."""
    model, average = cloth_side(fabric, TruthOptions()), fabric.average()
    front, yarns = model.front, (average.warp, average.weft)
    colours = [(y.specular_rgb, y.diffuse_rgb, y.diffuse_transmission_rgb) for y in yarns]
    return LobeSurface(
        repeat=np.array(front.top.shape[::-1], np.int64),
        yarn=np.ascontiguousarray(front.yarn, np.float32),
        thickness=np.float32(front.thickness),
        uniform=nodes.EVEN * longest_period(front),
        **nodes.tabulate_pieces(model, _GRID),
        size=_GRID,
        luminance=np.array([[luminance(rgb) for rgb in kind] for kind in zip(*colours, strict=True)], np.float32),
    )


class Lobes(NamedTuple):
    """Mixtures for N looks; all probabilities of a look sum to 1."""

    flakes: Float32  # lobes of flakes; the last two are the broad ones of warp and weft, (N, FLAKE_ROWS, K)
    rest: Float32  # probabilities of NEAR, FAR and STRAIGHT, (N, 3)


class Viewing(NamedTuple):
    """A footprint and its viewer."""

    x: float
    y: float
    """Centre, within the repeat."""
    dx: np.float32
    dy: np.float32
    rho: np.float32
    """Deviations along x and y, and correlation of the axes."""
    even: bool  # true if it covers the cloth evenly
    ox: np.float32
    oy: np.float32
    oz: np.float32
    """wo."""
    low: int
    high: int
    turn: np.float32
    """Azimuths around wo, and where between them it lies."""


def point_places(count: int) -> Float32:
    """Return the places of points, float32 (count, 4), the first of a low-discrepancy sequence.

    The first two columns are in deviations of a footprint; the others, where it covers the cloth evenly, in repeats.
    """
    result = np.empty((count, 4), np.float32)
    for k in range(count):
        pair = r2_pair(np.uint64(0), k)
        result[k] = *(normal_quantile(number) for number in pair), *pair
    return result


def find_lobes(cloth: LobeSurface, looks: Queries, places: Float32, widening: float) -> Lobes:
    """Return the mixtures of N looks, of P + 2 lobes each, the viewer in front; their wi does not matter.

    `places` (P, 4) are `point_places`, `widening` is a factor on the widening of lobes.
    """
    count, points = len(looks.u), len(places)
    result = Lobes(np.empty((count, FLAKE_ROWS, points + 2), np.float32), np.empty((count, STRAIGHT + 1), np.float32))
    wo, scratch = np.ascontiguousarray(looks.wo, np.float32), np.empty((_POINT_ROWS, points), np.float32)
    _find_rows(cloth, footprints(looks), wo, places, np.float32(widening), scratch, result)
    return result


@kernel
def _find_rows(
    cloth: LobeSurface, patches: Footprints, wo: Float32, places: Float32, widening: np.float32, points: Float32,
    result: Lobes,
) -> None:  # fmt: skip
    """Write the mixtures of N looks; `points` is scratch."""
    u, v, deviation_x, deviation_y, correlation = patches
    ends, picks = cloth.repeat[0], cloth.repeat[1]
    for n in range(len(u)):
        # Reduced in double precision: single would lose the place of a far centre within the repeat.
        x = np.float64(u[n]) - ends * math.floor(np.float64(u[n]) / ends)
        y = np.float64(v[n]) - picks * math.floor(np.float64(v[n]) / picks)
        low, high, turn = around(wo[n, 0], wo[n, 1])
        even = min(deviation_x[n], deviation_y[n]) >= cloth.uniform
        look = Viewing(
            x, y, deviation_x[n], deviation_y[n], correlation[n], even, wo[n, 0], wo[n, 1], wo[n, 2], low, high, turn
        )
        lobes = result.flakes[n]
        _place_points(cloth, look, places, points)
        near, far, straight = _shade_points(cloth, look, points, lobes)
        _widen(points, lobes, widening)
        _normalise(look, lobes, near, far, straight, result.rest[n])


@inlined_kernel
def _place_points(cloth: LobeSurface, look: Viewing, places: Float32, points: Float32) -> None:
    """Write what each point has of its piece, and how much of it the viewer sees."""
    size, bounds, width = cloth.size, cloth.bounds, cloth.repeat[0]
    ends, picks, per_azimuth = np.float64(width), np.float64(cloth.repeat[1]), cloth.size * cloth.size
    per_end, per_pick = 1.0 / ends, 1.0 / picks
    to_low, to_high = look.low * per_azimuth, look.high * per_azimuth
    count, last = np.float32(size), np.float32(size) - np.float32(0.01)
    root = np.sqrt(_1 - look.rho * look.rho)
    level, sharpness = look.oz * _LEVELS, _SHARPNESS / _LEVELS
    for k in range(len(places)):
        if look.even:
            x, y = look.x + places[k, 2] * ends, look.y + places[k, 3] * picks
        else:
            x = look.x + look.dx * places[k, 0]
            y = look.y + look.dy * (look.rho * places[k, 0] + root * places[k, 1])
        x, y = x - ends * math.floor(x * per_end), y - picks * math.floor(y * per_pick)
        # What rounds to the repeat's end is in its last cell.
        end, pick = min(int(x), cloth.repeat[0] - 1), min(int(y), cloth.repeat[1] - 1)
        fx, fy, cell = np.float32(x - end), np.float32(y - pick), pick * width + end
        p, stop = cloth.piece_starts[cell], cloth.piece_starts[cell + 1] - 1
        while p < stop and not (
            bounds[p, X_LOW] <= fx and fx <= bounds[p, X_HIGH] and bounds[p, Y_LOW] <= fy and fy <= bounds[p, Y_HIGH]
        ):
            p += 1
        family, shift = cloth.pieces[p, FAMILY], bounds[p, SHIFT]
        sine, place = _0, _0
        column = (fx - bounds[p, X_LOW]) / (bounds[p, X_HIGH] - bounds[p, X_LOW])
        row = (fy - bounds[p, Y_LOW]) / (bounds[p, Y_HIGH] - bounds[p, Y_LOW])
        if family == WARP:
            sine, place = (fx - _HALF) * cloth.yarn[WARP, INVERSE_RADIUS], fy - _HALF + shift
            column = arcsine(sine) * _INVERSE_PI + _HALF
        elif family == WEFT:
            # Along a weft, y of its frame runs against x.
            sine, place = (fy - _HALF) * cloth.yarn[WEFT, INVERSE_RADIUS], _HALF - fx - shift
            row = arcsine(sine) * _INVERSE_PI + _HALF
        at = int(min(max(row * count, _0), last)) * size + int(min(max(column * count, _0), last))
        at += cloth.pieces[p, BLOCK] * AZIMUTHS * per_azimuth
        lower, upper = np.float32(cloth.grid[at + to_low]), np.float32(cloth.grid[at + to_high])
        points[_SINE, k], points[_PLACE, k] = min(max(sine, -_STEEPEST), _STEEPEST), place
        points[_CURVE, k], points[_LIMIT, k] = bounds[p, CURVE], bounds[p, BOUND]
        points[_SEEN, k] = ramp(above(level, lower, upper, look.turn, sharpness))
        points[_WARPNESS, k] = _1 if family == WARP else _0
        points[_YARNNESS, k] = _0 if family == GAP else _1


class _Family(NamedTuple):
    """Numbers of the yarns of a family, and luminances of k_s, k_d and k_dt."""

    sin_twist: np.float32
    cos_twist: np.float32
    beta: np.float32
    radius: np.float32
    alpha: np.float32
    specular: np.float32
    diffuse: np.float32
    through: np.float32


@inlined_fast_kernel
def _family(cloth: LobeSurface, family: int) -> _Family:
    """Return the numbers of one family."""
    yarn, light = cloth.yarn, cloth.luminance
    return _Family(
        yarn[family, heightfield.SIN_TWIST], yarn[family, heightfield.COS_TWIST], yarn[family, heightfield.BETA],
        yarn[family, heightfield.RADIUS], yarn[family, heightfield.ALPHA],
        light[SPECULAR, family], light[DIFFUSE, family], light[THROUGH, family],
    )  # fmt: skip


@inlined_fast_kernel
def _shade_points(
    cloth: LobeSurface, look: Viewing, points: Float32, lobes: Float32
) -> tuple[np.float32, np.float32, np.float32]:
    """Write tangent, alpha^2 and share of each point; return the sums of both cosines and of light straight through."""
    near, far, straight = _0, _0, _0
    # Numbers of both families, one of them chosen: no branch and no load, so that vector units take the loop.
    first, second, thickness = _family(cloth, WARP), _family(cloth, WEFT), np.float32(cloth.thickness)
    for k in range(points.shape[1]):
        warp, solid, sine = points[_WARPNESS, k] > _HALF, points[_YARNNESS, k] > _HALF, points[_SINE, k]
        fibre = Fibre(
            first.sin_twist if warp else second.sin_twist,
            first.cos_twist if warp else second.cos_twist,
            first.beta if warp else second.beta,
        )
        radius, alpha = (first.radius if warp else second.radius), (first.alpha if warp else second.alpha)
        ox, oy = (look.ox if warp else look.oy), (look.oy if warp else -look.ox)
        cosine = np.sqrt((_1 - sine) * (_1 + sine))
        angles, _ = bend(sine, cosine, radius, points[_PLACE, k], points[_CURVE, k], points[_LIMIT, k])
        nx, ny, nz = normal(angles, fibre.beta)
        t = tangent(angles, fibre)
        cos_o = max(ox * nx + oy * ny + look.oz * nz, _0)
        across = sigma(ox * t.x + oy * t.y + look.oz * t.z, alpha * alpha)
        area = points[_SEEN, k] * (cos_o / nz if solid else look.oz)
        clear = unscattered(across, cos_o, thickness) if solid else _1
        own = area if solid else _0
        specular = own * (first.specular if warp else second.specular) * _SCATTERED * (_1 - clear)
        near += own * (first.diffuse if warp else second.diffuse) + _ASTRAY * specular
        far += own * (first.through if warp else second.through)
        straight += area * max(clear, _CLEAR)
        lobes[TX, k], lobes[TY, k], lobes[TZ, k] = (t.x if warp else -t.y), (t.y if warp else t.x), t.z
        lobes[SQUARE, k] = alpha * alpha
        lobes[SHARE, k] = specular * (_1 - _ASTRAY)
    return near, far, straight


@inlined_fast_kernel
def _widen(points: Float32, lobes: Float32, widening: np.float32) -> None:
    """Widen the roughness of each family's lobes by how much its tangents differ, and add its broad lobe."""
    count = points.shape[1]
    for family in range(2):
        broad, own = count + family, _1 if family == WARP else _0
        whole, squares, x, y, z, square = _0, _0, _0, _0, _0, _0
        for k in range(count):
            mine = points[_WARPNESS, k] == own
            share = lobes[SHARE, k] if mine else _0
            whole += share
            squares += share * share
            x += share * lobes[TX, k]
            y += share * lobes[TY, k]
            z += share * lobes[TZ, k]
            square = max(square, lobes[SQUARE, k] if mine and share > _0 else _0)
        lobes[TX, broad], lobes[TY, broad], lobes[TZ, broad] = _1, _0, _0
        lobes[SQUARE, broad], lobes[SHARE, broad] = _1, _0
        inverse, length = _1 / max(whole, _TINY), np.sqrt(x * x + y * y + z * z)
        # Points of unlike shares count as fewer.
        fewer = squares * inverse * inverse
        if whole <= _TINY or length <= _TINY or fewer > _ALONE:
            continue
        apart = max(_1 - length * length * inverse * inverse, _0)
        added = apart * widening * widening * fewer * fewer
        for k in range(count):
            mine = points[_WARPNESS, k] == own
            lobes[SQUARE, k] = min(lobes[SQUARE, k] + (added if mine else _0), _1)
            lobes[SHARE, k] *= _1 - _BROAD if mine else _1
        lobes[TX, broad], lobes[TY, broad], lobes[TZ, broad] = x / length, y / length, z / length
        lobes[SQUARE, broad], lobes[SHARE, broad] = min(square + apart, _1), _BROAD * whole


@inlined_fast_kernel
def _normalise(
    look: Viewing, lobes: Float32, near: np.float32, far: np.float32, straight: np.float32, rest: Float32
) -> None:
    """Make probabilities of the shares, and write the heights of the lobes."""
    total = near + far + straight
    for k in range(lobes.shape[1]):
        total += lobes[SHARE, k]
    scale, least, least_straight = _0, _HIDDEN[0], _HIDDEN[1]
    if total > _TINY:
        scale, least, least_straight = (_1 - _LEAST - _LEAST - _LEAST) / total, _LEAST, _LEAST
    for k in range(lobes.shape[1]):
        share, square = lobes[SHARE, k] * scale, lobes[SQUARE, k]
        along = look.ox * lobes[TX, k] + look.oy * lobes[TY, k] + look.oz * lobes[TZ, k]
        lobes[SHARE, k] = share
        lobes[HEIGHT, k] = share * _HEIGHT * square * np.sqrt(square) / sigma(along, square)
    rest[NEAR], rest[FAR], rest[STRAIGHT] = near * scale + least, far * scale + least, straight * scale + least_straight
