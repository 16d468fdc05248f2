"""The point model over blocks of nodes with soft shadows: the innermost loops.

The formulas are those of pipeline.truth.scattering.point; surface, flakes and layer are those of torus_frame,
flakes_float32 and slab_float32. Two things differ: a horizon is a ramp (soft_horizons), and a highlight has four places
in a node's box.

Light from behind is transmitted, and what the back of the cloth hides is soft too; light and viewer are on different
sides, so that what hides one has nothing to do with what hides the other.

Each family has six sums, as shares of the footprint: AREA seen; DIFFUSE (before 1/pi) and SPECULAR, seen and lit;
BARE_AREA with nothing hidden; OPEN_DIFFUSE and OPEN_SPECULAR, seen, and lit without shadows: an upper bound of energy
(components). With the light behind there are five: the first four, and THROUGH, the area times the share of light that
crosses the yarn unscattered.
"""

import math
from typing import Final, Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from pipeline.analytic.soft_horizons import above, azimuths_apart, ramp, seen_and_lit
from pipeline.analytic.soft_nodes.nodes import BLOCK_NODES, LEVELS
from pipeline.analytic.torus_frame import sigma, spread
from pipeline.compiled.arrays import Float32
from pipeline.compiled.decorators import fast_kernel, inlined_fast_kernel, inlined_kernel
from pipeline.truth.geometry.heightfield import ALPHA, BLEND, WEFT
from pipeline.truth.scattering.slab_float32 import reflection, transmission, unscattered

NODE_SUMS: Final = 6  # sums of a family

AREA, DIFFUSE, SPECULAR, BARE_AREA, OPEN_DIFFUSE, OPEN_SPECULAR = range(NODE_SUMS)
THROUGH: Final = 4  # place of the fifth sum with the light behind

LEAST_SEEN: Final = np.float32(1e-8)  # least seen area by which sums are divided, as a share of the bare area

FADED: Final = np.float32(1e-4)
"""Seen share of the bare area at which components have faded to a half: most such patches are hidden, and answer 0."""

TINY: Final = np.float32(1e-18)  # keeps a quotient of sums finite

Six = tuple[np.float32, np.float32, np.float32, np.float32, np.float32, np.float32]
Behind = Literal[True] | None
"""True if the light is behind. None, not False: kernels are compiled for each of the two alone."""

_0, _1 = np.float32(0.0), np.float32(1.0)
_SHORTEST = np.float32(1e-6)  # least squared length of a half vector
_FLAKES = np.float32(0.25 / (4.0 * math.pi))  # four places a node; 1 / (4 pi) of the density
_GAUSS = np.float32(1.0 / math.sqrt(3.0))
_WHOLE = np.float32(1.001)  # a box that is seen, with the tail of its ramp
_PER_LEVEL = np.float32(1.0 / LEVELS)
_AWAY = np.float32(0.05)  # cosine to the viewer of a fixed node that faces away; a part of its box may not


class YarnDirections(NamedTuple):
    """One query's directions in the frame of one family."""

    ix: np.float32
    iy: np.float32
    iz: np.float32
    ox: np.float32
    oy: np.float32
    oz: np.float32
    """wi and wo."""
    size: np.float32  # 1 / |wi + wo|^2
    alike: np.float32
    right: np.float32
    opposite: np.float32
    """Weights of three relations of their azimuths (soft_horizons)."""


class NodeFrame(NamedTuple):
    """Surface at a node: unit normal, 1 / n_z and unit tangent."""

    nx: np.float32
    ny: np.float32
    nz: np.float32
    inverse: np.float32
    tx: np.float32
    ty: np.float32
    tz: np.float32


class YarnLayer(NamedTuple):
    """Optics of a family: squared roughness, scale of its flakes, optical thickness and blend."""

    square: np.float32
    scale: np.float32
    thickness: np.float32
    blend: np.float32


class NodeHorizons(NamedTuple):
    """Mean horizons of blocks of fixed nodes at the azimuths around a direction, and where between them it lies."""

    low: Float32
    high: Float32
    sharpness: Float32
    turn: np.float32


