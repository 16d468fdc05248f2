"""Queries of the patch BSDF and their answers.

A query is one patch seen from one direction and lit from another (directions: pipeline.truth.conventions); an
answer holds the four components.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from pipeline.compiled.arrays import Float32, Mask
from weaves.errors import BadInput

_UNIT_TOLERANCE = 1e-4


class Queries(NamedTuple):
    """N queries about one fabric.

    Attributes
    ----------
    u, v : float32 (N,)
        Footprint centre, in yarn spacings, along x (weft direction) and y (warp direction).
    sigma : float32 (N,)
        Standard deviation of the footprint along its first axis, in yarn spacings, > 0.
    wi, wo : float32 (N, 3)
        Unit vectors to the light and to the viewer; if they are on different sides of the cloth, the answer is its
        transmission.
    sigma_minor : float32 (N,)
        Standard deviation along the second axis, at right angles to the first; equal to `sigma` if round.
    angle : float32 (N,)
        Angle from x to the first axis, radians.
    curvature : float32 (N,)
        Curvature kappa of the cloth in the viewer's plane, in 1/yarn spacings, 0 <= kappa <= 1; across it lies the axis
        of the cylinder that the cloth is wrapped around.

    Examples
    --------
    Light and viewer straight above one yarn and straight above its neighbour:

    >>> up = [[0, 0, 1], [0, 0, 1]]
    >>> queries = Queries.round(u=[0.5, 1.5], v=[0.5, 0.5], sigma=[0.1, 0.1], wi=up, wo=up)
    >>> queries.behind.tolist()
    [False, False]
    >>> len(queries.take(queries.u > 1).u)
    1
    """

    u: Float32
    v: Float32
    sigma: Float32
    wi: Float32
    wo: Float32
    sigma_minor: Float32
    angle: Float32
    curvature: Float32

    @classmethod
    def round(
        cls, u: npt.ArrayLike, v: npt.ArrayLike, sigma: npt.ArrayLike, wi: npt.ArrayLike, wo: npt.ArrayLike
    ) -> Queries:
        """Return queries about round footprints of a flat cloth, from arrays (N,) and directions (N, 3).

        Examples
        --------
        >>> Queries.round(u=[0.5], v=[0.5], sigma=[0.1], wi=[[0.6, 0, 0.8]], wo=[[0, 0, 1]]).wi.shape
        (1, 3)
        """
        u, v, sigma, wi, wo = (np.asarray(column, np.float32) for column in (u, v, sigma, wi, wo))
        flat = np.zeros_like(sigma)
        return cls(u, v, sigma, wi, wo, sigma, flat, flat)

    @property
    def behind(self) -> Mask:
        """True for queries with light or viewer behind the cloth, (N,)."""
        return np.asarray((self.wi[:, 2] < 0.0) | (self.wo[:, 2] < 0.0))

    def turned(self) -> Queries:
        """Return the queries as the back of the cloth has them: reflected in the fabric plane, places kept."""
        flip = np.array([1.0, 1.0, -1.0], np.float32)
        return self._replace(wi=self.wi * flip, wo=self.wo * flip)

    def raised(self) -> Queries:
        """Return the queries with viewers lower than `LOWEST_VIEWER` tilted up to it, on their side of the cloth."""
        low = np.abs(self.wo[:, 2]) < LOWEST_VIEWER
        if not low.any():
            return self
        flat, wo = self.wo[low, :2].astype(np.float64), self.wo.copy()
        wo[low, :2] = flat * (math.sqrt(1.0 - LOWEST_VIEWER**2) / np.linalg.norm(flat, axis=1, keepdims=True))
        wo[low, 2] = np.copysign(LOWEST_VIEWER, wo[low, 2])
        return self._replace(wo=wo)

    def take(self, index: npt.NDArray[np.integer] | Mask | slice) -> Queries:
        """Return the queries at `index`."""
        if isinstance(index, slice):
            return Queries(*(column[index] for column in self))
        rows = np.flatnonzero(index) if np.asarray(index).dtype == bool else index
        return Queries(*(column.take(rows, axis=0) for column in self))  # 40 % of the time of column[rows]


class Answers(NamedTuple):
    """N patch BSDF values with their uncertainty; columns in the order of `pipeline.truth.conventions.COMPONENTS`."""

    mean: Float32
    standard_error: Float32
    bound: Float32
    """Components with unit colour, the standard error of each, and a bound of its error (pipeline.truth.calibration),
    (N, 4)."""
    count: npt.NDArray[np.int32]  # type: ignore[assignment]  # the field's word, though tuples have a count too
    """Points evaluated, int32 (N,)."""
    transparency: Float32
    transparency_standard_error: Float32
    transparency_bound: Float32
    """Share of light from straight behind that reaches the viewer unscattered, through gaps and yarns, (N,)."""

    @classmethod
    def opaque(cls, mean: Float32, standard_error: Float32, count: npt.NDArray[np.int32]) -> Answers:
        """Return answers of a cloth that lets nothing straight through, bounded by three standard errors."""
        through = (np.zeros(len(mean), np.float32) for _ in range(3))
        return cls(mean, standard_error, 3 * standard_error, count, *through)

    def take(self, index: npt.NDArray[np.integer] | Mask | slice) -> Answers:
        """Return the answers at `index`."""
        return Answers(*(column[index] for column in self))  # type: ignore[arg-type]


HIDDEN_SHARE = 1e-3
"""A patch of which the viewer sees less than this share of its projected area counts as hidden and answers 0."""

LOWEST_VIEWER = math.cos(math.radians(89.0))
"""Least cosine of a viewer with parallax: a lower one sees a footprint through many yarns."""

STEEPEST_CURVATURE = 1.0  # largest curvature: a cylinder as thick as two yarn spacings


def faults(queries: Queries, parallax: bool = False) -> dict[int, tuple[str, object, str]]:
    """Return the fault of each query that has no answer: row -> (column, value, what is allowed).

    With `parallax` a viewer lower than `LOWEST_VIEWER` has none.
    """
    found: dict[int, tuple[str, object, str]] = {}

    def note(rows: Any, name: str, allowed: str) -> None:
        index = np.flatnonzero(rows)
        for row, value in zip(index.tolist(), getattr(queries, name)[index].tolist(), strict=True):
            found.setdefault(row, (name, value, allowed))

    for name, column in zip(Queries._fields, queries, strict=True):
        note(~np.isfinite(column).all(axis=tuple(range(1, column.ndim))), name, "must be finite")
    for name in ("sigma", "sigma_minor"):
        note(getattr(queries, name) <= 0, name, "must be greater than 0")
    for name, directions in (("wi", queries.wi), ("wo", queries.wo)):
        with np.errstate(invalid="ignore", over="ignore"):
            length = np.linalg.norm(directions.astype(np.float64), axis=-1)
            note(np.abs(length - 1.0) > _UNIT_TOLERANCE, name, "must have unit length")
        note(directions[:, 2] == 0, name, "must not lie in the fabric plane")
    allowed = f"must be from 0 to {STEEPEST_CURVATURE:g}: no cylinder may be thinner than the yarns on it"
    note((queries.curvature < 0) | (queries.curvature > STEEPEST_CURVATURE), "curvature", allowed)
    curved_behind = (queries.curvature > 0) & (queries.wo[:, 2] < 0)
    note(curved_behind, "curvature", "must be 0 where the viewer is behind the cloth")
    if parallax:
        low = np.abs(queries.wo[:, 2]) < LOWEST_VIEWER
        note(low, "wo", "with parallax a viewer must be within 89 degrees of the normal")
    return found


def validate(queries: Queries, parallax: bool = False) -> None:
    """Refuse queries that have no answer with a BadInput that names the first and counts the others."""
    rows = np.shape(queries.u)[:1] or (1,)
    for name, column in zip(Queries._fields, queries, strict=True):
        shape = (*rows, 3) if name in ("wi", "wo") else rows
        if np.shape(column) != shape:
            allowed = f"must be {shape}: all columns have equal rows"
            raise BadInput("queries", f"shape of {name}", np.shape(column), allowed)
    found = faults(queries, parallax)
    if not found:
        return
    row = min(found)
    name, value, allowed = found[row]
    more = f" ({len(found) - 1} more bad rows)" if len(found) > 1 else ""
    raise BadInput("queries", f"{name}[{row}]", value, allowed + more)
