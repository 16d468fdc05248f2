"""The repeat as kernels read it: tables per cell and per yarn family, and the scalar form of `weaves.surface`.

`weaves.surface` is the oracle in NumPy; the functions here repeat its formulas for one point, because a ray visits one
cell after another. A float on top is a piece of a torus seen from outside [Irawan2012Woven]; its height,
sqrt((R + rho)^2 - y^2) with rho = sqrt(r^2 - x^2), is CONCAVE in (x, y): visibility relies on that.
"""

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from pipeline.compiled.arrays import Float64
from pipeline.compiled.decorators import inlined_kernel, kernel
from weaves.draft import cells
from weaves.fabric import Fabric

WARP, WEFT, GAP = 0, 1, 2

# Columns of `HeightField.yarn`, one row a family.
RADIUS, INVERSE_RADIUS, SIN_TWIST, COS_TWIST, ALPHA, BETA, BLEND, BEND = range(8)
# Columns of `HeightField.floats`: [pick, end, TOP or UNDER, column]; a bend radius of 0 marks a float drawn flat.
TOP, UNDER = 0, 1
OFFSET, BEND_RADIUS, HALF_LENGTH, AXIS_DROP = range(4)

_EDGE = 1e-9  # cosine across a yarn below which the slope counts as vertical


class HeightField(NamedTuple):
    """Geometry and optics of one repeat; all arrays float64 except `top` (int8)."""

    top: npt.NDArray[np.int8]  # family on top: WARP or WEFT, (picks, ends)
    floats: Float64
    """For the yarn on top and the one beneath: cell centre minus float centre along the yarn, bend radius R, half
    length L/2, R cos(u_max), (picks, ends, 2, 4)."""
    crown: Float64  # greatest height that any surface of the cell reaches, (picks, ends)
    highest: float
    lowest: float
    """Greatest height of the fabric, and a bound that no yarn lies below."""
    yarn: Float64
    """Radius r, 1/r, sine and cosine of the twist, alpha, relief beta, blend w_d, u_max in radians, (2, 8)."""
    thickness: float  # optical thickness T


def height_field(fabric: Fabric) -> HeightField:
    """Tabulate a fabric for the kernels."""
    table = cells(fabric.weave)
    families = (fabric.warp, fabric.weft)
    yarn = np.zeros((2, 8))
    for row, y in zip(yarn, families, strict=True):
        row[[RADIUS, INVERSE_RADIUS, ALPHA, BETA, BLEND]] = 0.5 * y.width, 2.0 / y.width, y.roughness, y.relief, y.blend
        twist, row[BEND] = math.radians(y.twist), math.radians(y.bend)
        row[[SIN_TWIST, COS_TWIST]] = math.sin(twist), math.cos(twist)
    floats = np.zeros((*table.top.shape, 2, 4))
    crown = np.zeros(table.top.shape)
    for side, offset, length in (
        (TOP, table.top_offset, table.top_length),
        (UNDER, table.under_offset, table.under_length),
    ):
        for family, y in enumerate(families):
            here = (table.top == family) == (side == TOP)
            own = _float_rows(offset[here], length[here], y.width, y.bend)
            floats[here, side] = own
            if side == TOP or families[1 - family].width < 1.0:
                crown[here] = np.maximum(crown[here], y.relief * _rise(side, own, yarn[family, RADIUS]))
    sag = floats[..., BEND_RADIUS] - floats[..., AXIS_DROP]
    lowest = -float(max(y.relief for y in families) * sag.max())
    return HeightField(
        np.ascontiguousarray(table.top), floats, crown, float(crown.max()), lowest, yarn, fabric.optical_thickness
    )


def _float_rows(offset: Float64, length: Float64, width: float, bend_degrees: float) -> Float64:
    """Return offset, bend radius, half length and R cos(u_max) of floats, (N, 4); bend radius 0 if drawn flat."""
    sine = math.sin(math.radians(bend_degrees))
    bent = np.isfinite(length) & (width * sine < length)
    radius = np.where(bent, length, 0.0) / (2.0 * sine) if sine else np.zeros_like(length)
    return np.stack([offset, radius, 0.5 * length, radius * math.cos(math.radians(bend_degrees))], axis=-1)


def _rise(side: int, rows: Float64, radius: float) -> Float64:
    """Return the greatest heights of floats before relief, (N,): at their middle on top, at their ends beneath."""
    rise = radius + rows[:, BEND_RADIUS] - rows[:, AXIS_DROP]
    if side == UNDER:
        bent = rows[:, BEND_RADIUS] > 0.0
        _, bend, half, drop = rows[bent].T
        inner = bend - radius
        arc = inner * half / bend
        rise[bent] = drop - np.sqrt((inner - arc) * (inner + arc)) + (half - arc) * half / drop
    return rise


@kernel
def has_gaps(field: HeightField) -> bool:
    """Return whether there are points that no yarn covers."""
    return bool(field.yarn[WARP, RADIUS] < 0.5 and field.yarn[WEFT, RADIUS] < 0.5)


