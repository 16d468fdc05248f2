"""Surface of a woven repeat: yarn, height, normal and fibre tangent at any point.

The reference for the tests of all faster versions.

Every float is a piece of a torus after [Irawan2012Woven], which makes the cloth a true height field. In the frame of
the float (x across the yarn, y along it, from its centre), with r = w/2, R = L/(2 sin u_max), k = 1/R:

    sin v = x/r,  sin u = k y/(1 + k r cos v),  height = (sqrt((1 + k r cos v)² - (k y)²) - cos u_max)/k
    n = (sin v, sin u cos v, cos u cos v)
    t = (-cos v sin psi, cos u cos psi + sin u sin v sin psi, -sin u cos psi + cos u sin v sin psi),  n·t = 0

The yarn beneath is bent the other way, k < 0: its inner side ends at |y| = (1 + k r cos v) L/2, from where it runs on
straight, inclined by u_max, to the end of the float. The relief beta scales height and slopes. Written with the
curvature k instead of the radius R, everything stays finite and exact as the bend goes to 0.

A weft's frame is the warp's turned by 90°: (x, y) -> (y, -x). Fabric axes: pipeline.truth.conventions.
"""

from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from weaves.draft import Bools, Floats, cells
from weaves.fabric import Fabric
from weaves.yarn import Yarn

WARP: Final = 0
WEFT: Final = 1
GAP: Final = 2


class ClothSurface(NamedTuple):
    """Surface at given points; arrays of one shape."""

    yarn: npt.NDArray[np.int8]  # `WARP`, `WEFT`, or `GAP` where no yarn covers the point, int8
    under: Bools  # true where the yarn on top is too narrow and the one beneath shows
    height: Floats  # in yarn spacings, -inf in gaps; the axis of a yarn is at 0 where a float begins and ends
    normal: Floats  # unit ply normal n_p (upward), +z in gaps, (..., 3)
    tangent: Floats  # unit fibre tangent t, 0 in gaps, (..., 3)


def surface_at(fabric: Fabric, x: npt.ArrayLike, y: npt.ArrayLike) -> ClothSurface:
    """Evaluate the surface, seen from above, at finite points in yarn spacings, broadcast; the repeat has no end."""
    draft = cells(fabric.weave)
    picks, ends = draft.top.shape
    x, y = np.broadcast_arrays(np.mod(np.asarray(x, np.float64), ends), np.mod(np.asarray(y, np.float64), picks))
    # A tiny negative number is congruent to the repeat itself in floating point.
    end, pick = np.minimum(x.astype(np.intp), ends - 1), np.minimum(y.astype(np.intp), picks - 1)
    from_end, from_pick = x - end - 0.5, y - pick - 0.5

    top = draft.top[pick, end]
    half_width = np.array([fabric.warp.width, fabric.weft.width]) / 2
    covered = np.stack([np.abs(from_end), np.abs(from_pick)]) <= half_width.reshape(2, *(1,) * x.ndim)
    on_top = np.where(top == WARP, covered[WARP], covered[WEFT])
    beneath = np.where(top == WARP, covered[WEFT], covered[WARP]) & ~on_top
    yarn = np.where(on_top, top, np.where(beneath, 1 - top, GAP)).astype(np.int8)

    height, normal, tangent = np.full(x.shape, -np.inf), np.zeros((*x.shape, 3)), np.zeros((*x.shape, 3))
    normal[..., 2] = 1.0
    for family, specification in ((WARP, fabric.warp), (WEFT, fabric.weft)):
        here = yarn == family
        cell, under = (pick[here], end[here]), beneath[here]
        length = np.where(under, draft.under_length[cell], draft.top_length[cell])
        offset = np.where(under, draft.under_offset[cell], draft.top_offset[cell])
        across, along = (from_end, from_pick) if family == WARP else (from_pick, from_end)
        sign = 1.0 if family == WARP else -1.0
        height[here], n, t = _torus(specification, length, across[here], sign * (along[here] + offset), under)
        normal[here], tangent[here] = (n, t) if family == WARP else (_weft_to_fabric(n), _weft_to_fabric(t))
    return ClothSurface(yarn, beneath, height, normal, tangent)


def surface_maps(fabric: Fabric, texels_per_yarn: int) -> ClothSurface:
    """Evaluate the surface at texel centres of one repeat, (picks, ends) times `texels_per_yarn`, pick 0 in row 0."""
    ends, picks = fabric.weave.repeat
    x = (np.arange(ends * texels_per_yarn) + 0.5) / texels_per_yarn
    y = (np.arange(picks * texels_per_yarn) + 0.5) / texels_per_yarn
    return surface_at(fabric, x[None, :], y[:, None])


def curvature(yarn: Yarn, length: npt.ArrayLike) -> Floats:
    """Return 1/R = 2 sin u_max / L of floats, whose lengths L may be infinite, and 0 for those drawn flat.

    Flat floats never change side, or are too short for their width: w sin u_max >= L.
    """
    length = np.asarray(length, np.float64)
    sine = np.sin(np.radians(yarn.bend))
    return np.where(yarn.width * sine >= length, 0.0, 2 * sine / length)


def _torus(yarn: Yarn, length: Floats, x: Floats, y: Floats, under: Bools) -> tuple[Floats, Floats, Floats]:
    """Return height, normal and tangent in the frame of the float."""
    k = curvature(yarn, length)
    flat = k == 0
    bend = np.where(flat, 0.0, np.radians(yarn.bend))
    half_length = np.where(flat, 0.0, length / 2)
    k = np.where(under, -k, k)

    # Around the yarn: v. The product keeps cos v exact near the sides.
    r = yarn.width / 2
    sin_v = x / r
    cos_v = np.sqrt((1 - sin_v) * (1 + sin_v))
    rise = r * cos_v

    # Along the yarn: u. Where the inner side of the bend has ended, the yarn runs on straight.
    inner = 1 + k * rise
    bent = np.clip(y, -inner * half_length, inner * half_length)
    bent = np.where(under, bent, np.where(flat, 0.0, y))
    sin_u = k * bent / inner
    cos_u = np.sqrt((1 - sin_u) * (1 + sin_u))

    # The difference of two nearly equal roots, written as a quotient of sums; the straight piece is added.
    sag = k * (half_length - bent) * (half_length + bent)
    height = (2 * rise + k * rise**2 + sag) / (inner * cos_u + np.cos(bend))
    height += (np.abs(y) - np.abs(bent)) * np.tan(bend)

    sin_p, cos_p = np.sin(np.radians(yarn.twist)), np.cos(np.radians(yarn.twist))
    normal = np.stack([sin_v, sin_u * cos_v, cos_u * cos_v], axis=-1)
    along_y, along_z = cos_u * cos_p + sin_u * sin_v * sin_p, -sin_u * cos_p + cos_u * sin_v * sin_p
    tangent = np.stack([-cos_v * sin_p, along_y, along_z], axis=-1)
    beta = yarn.relief
    return beta * height, _unit(normal * (beta, beta, 1.0)), _unit(tangent * (1.0, 1.0, beta))


def _weft_to_fabric(vector: Floats) -> Floats:
    """Turn a vector from the frame of a weft, (y, -x), into that of the fabric."""
    return np.stack([-vector[..., 1], vector[..., 0], vector[..., 2]], axis=-1)


def _unit(vector: Floats) -> Floats:
    length: Floats = np.linalg.norm(vector, axis=-1, keepdims=True)
    return vector / length