class GridHorizons(NamedTuple):
    """Grids of `size` x `size` horizons, and what leads from a node's cell to those at the azimuths of a direction."""

    grid: npt.NDArray[np.uint8]
    size: int
    low: np.uint32
    high: np.uint32
    turn: np.float32


@fast_kernel
def directions(
    ix: np.float32, iy: np.float32, iz: np.float32, ox: np.float32, oy: np.float32, oz: np.float32, family: int
) -> YarnDirections:
    """Prepare a query's directions for a family."""
    size = _1 / max((ix + ox) ** 2 + (iy + oy) ** 2 + (iz + oz) ** 2, _SHORTEST)
    alike, right, opposite = azimuths_apart(ix, iy, ox, oy)
    if family == WEFT:
        ix, iy, ox, oy = iy, -ix, oy, -ox
    return YarnDirections(ix, iy, iz, ox, oy, oz, size, alike, right, opposite)


@inlined_fast_kernel
def _flakes(
    d: YarnDirections, h: np.float32, along: np.float32, across: np.float32, square: np.float32, scale: np.float32
) -> np.float32:
    """Return a quarter of the flakes' density, mean of four places, `along` and `across` from h.t in this cosine."""
    e, f = along + across, along - across
    q0, q1 = spread(h - e, d.size, square), spread(h - f, d.size, square)
    q2, q3 = spread(h + f, d.size, square), spread(h + e, d.size, square)
    q01, q23 = q0 * q1, q2 * q3
    # The product of all four may be as small as alpha^16: it is divided by before the cosines are.
    return scale * ((q0 + q1) * q23 + (q2 + q3) * q01) / (q01 * q23)


@inlined_fast_kernel
def shade_node(
    d: YarnDirections, at: NodeFrame, along: np.float32, across: np.float32, seen: np.float32, lit: np.float32,
    weight: np.float32, layer: YarnLayer, behind: Behind = None, least: np.float32 = _0,
) -> Six:  # fmt: skip
    """Return a node's shares of the sums; `along`, `across` as for `_flakes`.

    A node that faces away from the viewer has the cosine `least` to it. Of `seen`, what exceeds 1 are walls, which are
    lit as the whole box.
    """
    facing_o = d.ox * at.nx + d.oy * at.ny + d.oz * at.nz
    facing_i = d.ix * at.nx + d.iy * at.ny + d.iz * at.nz
    wide, cos_o = weight * at.inverse, max(facing_o, least)
    area = wide * cos_o
    along_i, along_o = d.ix * at.tx + d.iy * at.ty + d.iz * at.tz, d.ox * at.tx + d.oy * at.ty + d.oz * at.tz
    flakes = _flakes(d, along_i + along_o, along, across, layer.square, layer.scale)
    sigma_i, sigma_o = sigma(along_i, layer.square), sigma(along_o, layer.square)
    if behind is not None:
        cos_i = max(-facing_i, _0)
        diffuse = area * ((layer.blend * cos_i - (_1 - layer.blend) * d.iz) if cos_i > _0 else _0)
        specular = wide * transmission(flakes, _1, sigma_i, sigma_o, cos_i, cos_o, layer.thickness)
        both, clear = seen * lit, unscattered(sigma_o, cos_o, layer.thickness)
        return area * seen, diffuse * both, specular * both, area, area * seen * clear, _0
    cos_i, of_box = max(facing_i, _0), min(seen, _WHOLE)
    both = seen_and_lit(of_box, lit, d.alike, d.right, d.opposite) + (seen - of_box) * lit
    diffuse = area * ((layer.blend * cos_i + (_1 - layer.blend) * d.iz) if facing_i > _0 else _0)
    specular = wide * reflection(flakes, _1, sigma_i, sigma_o, cos_i, cos_o, layer.thickness)
    return area * seen, diffuse * both, specular * both, area, diffuse * seen, specular * seen


@inlined_fast_kernel
def added(total: Six, own: Six) -> Six:
    """Return sums with the shares of a node added."""
    return (
        total[0] + own[0], total[1] + own[1], total[2] + own[2], total[3] + own[3], total[4] + own[4], total[5] + own[5]
    )  # fmt: skip