@kernel
def float_height(yarn: Float64, own: Float64, side: int, x: float, y: float) -> tuple[float, float, float]:
    """Return the height of a float and its slopes along local x and y; |x| <= r.

    `yarn` and `own` are the rows of its yarn and its float in a `HeightField`. On the yarn beneath (`side` UNDER) the
    bend is reversed (u -> -u).
    """
    r, beta, bend = yarn[RADIUS], yarn[BETA], own[BEND_RADIUS]
    sine = min(1.0, abs(x) * yarn[INVERSE_RADIUS])
    cosine = math.sqrt((1.0 - sine) * (1.0 + sine))
    steepness = math.copysign(sine, x) / max(cosine, _EDGE)
    if bend == 0.0:
        return beta * r * cosine, -beta * steepness, 0.0
    half, drop = own[HALF_LENGTH], own[AXIS_DROP]
    if side == TOP:
        rho = r * cosine
        root = math.sqrt((bend + rho - y) * (bend + rho + y))
        # The difference root - R cos(u_max), as a quotient without cancellation: small bends keep every digit.
        rise = 2.0 * bend * rho + rho * rho + (half - y) * (half + y)
        height = rise / (root + drop)
        inverse = beta / root
        return beta * height, -(bend + rho) * inverse * steepness, -y * inverse
    inner = bend - r * cosine
    # The inner arc is shorter than the float; past its end the yarn runs on straight at u_max.
    bound = inner * half / bend
    y_arc = min(max(y, -bound), bound)
    root = math.sqrt((inner - y_arc) * (inner + y_arc))
    inverse = beta / root
    height = beta * (drop - root + abs(y - y_arc) * half / drop)
    return height, -inner * inverse * steepness, y_arc * inverse


@kernel
def local_position(family: int, offset: float, x: float, y: float, end: int, pick: int) -> tuple[float, float]:
    """Return (across, along) of a fabric point in its yarn's frame; `end`, `pick` may lie outside the repeat."""
    if family == WARP:
        return x - (end + 0.5), y - (pick + 0.5) + offset
    return y - (pick + 0.5), -(x - (end + 0.5) + offset)


@inlined_kernel
def surface_at(
    field: HeightField, x: float, y: float, end: int, pick: int
) -> tuple[int, int, float, float, float, float, float, float, float]:
    """Return the surface seen from above at (x, y) in cell (pick, end) of the repeat.

    It is family (WARP, WEFT or GAP), side (TOP or UNDER), height, unit ply normal and fibre tangent; 0 at a gap.
    """
    family = int(field.top[pick, end])
    side = TOP
    across, along = local_position(family, field.floats[pick, end, TOP, OFFSET], x, y, end, pick)
    if abs(across) > field.yarn[family, RADIUS]:
        family, side = 1 - family, UNDER
        across, along = local_position(family, field.floats[pick, end, UNDER, OFFSET], x, y, end, pick)
        if abs(across) > field.yarn[family, RADIUS]:
            return GAP, UNDER, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    yarn, own = field.yarn[family], field.floats[pick, end, side]
    radius, bend = yarn[RADIUS], own[BEND_RADIUS]

    # Angles across (v) and along (u) the yarn.
    sin_v = min(1.0, max(-1.0, across * yarn[INVERSE_RADIUS]))
    cos_v = math.sqrt((1.0 - sin_v) * (1.0 + sin_v))
    sin_u = 0.0
    if bend > 0.0 and side == TOP:
        sin_u = along / (bend + radius * cos_v)
    elif bend > 0.0:
        bound = own[HALF_LENGTH] / bend
        sin_u = min(max(-along / (bend - radius * cos_v), -bound), bound)
    cos_u = math.sqrt((1.0 - sin_u) * (1.0 + sin_u))
    height, _, _ = float_height(yarn, own, side, across, along)

    # Normal and twisted tangent of the cylinder, then the relief's stretch along z.
    sin_t, cos_t, beta = yarn[SIN_TWIST], yarn[COS_TWIST], yarn[BETA]
    nx, ny, nz = beta * sin_v, beta * sin_u * cos_v, cos_u * cos_v
    tx = -cos_v * sin_t
    ty = cos_u * cos_t + sin_u * sin_v * sin_t
    tz = beta * (-sin_u * cos_t + cos_u * sin_v * sin_t)
    if beta != 1.0:
        n = 1.0 / math.sqrt(nx * nx + ny * ny + nz * nz)
        nx, ny, nz = nx * n, ny * n, nz * n
        t = 1.0 / math.sqrt(tx * tx + ty * ty + tz * tz)
        tx, ty, tz = tx * t, ty * t, tz * t
    if family == WARP:
        return family, side, height, nx, ny, nz, tx, ty, tz
    return family, side, height, -ny, nx, nz, -ty, tx, tz
