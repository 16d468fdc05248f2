"""Curvature of a query at a point of a curved surface: the least along the ray's way over the boundary.

A query knows one curvature, that of the boundary along the ray. On a cylinder it is Euler's k1 cos^2 + k2 sin^2 in the
plane of ray and normal. Elsewhere it changes along the way, and a ray that grazes a strongly curved place may still
meet the flatter ground behind it: the mean of the curvatures would inflate silhouettes. So the minimum over a short
stretch past the shading point is taken, along the section of the boundary by that plane [Kuznetsov2022Curved].

Curvatures are lengths to the power -1: cloth whose yarns are s times as wide sees s times the curvature.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]

_STEPS = 32  # along a stretch
_CORRECTIONS = 3  # of Newton, which bring a step along the tangent back to the curve


def euler_curvature(first: Floats, second: Floats, angle: Floats) -> Floats:
    """Return the normal curvature at an `angle`, in radians, to the first principal direction: k1 cos^2 + k2 sin^2."""
    return np.asarray(first * np.square(np.cos(angle)) + second * np.square(np.sin(angle)))


def minimum_curvature(
    quadric: npt.ArrayLike, point: npt.ArrayLike, wo: npt.ArrayLike, spacing: float = 1.0, stretch: float = 4.0
) -> Floats:
    """Return the least curvature of a quadric over a stretch past each point, in 1/yarn spacings, at least 0.

    Parameters
    ----------
    quadric : float (3, 3)
        Symmetric A of the boundary p.Ap = 1 with outward normals Ap: diag(1/r^2, 1/r^2, 0) is a cylinder of radius r
        around z. In the world's lengths.
    point : float (N, 3)
        Shading points on it.
    wo : float (N, 3)
        Unit vectors to the viewer; the stretch runs away from it.
    spacing : float
        Length of a yarn spacing in the world, > 0.
    stretch : float
        Length of the stretch, in yarn spacings; 0: the curvature at the point. The paper does not say how long.

    Returns
    -------
    float64 (N,)
        Concave places count as flat.
    """
    matrix, position, viewer = (np.asarray(array, np.float64) for array in (quadric, point, wo))
    gradient = position @ matrix
    length = np.linalg.norm(gradient, axis=-1, keepdims=True)
    normal = gradient / length
    ahead = _unit_along(-viewer, normal)

    # The section by the plane of ray and normal: points x = (ahead, up) with x.Mx + 2 x.(0, length) = 0.
    basis = np.stack([ahead, normal], axis=1)
    section = np.einsum("nij,jk,nlk->nil", basis, matrix, basis)
    linear = np.concatenate([np.zeros_like(length), length], axis=-1)
    x, step = np.zeros_like(linear), stretch * spacing / _STEPS
    least = np.full(len(x), np.inf)
    for walked in range(_STEPS + 1):
        slope = np.einsum("nij,nj->ni", section, x) + linear
        steepness = np.linalg.norm(slope, axis=-1)
        along = np.stack([slope[:, 1], -slope[:, 0]], axis=-1) / steepness[:, None]
        least = np.minimum(least, np.einsum("ni,nij,nj->n", along, section, along) / steepness)
        if walked == _STEPS or step == 0.0:
            break
        x = x + step * along
        for _ in range(_CORRECTIONS):
            slope = np.einsum("nij,nj->ni", section, x) + linear
            value = np.einsum("ni,ni->n", slope + linear, x)
            x = x - slope * (0.5 * value / np.square(slope).sum(axis=-1))[:, None]
    return np.asarray(np.maximum(least, 0.0) * spacing)


def _unit_along(direction: Floats, normal: Floats) -> Floats:
    """Return the unit vectors of directions in the tangent planes; any tangent for a direction along the normal."""
    flat = direction - np.sum(direction * normal, axis=-1, keepdims=True) * normal
    size = np.linalg.norm(flat, axis=-1, keepdims=True)
    any_tangent = np.cross(normal, np.eye(3)[np.abs(normal).argmin(axis=-1)])
    any_tangent /= np.linalg.norm(any_tangent, axis=-1, keepdims=True)
    return np.where(size > 1e-9, flat / np.maximum(size, 1e-300), any_tangent)
