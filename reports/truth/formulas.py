"""The model's formulas on arrays of any arithmetic: float32, float64, or objects of 50 digits.

Each comes in the form that keeps its digits (`pipeline.truth`) and in the form of the textbook. The textbook's in
single precision shows what the other spares us; the textbook's in 50 digits is the truth that both are held against:
an algebra of its own, not a slower run of the same code.
"""

from __future__ import annotations

from typing import Any, Final

import mpmath
import numpy as np
import numpy.typing as npt

DIGITS: Final = 50

Array = npt.NDArray[Any]
Vector = tuple[Array, Array, Array]


def exact(values: npt.ArrayLike) -> Array:
    """Return numbers as objects of 50 digits; work on them inside `mpmath.workdps(DIGITS)`."""
    return np.array(np.frompyfunc(mpmath.mpf, 1, 1)(np.asarray(values, np.float64)), dtype=object)


def dot(a: Vector, b: Vector) -> Array:
    """Return a.b."""
    return np.asarray(a[0] * b[0] + a[1] * b[1] + a[2] * b[2])


def cross(a: Vector, b: Vector) -> Vector:
    """Return a x b."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def sigma(w: Vector, t: Vector, alpha: Array) -> Array:
    """Return the projected area of the flakes, by the cross product: as `microflake.sigma`."""
    across, along = cross(w, t), dot(w, t)
    return np.asarray(np.sqrt(dot(across, across) + alpha * alpha * (along * along)))


def textbook_sigma(w: Vector, t: Vector, alpha: Array) -> Array:
    """Return the same from |w x t|^2 = |w|^2 |t|^2 - (w.t)^2, a difference of two numbers near 1 at the fibre axis."""
    along = dot(w, t)
    return np.asarray(np.sqrt(dot(w, w) * dot(t, t) - along * along + alpha * alpha * along * along))


def density(v: Vector, t: Vector, alpha: Array) -> Array:
    """Return D at the half vector of v, by the cross product: as `pipeline.truth.scattering.microflake.density`."""
    across, along = cross(v, t), dot(v, t)
    q = (alpha * alpha * dot(across, across) + along * along) / dot(v, v)
    return np.asarray(alpha * alpha * alpha / (_pi(alpha) * q * q))


def textbook_density(v: Vector, t: Vector, alpha: Array) -> Array:
    """Return D with |v x t|^2 written out."""
    along, square = dot(v, t), dot(v, v)
    q = alpha * alpha * (square * dot(t, t) - along * along) + along * along
    return np.asarray(alpha * alpha * alpha * square * square / (_pi(alpha) * q * q))


def matrix_density(v: Vector, t: Vector, alpha: Array) -> Array:
    """Return D as published code has it: the SGGX matrix, its determinant and its cofactors [Heitz2015SGGX]."""
    length = np.sqrt(dot(v, v))
    x, y, z = (c / length for c in v)
    k = 1 - alpha * alpha
    xx, yy, zz = 1 - k * t[0] * t[0], 1 - k * t[1] * t[1], 1 - k * t[2] * t[2]
    xy, xz, yz = -k * t[0] * t[1], -k * t[0] * t[2], -k * t[1] * t[2]
    determinant = xx * yy * zz - xx * yz * yz - yy * xz * xz - zz * xy * xy + 2 * xy * xz * yz
    form = x * x * (yy * zz - yz * yz) + y * y * (xx * zz - xz * xz) + z * z * (xx * yy - xy * xy)
    form = form + 2 * (x * y * (xz * yz - zz * xy) + x * z * (xy * yz - yy * xz) + y * z * (xy * xz - xx * yz))
    return np.asarray(determinant * np.sqrt(np.abs(determinant)) / (_pi(alpha) * form * form))


def textbook_through(lambda_i: Array, lambda_o: Array, thickness: Array) -> Array:
    """Return G_t = (exp(-T Lambda_o) - exp(-T Lambda_i)) / (Lambda_i - Lambda_o), 0 / 0 at equal Lambda.

    In 50 digits the limit T exp(-T Lambda) stands there.
    """
    difference = lambda_i - lambda_o
    if difference.dtype != object:
        with np.errstate(invalid="ignore", divide="ignore"):
            return np.asarray((np.exp(-thickness * lambda_o) - np.exp(-thickness * lambda_i)) / difference)
    equal = np.equal(difference, 0).astype(np.bool_)
    quotient = (exp(-thickness * lambda_o) - exp(-thickness * lambda_i)) / np.where(equal, 1, difference)
    return np.where(equal, thickness * exp(-thickness * lambda_i), quotient)


def textbook_reflection(flakes: Array, s_i: Array, s_o: Array, c_i: Array, c_o: Array, thickness: Array) -> Array:
    """Return f_r with 1 - exp(-x) as it is written; parameters as `pipeline.truth.scattering.slab.reflection`."""
    depth = thickness * (s_i / c_i + s_o / c_o)
    return np.asarray(flakes * (1 - exp(-depth)) / (4 * (s_i * c_o + s_o * c_i)))


def textbook_transmission(flakes: Array, s_i: Array, s_o: Array, c_i: Array, c_o: Array, thickness: Array) -> Array:
    """Return f_t with the difference of two exponentials; parameters as `slab.transmission`."""
    return np.asarray(flakes * textbook_through(s_i / c_i, s_o / c_o, thickness) / (4 * c_i * c_o))


def torus_height(bend: Array, half: Array, drop: Array, r: Array, sine: Array, y: Array) -> Array:
    """Return sqrt((R + r cos v)^2 - y^2) - R cos u_max as the quotient of `pipeline.truth.geometry.heightfield`.

    Parameters
    ----------
    bend, half, drop : array
        R, L/2 and R cos u_max.
    r, sine, y : array
        Radius of the yarn, sin v, and the place along it.
    """
    rho = r * np.sqrt((1 - sine) * (1 + sine))
    root = np.sqrt((bend + rho - y) * (bend + rho + y))
    return np.asarray((2 * bend * rho + rho * rho + (half - y) * (half + y)) / (root + drop))


def textbook_torus_height(bend: Array, half: Array, drop: Array, r: Array, sine: Array, y: Array) -> Array:
    """Return the same as the difference it is; parameters as `torus_height`."""
    outer = bend + r * np.sqrt(1 - sine * sine)
    return np.asarray(np.sqrt(outer * outer - y * y) - drop)


def torus_normal(bend: Array, r: Array, sine: Array, y: Array) -> Vector:
    """Return n = (sin v, sin u cos v, cos u cos v), sin u = y / (R + r cos v); parameters as `torus_height`."""
    cosine = np.sqrt((1 - sine) * (1 + sine))
    sin_u = y / (bend + r * cosine)
    return sine, sin_u * cosine, np.sqrt((1 - sin_u) * (1 + sin_u)) * cosine


def exp(x: Array) -> Array:
    """Return the exponential in the arithmetic of x."""
    return np.asarray(np.frompyfunc(mpmath.exp, 1, 1)(x), dtype=object) if x.dtype == object else np.exp(x)


def _pi(like: Array) -> Any:
    return +mpmath.pi if like.dtype == object else like.dtype.type(np.pi)
