"""Physical invariants of a fabric: reciprocity, energy, periodicity, agreement of the estimators.

Every check returns measured value, expected value, and whether both agree: exactly, within the statistical error, or
not. A number without statistical error passes if it equals its expected value up to rounding. Many numbers with errors
pass if Student's t of the worst stays below the quantile of `SIGNIFICANCE`, with Sidak's correction for their number.
"""

import math
from collections.abc import Callable
from itertools import product
from typing import Final, Literal, NamedTuple

import numpy as np
import numpy.typing as npt
from scipy import stats

from pipeline.compiled.arrays import Float64
from pipeline.compiled.decorators import allocating_kernel
from pipeline.truth.calibration import FRONT_FACTORS, SAMPLED
from pipeline.truth.cloth import AREA_SUM, POINT_SUMS, ClothSide, WideQueries, cloth_side, columns_of
from pipeline.truth.estimator import ESTIMATORS, estimate
from pipeline.truth.footprint.place import BOX_SIDE
from pipeline.truth.geometry.heightfield import GAP
from pipeline.truth.monte_carlo import RANDOMISATIONS, query_directions, ratios, share_at
from pipeline.truth.options import TruthOptions
from pipeline.truth.query import Queries
from pipeline.truth.scattering.slab import density, reflection, sigma, transmission
from weaves.errors import BadInput
from weaves.fabric import Fabric
from weaves.surface import GAP as NO_YARN
from weaves.surface import surface_at

SIGNIFICANCE: Final = 1e-4  # probability that a check fails although the invariant holds

ROUNDING: Final = 2e-6  # relative error of a few operations on answers in single precision


class CheckResult(NamedTuple):
    """A measured number, its expected value, and whether both agree."""

    name: str  # measured quantity
    measured: float
    expected: float
    standard_error: float
    """Measured number, expected value, and standard error, which is 0 for an exact number."""
    relation: Literal["=", "<=", "reported"]
    """Expected relation of the number to the expected value; ``reported``: there is no expected value."""
    status: Literal["exact", "statistics", "broken", "reported"]
    """``exact``, ``statistics`` (holds within its uncertainty), ``broken`` or ``reported``."""
    note: str  # remark, shown in the table

    @property
    def sigmas(self) -> float:
        """Distance from the expected value in standard errors; 0 for an exact number."""
        return (self.measured - self.expected) / self.standard_error if self.standard_error else 0.0


def exact(name: str, measured: float, expected: float, tolerance: float, note: str = "") -> CheckResult:
    """Check a number without statistical error; NaN is broken."""
    status: Literal["exact", "broken"] = "exact" if abs(measured - expected) <= tolerance else "broken"
    return CheckResult(name, measured, expected, 0.0, "=", status, note)


def worst(
    name: str, measured: npt.ArrayLike, expected: float, errors: npt.ArrayLike, freedom: int,
    relation: Literal["=", "<="] = "=", note: str = "",
) -> CheckResult:  # fmt: skip
    """Check many numbers; the result is that of the number furthest off, in its standard errors.

    `measured` (N,) have `errors` (N,), their standard errors, of so many degrees of freedom.
    """
    values, spread = np.broadcast_arrays(np.atleast_1d(np.asarray(measured, np.float64)), np.asarray(errors))
    # Rounding counts as error too: two sums of the same points differ by it and by nothing else.
    beyond = (values - expected) / (spread + ROUNDING * max(abs(expected), 1e-3))
    score = beyond if relation == "<=" else np.abs(beyond)
    row = int(np.argmax(np.where(np.isnan(score), np.inf, score)))
    level = 1.0 - (1.0 - SIGNIFICANCE) ** (1.0 / len(values))
    limit = float(stats.t.isf(level if relation == "<=" else level / 2.0, freedom))
    holds = bool(score[row] <= limit)
    note = note or (f"worst of {len(values)}, limit {limit:.1f} σ" if len(values) > 1 else "")
    status: Literal["statistics", "broken"] = "statistics" if holds else "broken"
    return CheckResult(name, float(values[row]), expected, float(spread[row]), relation, status, note)