@inlined_fast_kernel
def _seen_of(at: NodeFrame, area: np.float32, freed: np.float32, d: YarnDirections) -> np.float32:
    """Return the share of a node's box that the viewer sees, walls included, given its area over flat cloth."""
    facing = d.ox * at.nx + d.oy * at.ny + d.oz * at.nz
    share = area * at.nz / max(facing, _AWAY)
    return min(max(share + freed, _0), max(share, _1)) if facing > _AWAY else share


@inlined_fast_kernel
def _fixed_node(
    nodes: Float32, b: int, k: int, hx: np.float32, hy: np.float32, hz: np.float32
) -> tuple[NodeFrame, np.float32, np.float32]:
    """Return the surface at a fixed node, and how the half vector's cosine with the tangent changes in its box."""
    at = NodeFrame(
        nodes[b, 0, k], nodes[b, 1, k], nodes[b, 2, k], nodes[b, 3, k], nodes[b, 4, k], nodes[b, 5, k], nodes[b, 6, k]
    )
    along = hx * nodes[b, 7, k] + hy * nodes[b, 8, k] + hz * nodes[b, 9, k]
    across = hx * nodes[b, 10, k] + hy * nodes[b, 11, k] + hz * nodes[b, 12, k]
    return at, along, across


@inlined_fast_kernel
def yarn_layer(yarn: Float32, thickness: np.float32) -> YarnLayer:
    """Return the optics of a family, given its row of `SoftNodeTable.yarn`."""
    alpha = yarn[ALPHA]
    square = alpha * alpha
    return YarnLayer(square, _FLAKES * alpha * square, thickness, yarn[BLEND])


@fast_kernel
def shade_fixed(
    nodes: Float32, weight: Float32, light: NodeHorizons, areas: Float32, freed: Float32, walls: Float32 | None,
    d: YarnDirections, yarn: Float32, thickness: np.float32,
) -> Six:  # fmt: skip
    """Return the sums over fixed nodes of one family; `areas`, `freed` and `walls` as in `Scratch`.

    There are `walls` with the light behind alone; `light` has the horizons of the back then, and the walls are dark.
    """
    layer, rise = yarn_layer(yarn, thickness), d.iz if walls is None else -d.iz
    behind: Behind = None if walls is None else True
    hx, hy, hz = d.ix + d.ox, d.iy + d.oy, d.iz + d.oz
    total = (_0, _0, _0, _0, _0, _0)
    for b in range(len(weight)):
        for k in range(BLOCK_NODES):
            lit = ramp(above(rise, light.low[b, k], light.high[b, k], light.turn, light.sharpness[b, k]))
            if walls is not None:
                lit *= _1 - _PER_LEVEL * walls[b, k]
            at, along, across = _fixed_node(nodes, b, k, hx, hy, hz)
            seen = _seen_of(at, areas[b, k], freed[b, k], d)
            total = added(total, shade_node(d, at, along, across, seen, lit, weight[b, k], layer, behind, _AWAY))
    return total


@inlined_kernel
def write_sums(sums: Six, result: Float32) -> None:
    """Write the sums of a family to its row."""
    for q in range(NODE_SUMS):
        result[q] = sums[q]


@fast_kernel
def shares_of(weight: Float32, areas: Float32) -> np.float32:
    """Return the sum of weights times areas, of fixed nodes."""
    area = _0
    for b in range(len(weight)):
        for k in range(BLOCK_NODES):
            area += weight[b, k] * areas[b, k]
    return area


@fast_kernel
def write_freed(bent: NodeHorizons, flat: NodeHorizons, oz: np.float32, freed: Float32) -> None:
    """Write by how much more of the boxes of fixed nodes is seen if their horizons are bent."""
    for b in range(len(freed)):
        for k in range(BLOCK_NODES):
            over_bent = above(oz, bent.low[b, k], bent.high[b, k], bent.turn, bent.sharpness[b, k])
            over_flat = above(oz, flat.low[b, k], flat.high[b, k], flat.turn, flat.sharpness[b, k])
            freed[b, k] = ramp(over_bent) - ramp(over_flat)
