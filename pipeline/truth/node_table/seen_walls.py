"""Sums of a query over the walls that its view rays meet."""

import math
from typing import Final, NamedTuple

import numpy as np

from pipeline.compiled.arrays import Float32, Float64
from pipeline.compiled.decorators import fast_kernel, kernel
from pipeline.truth.cloth import ClothSide
from pipeline.truth.geometry.heightfield import BLEND, RADIUS, WARP, WEFT
from pipeline.truth.node_table import kernels
from pipeline.truth.node_table.build import ExactNodes
from pipeline.truth.node_table.kernels import Direction, HorizonSlopes, NodeDirections, Normals, Tangents
from pipeline.truth.node_table.walls import HEIGHTS, WallNodes
from pipeline.truth.node_table.weights import WeightRoom, read_density

_DOUBT: Final = 0.04  # error of what walls show, relative to it
_GRAZING = np.float32(1e-5)
_STEP = np.float32(1e-4)
_0, _HALF, _1 = np.float32(0.0), np.float32(0.5), np.float32(1.0)
_OF_STEPS = np.float32(1.0 / (HEIGHTS - 1))


class WallRoom(NamedTuple):
    """Room for the walls of one query."""

    seen: Float32
    weight: Float32
    areas: Float32
    lit: Float32
    speculars: Float32
    """Seen height, share of the footprint, share in the denominator, that of lit walls over the cosine of the rim, and
    share in the specular numerator, (W,)."""
    places: Float32  # the middle of what is seen, (3, W)


def wall_room(table: ExactNodes) -> WallRoom:
    """Return room for the walls of a table."""
    walls = len(table.walls.height)
    seen, weight, areas, lit, speculars = np.zeros((5, walls), np.float32)
    return WallRoom(seen, weight, areas, lit, speculars, table.walls.places.copy())


@kernel
def sum_walls(
    cloth: ClothSide, table: ExactNodes, towards: NodeDirections, points: int, density: WeightRoom, room: WallRoom,
    sums: Float64, squares: Float64,
) -> tuple[float, float]:  # fmt: skip
    """Add the shares of all walls to the sums, and their squared errors; return those of the denominator.

    `density` holds the footprint on a grid of so many `points` on a yarn spacing; with 0 points it is even.
    """
    walls, viewer, light = table.walls, towards.viewer, towards.light
    first, second = walls.horizon[viewer.first], walls.horizon[viewer.second]
    _write_seen(first, second, viewer, walls.places[2], walls.height, room.seen, room.places[2])
    for family in range(2):
        a, b = walls.starts[2 * family + 1], walls.starts[2 * family + 2]
        if b > a:
            _write_seen_deep(walls, viewer, cloth.front.yarn[:, RADIUS], a, b, room)
    weight = walls.evenly
    if points > 0:
        weight = room.weight
        shift_x, shift_y = float(viewer.x / viewer.z), float(viewer.y / viewer.z)
        read_density(table.lattice, points, cloth.plane, shift_x, shift_y, density, room.places, walls.evenly, weight)
    slope = walls.slope_behind if towards.behind else walls.slope
    area, area_error = np.float64(0.0), np.float64(0.0)
    for family in range(2):
        a, b = walls.starts[2 * family], walls.starts[2 * family + 2]
        if a == b:
            continue
        layer = kernels.flake_layer(cloth.front, family, 1)
        normal = Normals(walls.normal[0, a:b], walls.normal[1, a:b], walls.normal[2, a:b], walls.normal[3, a:b])
        tangent = Tangents(walls.tangent[0, a:b], walls.tangent[1, a:b], walls.tangent[2, a:b])
        areas, lit, speculars = room.areas[a:b], room.lit[a:b], room.speculars[a:b]
        own, diffuse = _weigh_walls(
            normal, walls.out[0, a:b], walls.out[1, a:b], light,
            HorizonSlopes(slope[light.first, a:b], slope[light.second, a:b]), viewer,
            np.float32(cloth.front.yarn[family, BLEND]), room.seen[a:b], weight[a:b], areas, lit,
        )  # fmt: skip
        if own == _0:
            continue
        sums[4] += kernels.crossing(normal, tangent, viewer, layer, areas)
        area += own
        area_error += (_DOUBT * own) ** 2
        if diffuse > _0:
            speculars[:] = _0
            specular = kernels.scatter(normal, tangent, towards, layer, lit, speculars)
            sums[family] += specular
            sums[2 + family] += diffuse / math.pi
            squares[family] += (_DOUBT * specular) ** 2
            squares[2 + family] += (_DOUBT * diffuse / math.pi) ** 2
    return area, area_error


