"""Monte Carlo estimates of the patch BSDF, each with its standard error.

Every estimator runs `REPLICATES` independent replicates of the same number of points and doubles that number until the
error asked for is reached. A component is the ratio of two sums, f = N / D; its standard error comes from the spread of
the replicates' residuals N_r - f D_r (the linearised ratio estimator [Cochran1977Sampling]), with REPLICATES - 1
degrees of freedom. Patches that are all but hidden go on until every replicate has seen a point, up to HIDDEN_PATIENCE
times the limit; one that no point sees answers 0. `mc` takes independent random points, `owen` one scrambled Sobol
sequence a replicate, whose error falls faster than count^-1/2.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from pipeline.truth.footprint import BOX, GAUSSIAN, place
from pipeline.truth.heightfield import GAP, HeightField, height_field
from pipeline.truth.kernel import kernel
from pipeline.truth.options import TruthOptions
from pipeline.truth.patch import point_share
from pipeline.truth.query import Answers, Queries
from pipeline.truth.sequences import derive, owen_pair, uniform
from pipeline.truth.visibility import Ray, ray
from weaves.errors import BadInput
from weaves.fabric import Fabric

REPLICATES = 16

HIDDEN_PATIENCE = 16
"""Times `max_count` that a patch may spend of which some replicate has not seen a single point."""

_MC, _OWEN = 0, 1
_ESTIMATORS = {"mc": _MC, "owen": _OWEN}
_FOOTPRINTS = {"gaussian": GAUSSIAN, "box": BOX}
_AREA = 4  # column of the denominator, after the four components


def estimate(fabric: Fabric, queries: Queries, options: TruthOptions, seed: int, start: int = 0) -> Answers:
    """Answer queries about a fabric.

    Parameters
    ----------
    fabric : Fabric
        What is asked about.
    queries : Queries
        N questions; both directions in front of the cloth.
    options : TruthOptions
        Estimator, error asked for, and the choices of the model.
    seed : int
        Name of the random numbers, 0 <= seed < 2^64.
    start : int
        Index of the first query in its stream: a query's numbers depend on `seed` and this index alone.

    Raises
    ------
    BadInput
        If a query holds NaN, a footprint that is not positive, or a direction behind the cloth or off unit length.
    """
    validate(queries)
    mean, standard_error, count = _estimate_all(
        height_field(fabric),
        *_columns(queries),
        _ESTIMATORS[options.estimator],
        _FOOTPRINTS[options.footprint],
        options.relative_error,
        options.min_count,
        options.max_count,
        np.uint64(seed),
        start,
    )
    return Answers(mean, standard_error, count)


def point_sampled(
    fabric: Fabric, queries: Queries, count: int, seed: int, footprint: str = "gaussian"
) -> npt.NDArray[np.float32]:
    """Answer queries from `count` independent points each: the aliased baseline [Jin2022Woven], (N, 4)."""
    return PointSampler(fabric, footprint).sample(queries, count, seed)


class PointSampler:
    """The point-sampled baseline with its fabric tabulated once, as a renderer would hold it.

    Parameters
    ----------
    fabric : Fabric
        What is asked about.
    footprint : str
        ``gaussian`` or ``box``.
    """

    def __init__(self, fabric: Fabric, footprint: str = "gaussian") -> None:
        self.field = height_field(fabric)
        self._shape = _FOOTPRINTS[footprint]

    def sample(self, queries: Queries, count: int, seed: int) -> npt.NDArray[np.float32]:
        """Return the components from `count` points a query, (N, 4)."""
        return _point_sampled_all(self.field, *_columns(queries), self._shape, count, np.uint64(seed))


def validate(queries: Queries, where: str = "queries") -> None:
    """Refuse queries that have no answer, naming the first."""
    for name, column in zip(Queries._fields, queries, strict=True):
        if not np.isfinite(column).all():
            row = int(np.flatnonzero(~np.isfinite(column).reshape(len(column), -1).all(axis=1))[0])
            raise BadInput(where, f"{name}[{row}]", column[row].tolist(), "must be finite")
    if (queries.sigma <= 0).any():
        row = int(np.flatnonzero(queries.sigma <= 0)[0])
        raise BadInput(where, f"sigma[{row}]", float(queries.sigma[row]), "must be greater than 0")
    for name, directions in (("wi", queries.wi), ("wo", queries.wo)):
        length = np.linalg.norm(directions.astype(np.float64), axis=-1)
        if (np.abs(length - 1.0) > 1e-4).any():
            row = int(np.flatnonzero(np.abs(length - 1.0) > 1e-4)[0])
            raise BadInput(where, f"{name}[{row}]", directions[row].tolist(), "must have unit length")
        if (directions[:, 2] <= 0).any():
            row = int(np.flatnonzero(directions[:, 2] <= 0)[0])
            raise BadInput(where, f"{name}_z[{row}]", float(directions[row, 2]), "must be above 0: reflection only")


_Column = npt.NDArray[np.float64]


def _columns(queries: Queries) -> tuple[_Column, _Column, _Column, _Column, _Column]:
    """Return the queries in float64, directions renormalised."""
    wi, wo = (d.astype(np.float64) for d in (queries.wi, queries.wo))
    return (
        queries.u.astype(np.float64),
        queries.v.astype(np.float64),
        queries.sigma.astype(np.float64),
        wi / np.linalg.norm(wi, axis=-1, keepdims=True),
        wo / np.linalg.norm(wo, axis=-1, keepdims=True),
    )


@kernel
def _add_point(
    field: HeightField,
    shape: int,
    u: float,
    v: float,
    sigma: float,
    wi: npt.NDArray[np.float64],
    light: Ray,
    wo: npt.NDArray[np.float64],
    viewer: Ray,
    first: float,
    second: float,
    sums: npt.NDArray[np.float64],
    r: int,
) -> None:
    """Add the point that (first, second) in (0, 1)^2 names in the footprint to row r of the sums."""
    picks, ends = field.top.shape
    x, weight_x = place(shape, u, sigma, float(ends), first)
    y, weight_y = place(shape, v, sigma, float(picks), second)
    family, area, specular, diffuse = point_share(field, x, y, wi[0], wi[1], wi[2], light, wo[0], wo[1], wo[2], viewer)
    if family != GAP:
        weight = weight_x * weight_y
        sums[r, family] += weight * specular
        sums[r, 2 + family] += weight * diffuse
        sums[r, _AREA] += weight * area


@kernel
def _ratio_error(sums: npt.NDArray[np.float64], mean: npt.NDArray[np.float64], error: npt.NDArray[np.float64]) -> None:
    """Write the four ratios and their standard errors from the replicates' sums, (REPLICATES, 5)."""
    area, seen = 0.0, 0
    for r in range(REPLICATES):
        area += sums[r, _AREA]
        seen += sums[r, _AREA] > 0.0
    for c in range(4):
        mean[c], error[c] = 0.0, 0.0
        if area > 0.0:
            total = 0.0
            for r in range(REPLICATES):
                total += sums[r, c]
            mean[c] = total / area
            spread = 0.0
            for r in range(REPLICATES):
                residual = sums[r, c] - mean[c] * sums[r, _AREA]
                spread += residual * residual
            error[c] = math.sqrt(spread * REPLICATES / (REPLICATES - 1)) / area
            if seen < REPLICATES:
                # The ratio of a few visible replicates follows them: their spread alone would look too small.
                error[c] = math.hypot(error[c], mean[c] / math.sqrt(seen))


