"""Surface and flakes at a place of a torus of yarn, in the form that inlined loops call.

    N = (beta sin v, beta sin u cos v, cos u cos v)
    T = (-cos v sin psi, cos u cos psi + sin u sin v sin psi, beta (cos u sin v sin psi - sin u cos psi))

in the frame of the yarn (x across, y along, z up), with v across and u along it, twist psi and relief beta; n = N / |N|
and t = T / |T|. pipeline.truth.geometry.heightfield.surface_at computes the same in double precision, one point at a
time; weaves.surface is the oracle. Flakes need cosines with the tangent alone: for unit vectors
|w x t|^2 = 1 - (w.t)^2. Against the cross products of pipeline.truth.scattering.slab this loses digits near the fibre
axis, which approximations can spare, and saves a third of the arithmetic.
"""

from typing import Any, NamedTuple, TypeAlias

import numpy as np

from pipeline.compiled.decorators import inlined_fast_kernel

Scalar: TypeAlias = Any
"""float32 in loops over points, float64 where nodes are tabulated; all arguments of a call are of one type."""

_1 = np.float32(1.0)


class Angles(NamedTuple):
    """A place on the torus: sines and cosines of v (across the yarn) and u (along it)."""

    sin_v: Scalar
    cos_v: Scalar
    sin_u: Scalar
    cos_u: Scalar


class Fibre(NamedTuple):
    """Sine and cosine of the twist, and the relief beta."""

    sin_twist: Scalar
    cos_twist: Scalar
    beta: Scalar


class Tangent(NamedTuple):
    """The unit tangent t, and 1 / |T|."""

    x: Scalar
    y: Scalar
    z: Scalar
    inverse: Scalar


@inlined_fast_kernel
def bend(
    sin_v: Scalar, cos_v: Scalar, radius: Scalar, position: Scalar, curvature: Scalar, limit: Scalar
) -> tuple[Angles, Scalar]:
    """Return the angles at a position along the yarn, and the curvature there, 1 / (R + r cos v).

    v is the angle across the yarn, r its `radius`, in yarn spacings; `position` the distance along the yarn from the
    middle of its float; `curvature` 1 / R of the float's axis, negative for a yarn beneath, whose bend is reversed;
    `limit` the largest |sin u|.
    """
    inner = curvature / (_1 + radius * curvature * cos_v)
    sin_u = min(max(position * inner, -limit), limit)
    return Angles(sin_v, cos_v, sin_u, np.sqrt((_1 - sin_u) * (_1 + sin_u))), inner


@inlined_fast_kernel
def normal(a: Angles, beta: Scalar) -> tuple[Scalar, Scalar, Scalar]:
    """Return the unit normal n."""
    x, y, z = beta * a.sin_v, beta * a.sin_u * a.cos_v, a.cos_u * a.cos_v
    inverse = _1 / np.sqrt(x * x + y * y + z * z)
    return x * inverse, y * inverse, z * inverse


@inlined_fast_kernel
def tangent(a: Angles, fibre: Fibre) -> Tangent:
    """Return the unit tangent t."""
    x = -a.cos_v * fibre.sin_twist
    y = a.cos_u * fibre.cos_twist + a.sin_u * a.sin_v * fibre.sin_twist
    z = fibre.beta * (a.cos_u * a.sin_v * fibre.sin_twist - a.sin_u * fibre.cos_twist)
    inverse = _1 / np.sqrt(x * x + y * y + z * z)
    return Tangent(x * inverse, y * inverse, z * inverse, inverse)


@inlined_fast_kernel
def turning(hx: Scalar, hy: Scalar, hz: Scalar, t: Tangent, a: Angles, fibre: Fibre) -> tuple[Scalar, Scalar]:
    """Return the derivatives of h.t by u and by v, for any h."""
    # Derivatives of T; their part along t is subtracted below.
    uy = a.cos_u * a.sin_v * fibre.sin_twist - a.sin_u * fibre.cos_twist
    uz = -fibre.beta * (a.cos_u * fibre.cos_twist + a.sin_u * a.sin_v * fibre.sin_twist)
    vx, vy = a.sin_v * fibre.sin_twist, a.sin_u * a.cos_v * fibre.sin_twist
    vz = fibre.beta * a.cos_u * a.cos_v * fibre.sin_twist
    h = hx * t.x + hy * t.y + hz * t.z
    by_u = hy * uy + hz * uz - h * (uy * t.y + uz * t.z)
    by_v = hx * vx + hy * vy + hz * vz - h * (vx * t.x + vy * t.y + vz * t.z)
    return t.inverse * by_u, t.inverse * by_v


@inlined_fast_kernel
def sigma(along: np.float32, square: np.float32) -> np.float32:
    """Return the projected area of flakes of roughness alpha towards w; `along` is w.t, `square` alpha^2."""
    area: np.float32 = np.sqrt(max(_1 - (_1 - square) * along * along, square))
    return area


@inlined_fast_kernel
def spread(along: np.float32, size: np.float32, square: np.float32) -> np.float32:
    """Return q^2, of which D = alpha^3 / (pi q^2); `along` is (wi + wo).t, `size` 1 / |wi + wo|^2."""
    q = square + (_1 - square) * size * along * along
    return q * q