def quotient(first: npt.ArrayLike, second: npt.ArrayLike) -> Float64:
    """Return first / second, and 1 where they are equal, 0 / 0 included."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(np.equal(first, second), 1.0, np.divide(first, second, dtype=np.float64))


def largest(values: Float64) -> float:
    """Return the greatest modulus; NaN if there is one."""
    return float(np.abs(values).max())


_SEED = 20_250_101
_STEPS = 128  # directions of light in each randomisation of a furnace
_LATTICE = 256.0  # points of each randomisation along a side of the repeat
_WIDE = 4.0  # repeats: a Gaussian this wide is the average over the repeat


def point_reciprocity(fabric: Fabric) -> list[CheckResult]:
    """Test f(wi, wo) = f(wo, wi) of the specular point model, at random points and directions on both sides of them."""
    rng = np.random.default_rng(_SEED)
    rows = 2000
    wi, wo = _directions(rng, rows, 90.0), _directions(rng, rows, 90.0)
    wi[::2] *= -1.0
    ends, picks = fabric.weave.repeat
    point = surface_at(fabric, rng.random(rows) * ends, rng.random(rows) * picks)
    apart = {"reflection": 0.0, "transmission": 0.0}
    for k in np.flatnonzero(point.yarn != NO_YARN):
        fibre = *point.tangent[k], (fabric.warp, fabric.weft)[point.yarn[k]].roughness
        cos_i, cos_o = float(wi[k] @ point.normal[k]), float(wo[k] @ point.normal[k])
        name, slab = ("reflection", reflection) if cos_i * cos_o > 0.0 else ("transmission", transmission)
        ways = (wi[k], wo[k], (abs(cos_i), abs(cos_o))), (wo[k], wi[k], (abs(cos_o), abs(cos_i)))
        there, back = (
            slab(density(*(i + o), *fibre), sigma(*i, *fibre), sigma(*o, *fibre), *cosines, fabric.optical_thickness)
            for i, o, cosines in ways
        )
        apart[name] = max(apart[name], largest(quotient(there, back) - 1.0))
    return [exact(f"reciprocity of a point, {name}", value, 0.0, 0.0) for name, value in apart.items()]


def patch_reciprocity(fabric: Fabric) -> list[CheckResult]:
    """Test that f_P(wi, wo) |wo.n_s| = f_P(wo, wi) |wi.n_s| for the specular part of a patch of the fabric plane.

    This holds if the normaliser is "projected". How far the default breaks it, whose view rays through one footprint
    are others after light and viewer changed places, is a number without a status.
    """
    rng = np.random.default_rng(_SEED + 1)
    rows = 24
    there = _queries(fabric, _directions(rng, rows, 75.0), _directions(rng, rows, 75.0), 1.0, rng)
    back = there._replace(wi=there.wo, wo=there.wi)

    def value(queries: Queries, seed: int, **choices: object) -> tuple[Float64, Float64]:
        answers = estimate(fabric, queries, _fixed(16_384, **choices), seed)
        cosine = np.abs(queries.wo[:, 2].astype(np.float64))
        return answers.mean[:, :2].sum(axis=1) * cosine, np.hypot(*answers.standard_error[:, :2].T) * cosine

    found, projected = [], {"normaliser": "projected", "parallax": False}
    for frame in ("ply", "macro"):
        ways = [value(queries, 1, frame=frame, **projected)[0] for queries in (there, back)]
        name = f"reciprocity of a patch, projected, {frame} frame"
        found.append(exact(name, largest(quotient(*ways) - 1.0), 0.0, 5 * ROUNDING, note="the same points both ways"))
    (f, error), (f_back, error_back) = (value(queries, seed, **projected) for seed, queries in enumerate((there, back)))
    spread = np.hypot(quotient(error, f), quotient(error_back, f))
    found.append(worst("… with other points on the way back", quotient(f_back, f) - 1.0, 0.0, spread, 15))
    broken = np.abs(quotient(*(value(queries, 1)[0] for queries in (there, back))) - 1.0)
    note = f"median {np.median(broken):.3f}: other rays cross a footprint"
    return [*found, CheckResult("… with the default, view rays", broken.max(), 0.0, 0.0, "reported", "reported", note)]


def range_of_values(fabric: Fabric) -> list[CheckResult]:
    """Test that no answer is negative or not finite, and 0 <= transparency <= 1, over all kinds of queries."""
    rng = np.random.default_rng(_SEED + 2)
    lights, viewers = (0.0, 45.0, 80.0, 89.0, 89.9), (0.0, 45.0, 80.0, 88.9)
    odd, rows, low, high = 0, 0, math.inf, -math.inf
    for alpha in (0.01, 0.1, 1.0):
        yarns = {name: getattr(fabric, name).model_copy(update={"roughness": alpha}) for name in ("warp", "weft")}
        cloth = fabric.model_copy(update=yarns)
        # Tables take a second to build: one roughness is enough for them, the most extreme.
        for estimator, footprint in product(("owen", "auto") if alpha == 0.01 else ("owen",), ("gaussian", "box")):
            grid = np.array(np.meshgrid(lights, viewers, (1e-4, 1.0, 1e4), (0, 1, 2))).reshape(4, -1)
            wi, wo = (_turned(a, rng.uniform(0, 2 * math.pi, a.size)) for a in grid[:2])
            wi[grid[3] > 0, 2] *= -1.0
            wo[grid[3] > 1, 2] *= -1.0
            queries = _queries(fabric, wi, wo, grid[2], rng)
            queries.curvature[(grid[3] < 2) & (rng.random(grid.shape[1]) < 0.3)] = 0.1
            # With so coarse a requested error, auto answers by the table what the table can answer.
            options = _fixed(32, estimator=estimator, footprint=footprint, relative_error=1.0)
            answers = estimate(cloth, queries, options, 3)
            for column in answers:
                odd += int((~np.isfinite(column) | (column < 0)).sum())
            rows += len(queries.u)
            low, high = min(low, float(answers.transparency.min())), max(high, float(answers.transparency.max()))
    note = f"in {rows} answers: alpha .01 to 1, lights to 89.9°, footprints 1e-4 to 1e4, both sides, curved or flat"
    outside, extent = max(0.0, -low, high - 1.0), f"{low:.3g} to {high:.3g}"
    return [
        exact("values negative or not finite", odd, 0.0, 0.0, note=note),
        exact("transparency outside [0, 1]", outside, 0.0, ROUNDING, note=extent),
    ]


def energy(fabric: Fabric) -> list[CheckResult]:
    """Test that the cloth gains no light: under unit radiance from everywhere it returns at most 1.

    Each of k_d, k_dt and k_s is 1 in turn: int f_P(wi, wo) d(wi) over the side of the viewer or the other one, at
    several angles of wo; k_s with all that goes straight through. Directions are low-discrepancy points of the
    hemisphere, randomly shifted in each randomisation.
    """
    rng = np.random.default_rng(_SEED + 3)
    found = []
    for theta in (0.0, 30.0, 60.0, 80.0):
        diffuse, specular = [], []
        wo = _turned(np.full(RANDOMISATIONS * _STEPS, theta), np.full(RANDOMISATIONS * _STEPS, 0.7))
        for side in (1.0, -1.0):
            shift = rng.random((RANDOMISATIONS, 1, 2))
            steps = np.arange(_STEPS)[:, None] * (0.7548776662466927, 0.5698402909980532)
            z, turn = ((steps + shift) % 1.0).reshape(-1, 2).T
            sine, turn = np.sqrt(1.0 - z * z), turn * 2.0 * math.pi
            wi = np.stack([sine * np.cos(turn), sine * np.sin(turn), side * np.maximum(z, 1e-4)], axis=-1)
            answers = estimate(fabric, _queries(fabric, wi, wo, _WIDE * max(fabric.weave.repeat), rng), _fixed(256), 4)
            mean = answers.mean.astype(np.float64).reshape(RANDOMISATIONS, _STEPS, 4).mean(axis=1) * 2.0 * math.pi
            diffuse.append(mean[:, 2:].sum(axis=1))
            specular.append(mean[:, :2].sum(axis=1))
        through = answers.transparency.astype(np.float64).reshape(RANDOMISATIONS, _STEPS).mean(axis=1)
        shares = "reflected {:.3f}, transmitted {:.3f}, straight {:.3f}"
        once = specular[0] + specular[1] + through, shares.format(*(x.mean() for x in (*specular, through)))
        parts = (
            ("white furnace, reflected, k_d = 1", diffuse[0], ""),
            ("white furnace, transmitted, k_dt = 1", diffuse[1], ""),
            ("light scattered once and straight through, k_s = 1", *once),
        )
        for name, total, note in parts:
            spread = total.std(ddof=1) / math.sqrt(RANDOMISATIONS)
            found.append(worst(f"{name}: {theta:.0f}°", total.mean(), 1.0, spread, RANDOMISATIONS - 1, "<=", note))
    return sorted(found, key=lambda item: item.name.split(":")[0])


def projected_area(fabric: Fabric) -> list[CheckResult]:
    """Test that a viewer sees at most the projected area: <A V> <= |wo.n_s|, for closed height fields equal.

    The quotient of the answers under the two normalisers, from the same points of the fabric plane: view rays see the
    projected area by definition.
    """
    rng = np.random.default_rng(_SEED + 5)
    found = []
    for theta, turn in ((0.0, 0.0), *product((30.0, 60.0, 80.0), (0.7, 1.4, 3.0))):
        wo = _turned(np.full(RANDOMISATIONS, theta), np.full(RANDOMISATIONS, turn))
        queries = _queries(fabric, wo * (-1.0, -1.0, 1.0), wo, _WIDE * max(fabric.weave.repeat), rng)
        ways = (_fixed(16_384, normaliser=name, parallax=False) for name in ("projected", "visible"))
        projected, visible = (estimate(fabric, queries, way, 5).mean[:, 2:].sum(axis=1, dtype=float) for way in ways)
        share = projected / visible
        spread = share.std(ddof=1) / math.sqrt(RANDOMISATIONS)
        name = f"visible area / cos: {theta:.0f}°" + (f", azimuth {turn:g}" if theta else "")
        found.append(worst(name, share.mean(), 1.0, spread if spread > ROUNDING else 0.0, RANDOMISATIONS - 1, "<="))
    return found


def repeat_average(fabric: Fabric) -> list[CheckResult]:
    """Test that boxes of whole repeats and wide Gaussians are the repeat average, taken on shifted lattices.

    Colour is applied afterwards: the components add up to the whole that is coloured point by point.
    """
    rng = np.random.default_rng(_SEED + 6)
    ends, picks = fabric.weave.repeat
    rows = 6
    queries = _queries(fabric, _directions(rng, rows, 70.0), _directions(rng, rows, 70.0), 1.0, rng)
    cloth, columns = cloth_side(fabric, TruthOptions()), columns_of(queries)
    mean, error, whole = np.zeros((rows, 5)), np.zeros((rows, 5)), np.zeros(rows)
    warp, weft = fabric.warp, fabric.weft
    colours = np.mean([warp.specular_rgb, weft.specular_rgb, warp.diffuse_rgb, weft.diffuse_rgb], axis=1)
    side = max(4, round(_LATTICE / math.sqrt(ends * picks)))
    for row in range(rows):
        shifts = rng.random((RANDOMISATIONS, 2))
        whole[row] = _lattice(cloth, columns, row, side, shifts, colours, mean[row], error[row])
    found = []
    for seed, (name, footprint, size) in enumerate(
        (
            ("box of one repeat", "box", 1.0 / BOX_SIDE),
            ("box of 3 repeats", "box", 3.0 / BOX_SIDE),
            ("Gaussian of one repeat", "gaussian", 1.0),
            ("Gaussian of 1000 repeats", "gaussian", 1000.0),
        )
    ):
        sigma_x, sigma_y = (np.full(rows, size * n, np.float32) for n in (ends, picks))
        resized = queries._replace(sigma=sigma_x, sigma_minor=sigma_y)
        answers = estimate(fabric, resized, _fixed(16_384, footprint=footprint), seed)
        seen = mean[:, :4] > 1e-7
        scale = mean[:, :4][seen]
        spread = np.hypot(answers.standard_error, error[:, :4])[seen] / scale
        found.append(worst(f"{name} / repeat average", answers.mean[seen] / scale, 1.0, spread, RANDOMISATIONS - 1))
    apart = largest(quotient(mean[:, :4] @ colours, whole) - 1.0)
    found.append(exact("coloured components / coloured whole − 1", apart, 0.0, 1e-12))
    return found


@allocating_kernel
def _lattice(
    cloth: ClothSide, columns: WideQueries, row: int, side: int, shifts: Float64, colours: Float64, mean: Float64,
    error: Float64,
) -> float:  # fmt: skip
    """Average a query over the repeat by shifted square lattices; write the components, return the coloured whole."""
    picks, ends = cloth.front.top.shape
    directions, sums, coloured = query_directions(columns, row), np.zeros((RANDOMISATIONS, POINT_SUMS)), 0.0
    for r in range(RANDOMISATIONS):
        for a in range(side * ends):
            for b in range(side * picks):
                x, y = (a + shifts[r, 0]) / side, (b + shifts[r, 1]) / side
                family, area, specular, diffuse, _, _, _ = share_at(cloth, x, y, directions)
                sums[r, AREA_SUM] += area
                if family != GAP:
                    sums[r, family] += specular
                    sums[r, 2 + family] += diffuse
                    coloured += colours[family] * specular + colours[2 + family] * diffuse
    ratios(sums, mean, error)
    return float(coloured / sums[:, AREA_SUM].sum())


def translation(fabric: Fabric) -> list[CheckResult]:
    """Test that a move by whole repeats changes nothing, between positions that single precision holds exactly."""
    rng = np.random.default_rng(_SEED + 7)
    rows = 16
    ends, picks = fabric.weave.repeat
    sizes = np.exp(rng.uniform(np.log(0.05), np.log(8.0), rows))
    near = _queries(fabric, _directions(rng, rows, 80.0), _directions(rng, rows, 80.0), sizes, rng)
    # Rounded down to 1/256, which leaves single precision room for a thousand repeats.
    u, v = (np.floor(places * 256.0) / 256.0 for places in (near.u, near.v))
    near = near._replace(u=u, v=v)
    found = []
    for name, count in (("one repeat", 1), ("1000 repeats", 1000)):
        far = near._replace(u=near.u + np.float32(count * ends), v=near.v - np.float32(count * picks))
        here, there = (estimate(fabric, moved, _fixed(512), 7).mean for moved in (near, far))
        apart = float((np.abs(here - there) / np.maximum(here.max(axis=1, keepdims=True), 1e-12)).max())
        found.append(exact(f"change by a move of {name}", apart, 0.0, ROUNDING, note="relative to the largest part"))
    return found


def agreement(fabric: Fabric) -> list[CheckResult]:
    """Test that all estimators give the same answers, each compared with one of them that takes more points.

    Only errors of samples follow Student's t. Rules and tables have heavier tails, which their bounds know: an answer
    has the error of a sampled one with the same bound. `quadrature` is compared with walls left out, as it answers.
    An estimator that cannot answer for the cloth is left out: `node_table` has a limit of different cells, and of the
    distance of nodes as viewers see them.
    """
    rng = np.random.default_rng(_SEED + 8)
    rows = 24
    sizes = np.exp(rng.uniform(np.log(0.8), np.log(8.0), rows))
    queries = _queries(fabric, _directions(rng, rows, 75.0), _directions(rng, rows, 70.0), sizes, rng)
    references = {walls: estimate(fabric, queries, _fixed(32_768, walls=walls), 8) for walls in ("rim", "left_out")}
    found = []
    for name in ESTIMATORS:
        walls = "left_out" if name == "quadrature" else "rim"
        best = references[walls]
        try:
            answers = estimate(fabric, queries, _fixed(8192, estimator=name, walls=walls), 9)
        except BadInput:
            continue
        seen = best.mean > 1e-2 * best.mean.max(axis=1, keepdims=True)
        spread = np.hypot(answers.bound, best.bound)[seen] / (FRONT_FACTORS[SAMPLED].cover * best.mean[seen])
        found.append(worst(f"{name} / owen", answers.mean[seen] / best.mean[seen], 1.0, spread, 15))
    return found


INVARIANTS: Final[tuple[Callable[[Fabric], list[CheckResult]], ...]] = (
    point_reciprocity,
    patch_reciprocity,
    range_of_values,
    energy,
    projected_area,
    repeat_average,
    translation,
    agreement,
)
"""All tests, in the order of the table."""


def _fixed(count: int, **choices: object) -> TruthOptions:
    """Return options that spend `count` points on every query: stopping by its own error would bias a z-score."""
    errors = {"relative_error": 1e-9, "absolute_error": 0.0}
    counts = {"min_count": count, "max_count": count}
    return TruthOptions.model_validate({"estimator": "owen", **errors, **counts, **choices})


def _turned(degrees: Float64, azimuth: Float64) -> Float64:
    """Return unit vectors (N, 3) at angles from the normal, degrees, and azimuths, radians."""
    theta = np.radians(degrees)
    return np.stack([np.sin(theta) * np.cos(azimuth), np.sin(theta) * np.sin(azimuth), np.cos(theta)], axis=-1)


def _directions(rng: np.random.Generator, rows: int, largest: float) -> Float64:
    """Return random unit vectors (rows, 3) within `largest` degrees of the normal, even in solid angle."""
    cosine = rng.uniform(math.cos(math.radians(largest)), 1.0, rows)
    return _turned(np.degrees(np.arccos(cosine)), rng.uniform(0.0, 2.0 * math.pi, rows))


def _queries(fabric: Fabric, wi: Float64, wo: Float64, size: float | Float64, rng: np.random.Generator) -> Queries:
    """Return round flat queries at random places of the repeat."""
    u, v = (rng.random(len(wi)) * n for n in fabric.weave.repeat)
    columns = u, v, np.broadcast_to(size, u.shape), wi, wo
    return Queries.round(*(np.array(column, np.float32) for column in columns))
