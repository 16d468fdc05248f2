"""Arrays with one float32 number a node, and the flat loops over them: visibility, reflection, transmission, borders.

The formulas are those of `scattering.point` and `scattering.slab`; the layer is `scattering.slab_float32`. Arrays are
those of the nodes of one piece. The loops have no branch and no call left, so that vector units run them.
"""

import math
from typing import Final, Literal, NamedTuple

import numpy as np

from pipeline.compiled.arrays import Float32, Float64
from pipeline.compiled.decorators import fast_kernel, inlined_fast_kernel, inlined_kernel, kernel
from pipeline.truth.geometry.heightfield import ALPHA, HeightField
from pipeline.truth.scattering.slab_float32 import reflection, transmission, unscattered

_STEEPEST = 1e4
_EDGE: Final = np.float32(0.01)
_EDGE_JUMP: Final = np.float32(0.1)
_0, _HALF, _1 = np.float32(0.0), np.float32(0.5), np.float32(1.0)
_JUMP = np.float32(3.0)
_TINY = np.float32(1e-30)


class Direction(NamedTuple):
    """A unit direction, and where horizons towards it stand in a table."""

    x: np.float32
    y: np.float32
    z: np.float32
    """Components."""
    slope: np.float32  # rise per unit of distance in the fabric plane
    first: int
    second: int
    """The two azimuths of the table around it."""
    turn: np.float32  # its place between them, 0 to 1


class NodeDirections(NamedTuple):
    """Directions of one query."""

    behind: bool  # true if the light is behind the cloth
    light: Direction
    """wi; of light from behind the components of -wi, but slope and azimuths of wi reflected in the fabric plane."""
    viewer: Direction  # wo
    through: Direction  # -wo reflected in the fabric plane: the way through a gap, as the back of the cloth sees it
    size: np.float32  # 1 / |wi + wo|^2


@kernel
def node_directions(wi: Float64, wo: Float64, azimuths: int) -> NodeDirections:
    """Prepare unit directions, wo with z > 0, for a table with so many azimuths."""
    behind = wi[2] < 0.0
    half = (wi[0] + wo[0]) ** 2 + (wi[1] + wo[1]) ** 2 + (wi[2] + wo[2]) ** 2
    light = _direction(wi[0], wi[1], wi[2], -1.0 if behind else 1.0, azimuths)
    viewer = _direction(wo[0], wo[1], wo[2], 1.0, azimuths)
    through = _direction(-wo[0], -wo[1], wo[2], 1.0, azimuths)
    return NodeDirections(behind, light, viewer, through, np.float32(1.0 / max(half, 1e-12)))


@kernel
def _direction(x: float, y: float, z: float, sign: float, azimuths: int) -> Direction:
    """Return `sign` times a direction, with the slope and the azimuths of the direction itself."""
    place = math.atan2(y, x) / (2.0 * math.pi) * azimuths
    row = math.floor(place)
    first, second = int(row) % azimuths, int(row + 1) % azimuths
    slope, turn = min(abs(z) / max(math.sqrt(x * x + y * y), 1e-9), _STEEPEST), place - row
    x, y, z = sign * x, sign * y, sign * z
    return Direction(np.float32(x), np.float32(y), np.float32(z), np.float32(slope), first, second, np.float32(turn))


class NodeShares(NamedTuple):
    """Shares of the nodes in the sums of one query; overwritten for each query."""

    weight: Float32  # share of the footprint, (N,)
    lit: Float32  # `weight` where the viewer and the light are visible, else 0, (N,)
    areas: Float32
    diffuses: Float32
    speculars: Float32
    """Share in the denominator, and in the diffuse (times pi) and specular numerators, (N,)."""
    margins: Float32
    lit_margins: Float32
    """Slope by which the viewer, and viewer and light, lie above the horizon; negative below it, (N,)."""
    undecided: Float32
    """Share in the denominator, were the node visible, if the horizons beside a direction disagree; else 0, (N,)."""


def no_shares(nodes: int) -> NodeShares:
    """Return arrays for so many nodes, all 0."""
    return NodeShares(*np.zeros((len(NodeShares._fields), nodes), np.float32))


SMOOTH: Final = np.float32(0.0005)  # squared error of a node's share from curvature within it, relative to its square

LEAP: Final = np.float32(0.1)
"""Difference of a node's horizons at two azimuths between which they are not interpolated: another yarn's edge."""


class Normals(NamedTuple):
    """Unit normals of nodes, float32 (N,), and 1 / z."""

    x: Float32
    y: Float32
    z: Float32
    inverse: Float32


class Tangents(NamedTuple):
    """Unit tangents of the fibres at nodes, float32 (N,)."""

    x: Float32
    y: Float32
    z: Float32


