"""Corner inputs of the point model, and what computes it there in each arithmetic (`reports.truth.stability_point`).

Single precision is what answers queries from tables: the loops of `pipeline.truth.node_table.kernels`, called here on
one node at a time. Double precision is `microflake` and `slab`, 50 digits `reports.truth.formulas`.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, Final, NamedTuple

import numpy as np

from pipeline.truth.node_table import kernels
from pipeline.truth.node_table.directions import Direction
from pipeline.truth.node_table.kernels import Layer, Normals, Tangents
from pipeline.truth.scattering import microflake, slab
from reports.truth import formulas
from reports.truth.formulas import Array, Vector

_NEAREST: Final = 0.5  # least |wi + wo| where the half vector is well-conditioned


class Corners(NamedTuple):
    """N lit points in the frame of the yarn: the normal is z."""

    wi: Vector
    wo: Vector
    t: Vector
    alpha: Array
    thickness: Array

    @property
    def v(self) -> Vector:
        """The half vector, not normalised: wi + wo."""
        return self.wi[0] + self.wo[0], self.wi[1] + self.wo[1], self.wi[2] + self.wo[2]

    @property
    def cosines(self) -> tuple[Array, Array]:
        """Moduli of the cosines to the normal."""
        return np.abs(self.wi[2]), np.abs(self.wo[2])

    @property
    def inputs(self) -> dict[str, Array]:
        """Label of a corner in the results."""
        names = {"wi": np.stack(self.wi, axis=1), "wo": np.stack(self.wo, axis=1), "t": np.stack(self.t, axis=1)}
        return {**names, "alpha": self.alpha, "T": self.thickness}

    def cast(self, change: Callable[[Array], Array]) -> Corners:
        """Return the corners in another arithmetic."""
        wi, wo, t = ((change(w[0]), change(w[1]), change(w[2])) for w in (self.wi, self.wo, self.t))
        return Corners(wi, wo, t, change(self.alpha), change(self.thickness))


def single_precision(values: Array) -> Array:
    """Round to float32."""
    return values.astype(np.float32)


def double_precision(values: Array) -> Array:
    """Widen to float64."""
    return values.astype(np.float64)


def draw(
    count: int,
    alpha: float,
    light: tuple[float, ...],
    viewer: tuple[float, ...],
    thickness: tuple[float, ...],
    behind: bool = False,
) -> Corners:
    """Return corners with angles to the normal from `light` and `viewer`, degrees, in float64.

    Fibres lie across the normal: a third anywhere, a third near the middle of the highlight, where wi + wo is at right
    angles to them, a third near the plane of the light, as near to its direction as they can.
    """
    random = np.random.default_rng([count, round(1e6 * alpha), int(behind)])
    # Half vectors that rounding alone spoils have rows of their own; 4 candidates for each corner suffice.
    angle_i, angle_o = (np.radians(random.choice(angles, 4 * count)) for angles in (light, viewer))
    # Small turns make light and viewer all but alike to the fibres: that is where Lambda is nearly equal.
    small = 10.0 ** random.uniform(-7, -1, 8)
    turn = random.choice([0.0, math.pi, *small, *random.uniform(0, 2 * math.pi, 14)], 4 * count)
    wi = np.stack([np.sin(angle_i), 0 * turn, np.cos(angle_i) * (-1 if behind else 1)])
    wo = np.stack([np.sin(angle_o) * np.cos(turn), np.sin(angle_o) * np.sin(turn), np.cos(angle_o)])
    apart = np.flatnonzero(np.linalg.norm(wi + wo, axis=0) >= _NEAREST)[:count]
    wi, wo = wi[:, apart], wo[:, apart]
    v = wi + wo
    near = 3 * alpha * random.uniform(-1, 1, len(apart))
    across = np.arctan2(v[0], -v[1]) + near
    kinds = (random.uniform(0, 2 * math.pi, len(apart)), across, near)
    fibre = np.choose(random.integers(3, size=len(apart)), kinds)
    t = np.stack([np.cos(fibre), np.sin(fibre), 0 * fibre])
    depth = random.choice(thickness, len(apart))
    return Corners(vector(wi), vector(wo), vector(t), np.full(len(apart), alpha), depth)


def kernel_sigma(w: Vector, t: Vector, alpha: Array) -> Array:
    """Return sigma as `microflake` computes it."""
    return each(microflake.sigma, *w, *t, alpha)


def kernel_density(v: Vector, t: Vector, alpha: Array) -> Array:
    """Return D as `microflake` computes it."""
    return each(microflake.density, *v, *t, alpha)


def kernel_slab(corners: Corners, behind: bool) -> Array:
    """Return f_r, or f_t of light from behind, as `slab` computes it."""
    flakes = kernel_density(corners.v, corners.t, corners.alpha)
    sigmas = (kernel_sigma(w, corners.t, corners.alpha) for w in (corners.wi, corners.wo))
    function = slab.transmission if behind else slab.reflection
    return each(function, flakes, *sigmas, *corners.cosines, corners.thickness)


def textbook_slab(corners: Corners, behind: bool) -> Array:
    """Return the same as the textbook has it, in the arithmetic of the corners."""
    wide = corners.alpha.dtype == object
    density = formulas.textbook_density if wide else formulas.matrix_density
    sigma_i, sigma_o = (formulas.textbook_sigma(w, corners.t, corners.alpha) for w in (corners.wi, corners.wo))
    function = formulas.textbook_transmission if behind else formulas.textbook_reflection
    flakes = density(corners.v, corners.t, corners.alpha)
    with np.errstate(all="ignore"):
        return function(flakes, sigma_i, sigma_o, *corners.cosines, corners.thickness)


def node_slab(corners: Corners, behind: bool) -> Array:
    """Return the same, times the two cosines, as the loops over nodes compute it in single precision."""
    function: Callable[..., Any] = kernels.transmitted if behind else kernels.reflected
    one = np.ones(1, np.float32)
    result = np.zeros(len(corners.alpha))
    half = np.square(np.stack([double_precision(part) for part in corners.v])).sum(axis=0)
    for k, (size, alpha) in enumerate(zip(half, corners.alpha.tolist(), strict=True)):
        t = [part[k : k + 1] for part in corners.t]
        sign = np.float32(-1 if behind else 1)
        wi, wo = [sign * part[k] for part in corners.wi], [part[k] for part in corners.wo]
        layer = Layer(*(np.float32(x) for x in (alpha**2, corners.thickness[k], alpha**3 / (4 * math.pi))))
        inverse = np.float32(1 / max(size, 1e-12))
        level, tangent = Normals(0 * one, 0 * one, one, one), Tangents(*t)
        result[k] = function(level, tangent, _direction(wi), _direction(wo), inverse, layer, one, 0 * one)
    return result


def node_crossing(corners: Corners) -> Array:
    """Return exp(-T Lambda) towards the viewer as the loop over nodes computes it in single precision."""
    function: Callable[..., Any] = kernels.crossing
    one = np.ones(1, np.float32)
    result = np.zeros(len(corners.alpha))
    for k, alpha in enumerate(corners.alpha.tolist()):
        t, wo = [part[k : k + 1] for part in corners.t], [part[k] for part in corners.wo]
        layer = Layer(np.float32(alpha**2), corners.thickness[k], np.float32(0))
        result[k] = function(Normals(0 * one, 0 * one, one, one), Tangents(*t), _direction(wo), layer, one)
    return result


def _direction(w: list[np.float32]) -> Direction:
    """Return a direction for loops over nodes that read no horizon."""
    return Direction(w[0], w[1], w[2], slope=np.float32(0), first=0, second=0, turn=np.float32(0))


def around_axis(random: np.random.Generator, count: int, apart: float = 0.0) -> tuple[Vector, Vector]:
    """Return unit axes, and unit directions `apart` from them, in radians; from 0 to 1 if that is not given."""
    t = unit(random.normal(size=(3, count)))
    aside = unit(np.cross(t, random.normal(size=(3, count)), axis=0))
    near = np.where(random.random(count) < 0.05, 0.0, 10.0 ** random.uniform(-6, 0, count))
    angle = np.full(count, apart) if apart else near
    return vector(t), vector(t * np.cos(angle) + aside * np.sin(angle))


def unit(vectors: Array) -> Array:
    """Return vectors (3, N) of length 1."""
    return np.asarray(vectors / np.linalg.norm(vectors, axis=0))


def vector(parts: Array) -> Vector:
    """Return the three rows of (3, N)."""
    return parts[0], parts[1], parts[2]


def each(function: Callable[..., Any], *columns: Array) -> Array:
    """Call a compiled function row by row."""
    return np.array([function(*row) for row in zip(*columns, strict=True)], np.float64)
