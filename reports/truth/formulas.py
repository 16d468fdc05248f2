"""The model's formulas on arrays of any arithmetic: float32, float64, or objects of 50 digits.

Each comes in the form that keeps its digits (`pipeline.truth`) and in the form of the textbook. In single precision the
textbook's form shows what the other spares us. In 50 digits it is the truth for both: an algebra of its own, not a
slower run of the same code. Vectors are arrays (3, N).
"""

from typing import Any

import mpmath
import numpy as np
import numpy.typing as npt

Array = npt.NDArray[Any]


def exact(values: npt.ArrayLike) -> Array:
    """Return numbers as objects of mpmath; work on them inside `mpmath.workdps`."""
    return np.array(np.frompyfunc(mpmath.mpf, 1, 1)(np.asarray(values, np.float64)), dtype=object)


def dot(a: Array, b: Array) -> Array:
    """Return a.b."""
    return np.asarray(a[0] * b[0] + a[1] * b[1] + a[2] * b[2])


def sigma(w: Array, t: Array, alpha: Array) -> Array:
    """Return the projected area of the flakes, by the cross product: as `slab.sigma`."""
    across, along = np.cross(w, t, axis=0), dot(w, t)
    return np.asarray(np.sqrt(dot(across, across) + alpha * alpha * (along * along)))


def textbook_sigma(w: Array, t: Array, alpha: Array) -> Array:
    """Return the same from |w x t|^2 = |w|^2 |t|^2 - (w.t)^2, a difference of two numbers near 1 at the fibre axis."""
    along = dot(w, t)
    return np.asarray(np.sqrt(dot(w, w) * dot(t, t) - along * along + alpha * alpha * along * along))


def density(v: Array, t: Array, alpha: Array) -> Array:
    """Return D at the half vector of v, by the cross product: as `pipeline.truth.scattering.slab.density`."""
    across, along = np.cross(v, t, axis=0), dot(v, t)
    q = (alpha * alpha * dot(across, across) + along * along) / dot(v, v)
    return np.asarray(alpha * alpha * alpha / (_pi(alpha) * q * q))


def textbook_density(v: Array, t: Array, alpha: Array) -> Array:
    """Return D with |v x t|^2 written out."""
    along, square = dot(v, t), dot(v, v)
    q = alpha * alpha * (square * dot(t, t) - along * along) + along * along
    return np.asarray(alpha * alpha * alpha * square * square / (_pi(alpha) * q * q))


def matrix_density(v: Array, t: Array, alpha: Array) -> Array:
    """Return D as published code has it: the SGGX matrix, its determinant and its cofactors [Heitz2015SGGX]."""
    x, y, z = v / np.sqrt(dot(v, v))
    k = 1 - alpha * alpha
    xx, yy, zz = 1 - k * t[0] * t[0], 1 - k * t[1] * t[1], 1 - k * t[2] * t[2]
    xy, xz, yz = -k * t[0] * t[1], -k * t[0] * t[2], -k * t[1] * t[2]
    determinant = xx * yy * zz - xx * yz * yz - yy * xz * xz - zz * xy * xy + 2 * xy * xz * yz
    form = x * x * (yy * zz - yz * yz) + y * y * (xx * zz - xz * xz) + z * z * (xx * yy - xy * xy)
    form = form + 2 * (x * y * (xz * yz - zz * xy) + x * z * (xy * yz - yy * xz) + y * z * (xy * xz - xx * yz))
    return np.asarray(determinant * np.sqrt(np.abs(determinant)) / (_pi(alpha) * form * form))


def textbook_through(lambda_i: Array, lambda_o: Array, thickness: Any = 2) -> Array:
    """Return G_t = (exp(-T Lambda_o) - exp(-T Lambda_i)) / (Lambda_i - Lambda_o), 0 / 0 at equal Lambda.

    In 50 digits the limit T exp(-T Lambda) stands there.
    """
    difference = lambda_i - lambda_o
    rise = _exp(-thickness * lambda_o) - _exp(-thickness * lambda_i)
    if difference.dtype != object:
        return np.asarray(rise / difference)
    equal = np.equal(difference, 0).astype(np.bool_)
    return np.where(equal, thickness * _exp(-thickness * lambda_i), rise / np.where(equal, 1, difference))


def textbook_slab(wi: Array, wo: Array, t: Array, alpha: Array, thickness: Array) -> Array:
    """Return f_r, or f_t where the light is behind, with their exponentials as they are written.

    D is that of the SGGX matrix but in 50 digits; see `pipeline.truth.scattering.slab` for the parameters.
    """
    flakes = (textbook_density if alpha.dtype == object else matrix_density)(wi + wo, t, alpha)
    sigma_i, sigma_o = textbook_sigma(wi, t, alpha), textbook_sigma(wo, t, alpha)
    cos_i, cos_o = np.abs(wi[2]), np.abs(wo[2])
    if wi[2, 0] < 0:
        return np.asarray(flakes * textbook_through(sigma_i / cos_i, sigma_o / cos_o, thickness) / (4 * cos_i * cos_o))
    depth = thickness * (sigma_i / cos_i + sigma_o / cos_o)
    return np.asarray(flakes * (1 - _exp(-depth)) / (4 * (sigma_i * cos_o + sigma_o * cos_i)))


def torus_height(radius: Any, half: Any, drop: Any, yarn: Any, sine: Array, y: Array) -> Array:
    """Return sqrt((R + r cos v)^2 - y^2) - R cos u_max as the quotient of `pipeline.truth.geometry.heightfield`.

    R, L/2, R cos u_max and r are numbers; sin v and y, the place along the yarn, are arrays.
    """
    rho = yarn * np.sqrt((1 - sine) * (1 + sine))
    root = np.sqrt((radius + rho - y) * (radius + rho + y))
    return np.asarray((2 * radius * rho + rho * rho + (half - y) * (half + y)) / (root + drop))


def textbook_torus_height(radius: Any, half: Any, drop: Any, yarn: Any, sine: Array, y: Array) -> Array:
    """Return the same as the difference it is; parameters as `torus_height`."""
    outer = radius + yarn * np.sqrt(1 - sine * sine)
    return np.asarray(np.sqrt(outer * outer - y * y) - drop)


def torus_normal(radius: Any, yarn: Any, sine: Array, y: Array) -> Array:
    """Return n = (sin v, sin u cos v, cos u cos v) (N, 3), sin u = y / (R + r cos v); parameters as `torus_height`."""
    cosine = np.sqrt((1 - sine) * (1 + sine))
    sin_u = y / (radius + yarn * cosine)
    return np.stack([sine, sin_u * cosine, np.sqrt((1 - sin_u) * (1 + sin_u)) * cosine], axis=1)


def _exp(x: Array) -> Array:
    return np.asarray(np.frompyfunc(mpmath.exp, 1, 1)(x), dtype=object) if x.dtype == object else np.exp(x)


def _pi(like: Array) -> Any:
    return +mpmath.pi if like.dtype == object else like.dtype.type(np.pi)