class HorizonSlopes(NamedTuple):
    """Slopes of the nodes' horizons at the two azimuths around a direction, float32 (N,)."""

    first: Float32
    second: Float32


class FlakeLayer(NamedTuple):
    """The layer of flakes on a piece of yarn."""

    square: np.float32  # alpha^2
    thickness: np.float32  # optical thickness
    scale: np.float32  # alpha^3 / (4 pi), divided by the number of fine nodes in a node


@inlined_kernel
def flake_layer(field: HeightField, family: int, places: int) -> FlakeLayer:
    """Return the layer on yarns of a family, for sums over so many places a node."""
    alpha = field.yarn[family, ALPHA]
    scale = alpha**3 / (4.0 * math.pi * places)
    return FlakeLayer(np.float32(alpha**2), np.float32(field.thickness), np.float32(scale))


@fast_kernel
def weigh(
    normal: Normals, light: Direction, light_horizon: HorizonSlopes, viewer: Direction, viewer_horizon: HorizonSlopes,
    blend: np.float32, shares: NodeShares,
) -> tuple[np.float32, np.float32]:  # fmt: skip
    """Write which nodes are lit, their shares of area and diffuse, and their margins; return the sums of both shares.

    The margins say by how much the viewer, and viewer and light, clear the horizon: negative where they do not. A node
    is undecided if a direction clears the horizon at one of the two azimuths beside it and the horizon makes a `LEAP`.
    """
    area, diffuse = _0, _0
    for k in range(len(shares.weight)):
        cos_o = max(viewer.x * normal.x[k] + viewer.y * normal.y[k] + viewer.z * normal.z[k], _0)
        cos_i = light.x * normal.x[k] + light.y * normal.y[k] + light.z * normal.z[k]
        low, high = viewer_horizon.first[k], viewer_horizon.second[k]
        margin_o = viewer.slope - low - viewer.turn * (high - low)
        seen_between = min(low, high) < viewer.slope and viewer.slope < max(low, high) and abs(high - low) > LEAP
        low, high = light_horizon.first[k], light_horizon.second[k]
        lit_between = min(low, high) < light.slope and light.slope < max(low, high) and abs(high - low) > LEAP
        margin_i = min(min(light.slope - low - light.turn * (high - low), cos_i), margin_o)
        visible = shares.weight[k] if margin_o > _0 else _0
        both = shares.weight[k] if margin_i > _0 else _0
        projected = cos_o * normal.inverse[k]
        a = visible * projected
        c = both * projected * (blend * cos_i + (_1 - blend) * light.z)
        shares.lit[k], shares.areas[k], shares.diffuses[k] = both, a, c
        shares.margins[k], shares.lit_margins[k] = margin_o, margin_i
        undecided = seen_between or (lit_between and margin_o > _0 and cos_i > _0)
        shares.undecided[k] = shares.weight[k] * projected if undecided else _0
        area += a
        diffuse += c
    return area, diffuse


@fast_kernel
def borders(
    first: Float32, second: Float32, margins: Float32, columns: int
) -> tuple[np.float32, np.float32, np.float32, np.float32]:
    """Return the changes of two sums by borders of shadows between nodes, and their squared errors.

    Where the margin changes sign from one node to the next, the border lies where its straight line crosses 0, and the
    visible node counts up to there instead of half-way. Where the margin jumps, half-way is as good as anything.
    `columns` is the length of a row of nodes.
    """
    # Neighbours as arrays of their own: indices that might be negative would keep the loop from vector units.
    count = max(len(first) - 3 * columns, 0)
    here, up = margins[columns : columns + count], margins[:count]
    left, right = margins[columns - 1 : columns - 1 + count], margins[columns + 1 : columns + 1 + count]
    further = margins[columns + 2 : columns + 2 + count]
    down, below = margins[2 * columns : 2 * columns + count], margins[3 * columns : 3 * columns + count]
    first_here, first_right = first[columns : columns + count], first[columns + 1 : columns + 1 + count]
    first_down = first[2 * columns : 2 * columns + count]
    second_here, second_right = second[columns : columns + count], second[columns + 1 : columns + 1 + count]
    second_down = second[2 * columns : 2 * columns + count]
    moved, moved_second, error, error_second = _0, _0, _0, _0
    for k in range(count):
        change_right, change_down = abs(here[k] - right[k]), abs(here[k] - down[k])
        share, doubt = _crossing(left[k], here[k], right[k], further[k], change_right, change_down)
        v, w = first_here[k] + first_right[k], second_here[k] + second_right[k]
        moved += v * share
        moved_second += w * share
        error += first_here[k] * first_here[k] * SMOOTH + v * v * doubt
        error_second += second_here[k] * second_here[k] * SMOOTH + w * w * doubt
        share, doubt = _crossing(up[k], here[k], down[k], below[k], change_down, change_right)
        v, w = first_here[k] + first_down[k], second_here[k] + second_down[k]
        moved += v * share
        moved_second += w * share
        error += v * v * doubt
        error_second += w * w * doubt
    return moved, moved_second, error, error_second