@kernel
def _estimate_all(
    field: HeightField,
    u: npt.NDArray[np.float64],
    v: npt.NDArray[np.float64],
    sigma: npt.NDArray[np.float64],
    wi: npt.NDArray[np.float64],
    wo: npt.NDArray[np.float64],
    estimator: int,
    shape: int,
    relative_error: float,
    min_count: int,
    max_count: int,
    seed: np.uint64,
    start: int,
) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.float32], npt.NDArray[np.int32]]:
    rows = len(u)
    mean = np.zeros((rows, 4), np.float32)
    standard_error = np.zeros((rows, 4), np.float32)
    counts = np.zeros(rows, np.int32)
    sums = np.zeros((REPLICATES, 5))
    row_mean, row_error = np.zeros(4), np.zeros(4)
    for row in range(rows):
        key = derive(seed, start + row)
        light, viewer = ray(wi[row, 0], wi[row, 1], wi[row, 2]), ray(wo[row, 0], wo[row, 1], wo[row, 2])
        sums[:] = 0.0
        done, target = 0, min_count // REPLICATES
        while True:
            # Extend every replicate from `done` to `target` points.
            for r in range(REPLICATES):
                replicate = derive(key, r)
                for k in range(done, target):
                    if estimator == _OWEN:
                        first, second = owen_pair(replicate, k)
                    else:
                        first, second = uniform(replicate, k, 0), uniform(replicate, k, 1)
                        first = max(first, 2.0**-54)
                        second = max(second, 2.0**-54)
                    _add_point(
                        field,
                        shape,
                        u[row],
                        v[row],
                        sigma[row],
                        wi[row],
                        light,
                        wo[row],
                        viewer,
                        first,
                        second,
                        sums,
                        r,
                    )
            done = target

            # Stop when the error asked for is reached, or the points are spent.
            _ratio_error(sums, row_mean, row_error)
            size, error = 0.0, 0.0
            for c in range(4):
                size += row_mean[c] * row_mean[c]
                error += row_error[c] * row_error[c]
            reached = size > 0.0 and error <= relative_error * relative_error * size
            seen = 0
            for r in range(REPLICATES):
                seen += sums[r, _AREA] > 0.0
            # A patch of which hardly a point is seen says nothing of its error yet; its points cost little.
            limit = max_count if seen == REPLICATES else max_count * HIDDEN_PATIENCE
            if done * REPLICATES >= limit or (reached and seen == REPLICATES):
                break
            target = 2 * done
        for c in range(4):
            mean[row, c], standard_error[row, c] = row_mean[c], row_error[c]
        counts[row] = done * REPLICATES
    return mean, standard_error, counts


@kernel
def _point_sampled_all(
    field: HeightField,
    u: npt.NDArray[np.float64],
    v: npt.NDArray[np.float64],
    sigma: npt.NDArray[np.float64],
    wi: npt.NDArray[np.float64],
    wo: npt.NDArray[np.float64],
    shape: int,
    count: int,
    seed: np.uint64,
) -> npt.NDArray[np.float32]:
    rows = len(u)
    mean = np.zeros((rows, 4), np.float32)
    sums = np.zeros((1, 5))
    for row in range(rows):
        key = derive(seed, row)
        light, viewer = ray(wi[row, 0], wi[row, 1], wi[row, 2]), ray(wo[row, 0], wo[row, 1], wo[row, 2])
        sums[:] = 0.0
        for k in range(count):
            first, second = max(uniform(key, k, 0), 2.0**-54), max(uniform(key, k, 1), 2.0**-54)
            _add_point(
                field, shape, u[row], v[row], sigma[row], wi[row], light, wo[row], viewer, first, second, sums, 0
            )
        if sums[0, _AREA] > 0.0:
            for c in range(4):
                mean[row, c] = sums[0, c] / sums[0, _AREA]
    return mean