@fast_kernel
def _write_seen(
    first: Float32, second: Float32, viewer: Direction, rim: Float32, height: Float32, seen: Float32, middle: Float32
) -> None:
    """Write how much of each wall's height a viewer sees, and the height of its middle, from horizons (HEIGHTS, W)."""
    for k in range(len(seen)):
        of_first, of_second = _0, _0
        for h in range(HEIGHTS - 1):
            low, high = first[h, k], first[h + 1, k]
            of_first += min(max((viewer.slope - low) / max(high - low, _STEP), _0), _1)
            low, high = second[h, k], second[h + 1, k]
            of_second += min(max((viewer.slope - low) / max(high - low, _STEP), _0), _1)
        seen[k] = height[k] * _OF_STEPS * (of_first + viewer.turn * (of_second - of_first))
        middle[k] = rim[k] - _HALF * seen[k]


@kernel
def _write_seen_deep(
    walls: WallNodes, viewer: Direction, radius: Float64, start: int, stop: int, room: WallRoom
) -> None:
    """Do the same for the deep walls from `start` to `stop`, for rays that pass: over a gap, clear of the back."""
    first, second = walls.horizon[viewer.first], walls.horizon[viewer.second]
    passing, passing_second = walls.passing[viewer.first], walls.passing[viewer.second]
    places, height = walls.places, walls.height
    for k in range(start, stop):
        total, deepest, top = _0, _0, places[2, k]
        for own, free, share in ((first, passing, _1 - viewer.turn), (second, passing_second, viewer.turn)):
            for h in range(HEIGHTS - 1):
                clear = (viewer.slope - own[h, k]) / max(own[h + 1, k] - own[h, k], _STEP)
                met = (free[h, k] - viewer.slope) / max(free[h, k] - free[h + 1, k], _STEP)
                if clear > _0 and met < _1:
                    back = (height[k] * _OF_STEPS * (np.float32(h) + _HALF) - top) / viewer.z
                    x, y = places[0, k] + back * viewer.x, places[1, k] + back * viewer.y
                    met = _1 if min(abs(x % 1.0 - 0.5) - radius[WARP], abs(y % 1.0 - 0.5) - radius[WEFT]) < 0.0 else met
                part = share * min(max(min(clear, met), _0), _1)
                total += part
                deepest += part * (np.float32(h) + _HALF)
        room.seen[k] = height[k] * _OF_STEPS * total
        room.places[2, k] = top - height[k] * _OF_STEPS * deepest / max(total, _STEP)


@fast_kernel
def _weigh_walls(
    normal: Normals, out_x: Float32, out_y: Float32, light: Direction, light_horizon: HorizonSlopes, viewer: Direction,
    blend: np.float32, seen: Float32, weight: Float32, areas: Float32, lit: Float32,
) -> tuple[np.float32, np.float32]:  # fmt: skip
    """Write the walls' shares of the area, those of lit ones over the rim's cosine; return area and diffuse sums."""
    area, diffuse = _0, _0
    for k in range(len(seen)):
        cos_o = viewer.x * normal.x[k] + viewer.y * normal.y[k] + viewer.z * normal.z[k]
        cos_i = light.x * normal.x[k] + light.y * normal.y[k] + light.z * normal.z[k]
        facing = max(viewer.x * out_x[k] + viewer.y * out_y[k], _0)
        a = weight[k] * seen[k] * facing if cos_o > _0 else _0
        low, high = light_horizon.first[k], light_horizon.second[k]
        margin = min(light.slope - low - light.turn * (high - low), cos_i)
        both = a if margin > _0 else _0
        areas[k], lit[k] = a, both / max(cos_o, _GRAZING)
        area += a
        diffuse += both * (blend * cos_i + (_1 - blend) * light.z)
    return area, diffuse