@fast_kernel
def _crossing(
    before: np.float32, m: np.float32, n: np.float32, after: np.float32, change: np.float32, across: np.float32
) -> tuple[np.float32, np.float32]:
    """Return the change of the visible node's share by a border between margins m and n, and its squared error.

    `change` is how much m and n differ, `across` the same at a right angle, where links share the border.
    """
    weight = _1 / (change + across + _TINY)
    jump = change > _JUMP * max(abs(before - m), abs(n - after))
    share = _0 if jump else (max(m, n) - _HALF * change) * weight
    doubt = change * weight * (_EDGE_JUMP if jump else _EDGE)
    crossed = min(m, n) <= _0 and max(m, n) > _0
    return (share if crossed else _0), (doubt if crossed else _0)


@inlined_fast_kernel
def _products(
    w: Direction, tx: np.float32, ty: np.float32, tz: np.float32
) -> tuple[np.float32, np.float32, np.float32, np.float32]:
    """Return w x t and w.t."""
    return w.y * tz - w.z * ty, w.z * tx - w.x * tz, w.x * ty - w.y * tx, w.x * tx + w.y * ty + w.z * tz


@inlined_fast_kernel
def _sigma(x: np.float32, y: np.float32, z: np.float32, along: np.float32, square: np.float32) -> np.float32:
    """Return the projected area of the flakes from w x t, w.t and alpha^2."""
    area: np.float32 = np.sqrt(x * x + y * y + z * z + square * along * along)
    return area


@fast_kernel
def scattered(
    normal: Normals, tangent: Tangents, light: Direction, viewer: Direction, size: np.float32, layer: FlakeLayer,
    lit: Float32, speculars: Float32, behind: Literal[True] | None,
) -> np.float32:  # fmt: skip
    """Add each node's share of the specular component to `speculars`; return the sum.

    `size` is 1 / |wi + wo|^2. Light from `behind`, of which `light` is the opposite, -wi, is transmitted, other light
    reflected; None, not False: the loop is compiled for each of the two alone.
    """
    total = _0
    for k in range(len(lit)):
        nx, ny, nz = normal.x[k], normal.y[k], normal.z[k]
        cos_o = max(viewer.x * nx + viewer.y * ny + viewer.z * nz, _0)
        cos_i = max(light.x * nx + light.y * ny + light.z * nz, _0)
        # The half vector's products with the tangent are sums of those of wi and wo.
        ax, ay, az, along_i = _products(light, tangent.x[k], tangent.y[k], tangent.z[k])
        if behind is not None:
            ax, ay, az, along_i = -ax, -ay, -az, -along_i
        bx, by, bz, along_o = _products(viewer, tangent.x[k], tangent.y[k], tangent.z[k])
        vx, vy, vz, along = ax + bx, ay + by, az + bz, along_i + along_o
        q = size * (layer.square * (vx * vx + vy * vy + vz * vz) + along * along)
        sigma_i, sigma_o = _sigma(ax, ay, az, along_i, layer.square), _sigma(bx, by, bz, along_o, layer.square)
        flakes = lit[k] * layer.scale * normal.inverse[k]
        if behind is not None:
            value = transmission(flakes, q * q, sigma_i, sigma_o, cos_i, cos_o, layer.thickness)
        else:
            value = reflection(flakes, q * q, sigma_i, sigma_o, cos_i, cos_o, layer.thickness)
        speculars[k] += value
        total += value
    return total


@inlined_kernel
def scatter(
    normal: Normals, tangent: Tangents, towards: NodeDirections, layer: FlakeLayer, lit: Float32, speculars: Float32
) -> np.float32:
    """Do what `scattered` does, for the directions of a query."""
    light, viewer, size = towards.light, towards.viewer, towards.size
    if towards.behind:
        return scattered(normal, tangent, light, viewer, size, layer, lit, speculars, True)
    return scattered(normal, tangent, light, viewer, size, layer, lit, speculars, None)


@fast_kernel
def crossing(normal: Normals, tangent: Tangents, viewer: Direction, layer: FlakeLayer, areas: Float32) -> np.float32:
    """Return the unscattered light through the layer, the sum of exp(-T Lambda) times each node's share of the area."""
    total = _0
    for k in range(len(areas)):
        cos_o = viewer.x * normal.x[k] + viewer.y * normal.y[k] + viewer.z * normal.z[k]
        bx, by, bz, along_o = _products(viewer, tangent.x[k], tangent.y[k], tangent.z[k])
        total += areas[k] * unscattered(_sigma(bx, by, bz, along_o, layer.square), cos_o, layer.thickness)
    return total
