"""The flat loops over nodes in single precision: visibility, reflection, transmission, borders of shadows.

The formulas are those of `scattering.point` and `scattering.microflake`; the layer is `scattering.slab_float32`. Every
array holds one number a node of a piece. The loops have no branch and no call left, so that vector units run them.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from pipeline.compiled.arrays import Float32
from pipeline.compiled.decorators import fast_kernel, inlined_fast_kernel
from pipeline.truth.scattering.slab_float32 import reflection, transmission, unscattered

SMOOTH: Final = np.float32(0.0005)
"""Squared error of a node's share from curvature within it, relative to its square."""

_EDGE: Final = np.float32(0.01)
_EDGE_JUMP: Final = np.float32(0.1)

_0, _HALF, _1 = np.float32(0.0), np.float32(0.5), np.float32(1.0)
_JUMP = np.float32(3.0)
_TINY = np.float32(1e-30)


@fast_kernel
def weigh(
    nx: Float32,
    ny: Float32,
    nz: Float32,
    inverse: Float32,
    weight: Float32,
    ix: np.float32,
    iy: np.float32,
    iz: np.float32,
    ox: np.float32,
    oy: np.float32,
    oz: np.float32,
    slope_i: np.float32,
    low_i: Float32,
    high_i: Float32,
    turn_i: np.float32,
    slope_o: np.float32,
    low_o: Float32,
    high_o: Float32,
    turn_o: np.float32,
    blend: np.float32,
    lit: Float32,
    areas: Float32,
    diffuses: Float32,
    margins: Float32,
    lit_margins: Float32,
) -> tuple[np.float32, np.float32]:
    """Write each node's weight if it is seen and lit, and its shares of area and diffuse; return the sums of both.

    The margins say by how much the viewer, and viewer and light, clear the horizon: negative where they do not.
    """
    area, diffuse = _0, _0
    for k in range(len(weight)):
        cos_o = max(ox * nx[k] + oy * ny[k] + oz * nz[k], _0)
        cos_i = ix * nx[k] + iy * ny[k] + iz * nz[k]
        margin_o = slope_o - low_o[k] - turn_o * (high_o[k] - low_o[k])
        margin_i = min(min(slope_i - low_i[k] - turn_i * (high_i[k] - low_i[k]), cos_i), margin_o)
        visible = weight[k] if margin_o > _0 else _0
        both = weight[k] if margin_i > _0 else _0
        projected = cos_o * inverse[k]
        a = visible * projected
        c = both * projected * (blend * cos_i + (_1 - blend) * iz)
        lit[k], areas[k], diffuses[k], margins[k], lit_margins[k] = both, a, c, margin_o, margin_i
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

    `before` and `after` are the margins beyond them, `change` how much m and n differ, and `across` the change at a
    right angle, which shares the border with the links in that direction.
    """
    weight = _1 / (change + across + _TINY)
    jump = change > _JUMP * max(abs(before - m), abs(n - after))
    share = _0 if jump else (max(m, n) - _HALF * change) * weight
    doubt = change * weight * (_EDGE_JUMP if jump else _EDGE)
    crossed = min(m, n) <= _0 and max(m, n) > _0
    return (share if crossed else _0), (doubt if crossed else _0)


@inlined_fast_kernel
def _products(
    wx: np.float32, wy: np.float32, wz: np.float32, tx: np.float32, ty: np.float32, tz: np.float32
) -> tuple[np.float32, np.float32, np.float32, np.float32]:
    """Return w x t and w.t."""
    return wy * tz - wz * ty, wz * tx - wx * tz, wx * ty - wy * tx, wx * tx + wy * ty + wz * tz


@inlined_fast_kernel
def _sigma(x: np.float32, y: np.float32, z: np.float32, along: np.float32, square: np.float32) -> np.float32:
    """Return the projected area of the flakes from w x t, w.t and alpha^2."""
    area: np.float32 = np.sqrt(x * x + y * y + z * z + square * along * along)
    return area


@fast_kernel
def reflected(
    nx: Float32,
    ny: Float32,
    nz: Float32,
    inverse: Float32,
    tx: Float32,
    ty: Float32,
    tz: Float32,
    ix: np.float32,
    iy: np.float32,
    iz: np.float32,
    ox: np.float32,
    oy: np.float32,
    oz: np.float32,
    square: np.float32,
    thickness: np.float32,
    size: np.float32,
    scale: np.float32,
    lit: Float32,
    speculars: Float32,
) -> np.float32:
    """Add each node's share of the reflected specular component to `speculars`; return the sum.

    `square` is alpha^2, `size` one over the squared length of wi + wo, `scale` alpha^3 / (4 pi) over the finer nodes.
    """
    total = _0
    for k in range(len(lit)):
        cos_o = max(ox * nx[k] + oy * ny[k] + oz * nz[k], _0)
        cos_i = max(ix * nx[k] + iy * ny[k] + iz * nz[k], _0)
        # The half vector's products with the tangent are sums of those of wi and wo.
        ax, ay, az, along_i = _products(ix, iy, iz, tx[k], ty[k], tz[k])
        bx, by, bz, along_o = _products(ox, oy, oz, tx[k], ty[k], tz[k])
        vx, vy, vz, along = ax + bx, ay + by, az + bz, along_i + along_o
        q = size * (square * (vx * vx + vy * vy + vz * vz) + along * along)
        sigma_i, sigma_o = _sigma(ax, ay, az, along_i, square), _sigma(bx, by, bz, along_o, square)
        flakes = lit[k] * scale * inverse[k]
        value = reflection(flakes, q * q, sigma_i, sigma_o, cos_i, cos_o, thickness)
        speculars[k] += value
        total += value
    return total


@fast_kernel
def transmitted(
    nx: Float32,
    ny: Float32,
    nz: Float32,
    inverse: Float32,
    tx: Float32,
    ty: Float32,
    tz: Float32,
    ix: np.float32,
    iy: np.float32,
    iz: np.float32,
    ox: np.float32,
    oy: np.float32,
    oz: np.float32,
    square: np.float32,
    thickness: np.float32,
    size: np.float32,
    scale: np.float32,
    lit: Float32,
    speculars: Float32,
) -> np.float32:
    """Do the same for light from behind, of which (ix, iy, iz) is the opposite, -wi."""
    total = _0
    for k in range(len(lit)):
        cos_o = max(ox * nx[k] + oy * ny[k] + oz * nz[k], _0)
        cos_i = max(ix * nx[k] + iy * ny[k] + iz * nz[k], _0)
        ax, ay, az, along_i = _products(ix, iy, iz, tx[k], ty[k], tz[k])
        bx, by, bz, along_o = _products(ox, oy, oz, tx[k], ty[k], tz[k])
        vx, vy, vz, along = bx - ax, by - ay, bz - az, along_o - along_i
        q = size * (square * (vx * vx + vy * vy + vz * vz) + along * along)
        sigma_i, sigma_o = _sigma(ax, ay, az, along_i, square), _sigma(bx, by, bz, along_o, square)
        flakes = lit[k] * scale * inverse[k]
        value = transmission(flakes, q * q, sigma_i, sigma_o, cos_i, cos_o, thickness)
        speculars[k] += value
        total += value
    return total


@fast_kernel
def crossing(
    nx: Float32,
    ny: Float32,
    nz: Float32,
    tx: Float32,
    ty: Float32,
    tz: Float32,
    ox: np.float32,
    oy: np.float32,
    oz: np.float32,
    square: np.float32,
    thickness: np.float32,
    areas: Float32,
) -> np.float32:
    """Return the unscattered light through the layer, the sum of exp(-T Lambda) times each node's share of the area."""
    total = _0
    for k in range(len(areas)):
        cos_o = ox * nx[k] + oy * ny[k] + oz * nz[k]
        bx, by, bz, along_o = _products(ox, oy, oz, tx[k], ty[k], tz[k])
        total += areas[k] * unscattered(_sigma(bx, by, bz, along_o, square), cos_o, thickness)
    return total
