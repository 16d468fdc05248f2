"""Numerical stability of the model at its extremes: float32 against float64, float64 against 50 digits.

`expressions` is the table of what is computed, over which corners and by which forms; `judged` is the loop over it.
Single precision is what answers queries from tables: the loops of `pipeline.truth.node_table.kernels`, called here on
one node at a time, or their formula on arrays. Double precision is `slab` and `heightfield`.
"""

import math
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any, Final, NamedTuple

import mpmath
import numpy as np

from pipeline.compiled import float32
from pipeline.truth.estimator import estimate
from pipeline.truth.footprint.place import BOX, BOX_SIDE, Axis, place
from pipeline.truth.geometry import heightfield
from pipeline.truth.node_table import kernels
from pipeline.truth.node_table.kernels import Direction, FlakeLayer, Normals, Tangents
from pipeline.truth.options import TruthOptions
from pipeline.truth.query import Queries
from pipeline.truth.scattering import slab
from reports.truth import formulas
from reports.truth.finding import DOUBLE, ILL, RECORDS, Finding, judge
from reports.truth.formulas import Array, dot, exact
from weaves.draft import Matrix
from weaves.errors import WorkFailed
from weaves.fabric import Fabric
from weaves.yarn import Yarn

__all__ = ["RECORDS", "measure"]

DIGITS: Final = 50
BENDS: Final = (0.01, 0.1, 1.0, 10.0, 40.0, 80.0)  # u_max in degrees
_THICKNESSES: Final = (0.001, 0.1, 2.0, 100.0)
_STEPS: Final = (0.0, 30.0, 60.0, 80.0, 89.0, 89.9)
_ROUNDING: Final = 2.0**-24
_DARK: Final = (1e-30, 1e-280)  # below these single and double precision hold no light
_NEAREST: Final = 0.5  # least |wi + wo| where the half vector is well-conditioned
_TERMS: Final = 1 << 22
_PIECE: Final = 1024  # nodes a float has, about: summed in single precision, and the pieces in double
_LANES: Final = 4  # sums that every vector unit of today carries side by side, at least
_FAR: Final = 1e6
_SHAPES: Final = ("gaussian", "box")

# Worst relative errors in single precision, by alpha; those of 1 are taken from .5, where nothing else is known.
_SIGMA: Final = {0.01: 1.9e-6, 0.1: 3e-7, 0.5: 3e-7, 1.0: 3e-7}
_DENSITY: Final = {0.01: 1.2e-5, 0.1: 1.4e-6, 0.5: 1.4e-6, 1.0: 1.4e-6}
_REFLECTION: Final = {0.01: 1.6e-5, 0.1: 2e-6, 0.5: 8e-7, 1.0: 8e-7}
_TRANSMISSION: Final = {0.01: 1.6e-5, 0.1: 3.8e-6, 0.5: 3.5e-6, 1.0: 3.5e-6}
_FORWARD: Final = {1e-2: 1.4e-4, 1e-4: 1.4e-2, 1e-6: 2.6}
_ABSORBED, _REMAINING = 2e-7, 3e-7  # `pipeline.compiled.float32`
_THROUGH, _TORUS, _SUM = 2.5e-7, 3e-7, 3.5e-8

Form = Callable[..., Any]
Columns = dict[str, Array]
Choices = tuple[float, ...]
_NONE, _ONE = np.zeros(1, np.float32), np.ones(1, np.float32)
_LEVEL = Normals(_NONE, _NONE, _ONE, _ONE)


class Corner(NamedTuple):
    """Inputs at which an expression is computed: columns in float64, each (N,) or (3, N)."""

    label: str
    columns: Columns  # for single precision, which rounds them
    listed: float  # error that single precision is known to make
    few: Columns | None = None  # for double precision: fewer, because 50 digits are slow
    listed_double: float = 0.0  # error that double precision is known to make; that of `listed` if it is 0


class Expression(NamedTuple):
    """An expression and its forms, each a function of the columns of a corner."""

    name: str
    corners: Callable[[], Iterator[Corner]]
    single: Form  # what the package computes in float32
    reference: Form  # the truth of `single`, from columns in float64
    naive: Form | None = None  # the textbook's form, in float32
    double: Form | None = None  # what the package computes in float64
    exact: Form | None = None  # the truth of `double`, from columns in 50 digits
    dark: tuple[float, float] = (0.0, 0.0)  # least size of a reference, in single and in double precision
    signed: bool = False  # values may be negative


def measure() -> list[Finding]:
    """Compute every expression over its corners; the same findings every time, WorkFailed if one exceeds its limit."""
    findings = [finding for expression in expressions() for finding in judged(expression)]
    findings += places() + footprints()
    if wrong := [finding for finding in findings if not finding.holds]:
        first, more = wrong[0], f"; {len(wrong) - 1} more do not hold" if len(wrong) > 1 else ""
        raise WorkFailed(f"{first.expression} in {first.arithmetic}, {first.corner}: {first.fault} at {first.at}{more}")
    return findings


def judged(expression: Expression) -> list[Finding]:
    """Judge the forms of an expression over all its corners."""
    findings = []
    name, corners, single, reference, naive, double, high, dark, signed = expression
    for label, columns, listed, few, listed_double in corners():
        narrow = {key: column.astype(np.float32) for key, column in columns.items()}
        with mpmath.workdps(DIGITS), np.errstate(all="ignore"):
            value, truth = single(*narrow.values()), reference(*columns.values())
            textbook = naive(*narrow.values()) if naive else None
            others = (double(*few.values()), high(*map(exact, few.values()))) if few and double and high else None
        findings.append(judge(name, label, "float32", narrow, value, truth, listed, textbook, dark[0], signed))
        if few and others:
            listed = listed_double or listed * DOUBLE
            findings.append(judge(name, label, "float64", few, *others, listed, floor=dark[1], signed=signed))
    return findings


def expressions() -> Iterator[Expression]:
    """Yield the table: exponentials, flakes, slabs, rounded directions, bent yarns and long sums."""
    absorbed, remaining = (partial(_each, function) for function in (float32.absorbed, float32.remaining))
    yield Expression(
        "1 − exp(−x)", partial(_depths, _ABSORBED), absorbed, lambda x: -np.expm1(-x), lambda x: _ONE - np.exp(-x)
    )
    yield Expression("exp(−x)", partial(_depths, _REMAINING), remaining, lambda x: np.exp(-x))
    through, sigma = formulas.textbook_through, formulas.textbook_sigma
    yield Expression("G_t", _nearly_equal, _through, lambda i, o: through(exact(i), exact(o)), through)
    yield Expression("σ", _near_axis, formulas.sigma, sigma_of, sigma, sigma_of, sigma)
    density, matrix = formulas.density, formulas.matrix_density
    yield Expression("D", _half_vectors, density, _density_of, matrix, _density_of, formulas.textbook_density)
    for name, behind in (("f_r", False), ("f_t", True)):
        forms = _slab_of_node, _lit(slab_of), _lit(formulas.textbook_slab), slab_of, formulas.textbook_slab
        yield Expression(name, partial(_slabs, behind), *forms, _DARK)
    yield Expression("exp(−TΛ)", _crossings, _crossing_of_node, _unscattered_of, dark=_DARK)
    # What rounding the directions does, which no form helps.
    yield Expression("cos", _grazing, dot, dot)
    yield Expression("D", _forward, _halved(density), _halved(_density_of), _halved(matrix))
    for bend in BENDS:
        yield from _torus(bend)
    random = np.random.default_rng(8)
    # Every piece of terms alike is wrong alike, by half the rounding of each addition in a row at most.
    yield _sum("4 M terms alike", np.full(_TERMS, 0.1, np.float32), _PIECE / _LANES * _ROUNDING / 2)
    yield _sum("4 M terms at random", random.random(_TERMS, np.float32), _SUM)
    yield _sum("4 M terms over 6 decades", (10 ** random.uniform(-6, 0, _TERMS)).astype(np.float32), _SUM)


def _depths(listed: float) -> Iterator[Corner]:
    random = np.random.default_rng(1)
    thin, deep = 10.0 ** random.uniform(-8, 0, 6000), random.uniform(0, 80, 6000)
    yield Corner("x 0 … 80", _rounded(x=np.concatenate([[0.0], thin, deep])), listed)


def _nearly_equal() -> Iterator[Corner]:
    random = np.random.default_rng(2)
    for low, high in ((0.0, 0.0), (1e-8, 1e-6), (1e-6, 1e-4), (1e-4, 1e-2)):
        first = np.append(10.0 ** random.uniform(-2, 1, 3000), 1.7).astype(np.float32)
        apart = np.exp(random.uniform(np.log(low), np.log(high), 3001)) if high else np.zeros(3001)
        label = f"ΔΛ/Λ {_power(low)} … {_power(high)}" if high else "equal Λ"
        yield Corner(label, _rounded(Λi=first, Λo=first * (1 + apart)), _THROUGH)


def _through(lambda_i: Array, lambda_o: Array) -> Array:
    t = np.float32(2)
    x = np.maximum(t * np.abs(lambda_i - lambda_o), np.float32(1e-30))
    shallow = t * np.minimum(lambda_i, lambda_o)
    return np.asarray(t * _each(float32.remaining, shallow) * _each(float32.absorbed, x) / x)


def _near_axis() -> Iterator[Corner]:
    for alpha in _SIGMA:
        t, w = _around_axis(np.random.default_rng(3), 4000)
        columns = _rounded(w=w, t=t, alpha=np.full(4000, alpha))
        yield Corner(f"α = {alpha:g}, near the axis", columns, _SIGMA[alpha], _first(400, columns))


def _half_vectors() -> Iterator[Corner]:
    for alpha in _SIGMA:
        wi, wo, t, alphas, _ = _rounded(**draw(4000, alpha, _STEPS, _STEPS, (2.0,))).values()
        # Single precision adds the directions in single precision, so its reference starts from that sum.
        narrow = (wi.astype(np.float32) + wo.astype(np.float32)).astype(np.float64)
        few = _first(400, {"v": wi + wo, "t": t, "alpha": alphas})
        yield Corner(f"α = {alpha:g}", {"v": narrow, "t": t, "alpha": alphas}, _DENSITY[alpha], few)


def _slabs(behind: bool) -> Iterator[Corner]:
    """Yield angles, thicknesses and roughnesses of f_r, or of f_t."""
    steepest = 80.0 if behind else 89.9
    for alpha, listed in (_TRANSMISSION if behind else _REFLECTION).items():
        kinds = (f"{steepest:g}°", (steepest,), (2.0,)), ("any angle and T", _STEPS, _THICKNESSES)
        for label, light, depths in kinds:
            viewer = tuple(step for step in _STEPS if step <= max(light))
            columns = draw(1500, alpha, light, viewer, depths, behind)
            # In a deep layer an exponential rules, which adds to the rounding of its exponent what the exponent says.
            rule, finer = (_exponent(dark) * _ROUNDING if behind and len(depths) > 1 else 0.0 for dark in _DARK)
            few, listed_double = _first(150, columns), listed * DOUBLE + finer * DOUBLE
            yield Corner(f"α = {alpha:g}, {label}", _rounded(**columns), listed + rule, few, listed_double)


def _crossings() -> Iterator[Corner]:
    for alpha in _SIGMA:
        columns = draw(1500, alpha, (0.0,), _STEPS, _THICKNESSES)
        del columns["wi"]
        listed = _SIGMA[alpha] + _exponent(_DARK[0]) * _ROUNDING
        yield Corner(f"α = {alpha:g}, any angle and T", _rounded(**columns), listed)


def _grazing() -> Iterator[Corner]:
    angle = math.radians(89.9)
    normal, light = _around_axis(np.random.default_rng(4), 4000, angle)
    yield Corner(f"89.9°, {ILL}", {"n": normal, "wi": light}, 2 * _ROUNDING / math.cos(angle))


def _forward() -> Iterator[Corner]:
    random = np.random.default_rng(5)
    for angle, listed in _FORWARD.items():
        t, wi = (_unit(random.normal(size=(3, 4000))) for _ in range(2))
        aside = _unit(np.cross(wi, random.normal(size=(3, 4000)), axis=0))
        columns = {"wi": wi, "wo": -wi * np.cos(angle) + aside * np.sin(angle), "t": t, "alpha": np.full(4000, 0.1)}
        yield Corner(f"{_power(angle)} off −wi, {ILL}", columns, listed)


def draw(
    count: int, alpha: float, light: Choices, viewer: Choices, thickness: Choices, behind: bool = False
) -> Columns:
    """Return lit points in the frame of the yarn, whose normal is z: columns wi, wo, t, alpha and T.

    `light` and `viewer` are angles to the normal, degrees. Fibres lie across the normal: a third anywhere, a third near
    the middle of the highlight, where wi + wo is at right angles to them, a third near the plane of the light, as near
    to its direction as they can.
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
    return {"wi": wi, "wo": wo, "t": t, "alpha": np.full(len(apart), alpha), "T": depth}


def sigma_of(w: Array, t: Array, alpha: Array) -> Array:
    """Return sigma as `slab` computes it."""
    return _each(slab.sigma, *w, *t, alpha)


def _density_of(v: Array, t: Array, alpha: Array) -> Array:
    return _each(slab.density, *v, *t, alpha)


def slab_of(wi: Array, wo: Array, t: Array, alpha: Array, thickness: Array) -> Array:
    """Return f_r, or f_t of light from behind, as `slab` computes it."""
    function = slab.transmission if wi[2, 0] < 0 else slab.reflection
    sigmas, cosines = (sigma_of(wi, t, alpha), sigma_of(wo, t, alpha)), (np.abs(wi[2]), np.abs(wo[2]))
    return _each(function, _density_of(wi + wo, t, alpha), *sigmas, *cosines, thickness)


def _unscattered_of(wo: Array, t: Array, alpha: Array, thickness: Array) -> Array:
    return _each(slab.unscattered, sigma_of(wo, t, alpha), np.abs(wo[2]), thickness)


def _lit(form: Form) -> Form:
    """Return a form times the two cosines, in float64."""
    return lambda wi, wo, *more: np.abs(np.float64(wi[2])) * np.abs(np.float64(wo[2])) * form(wi, wo, *more)


def _halved(form: Form) -> Form:
    """Return a form of the half vector as one of light and viewer."""
    return lambda wi, wo, *more: form(wi + wo, *more)


def _slab_of_node(wi: Array, wo: Array, t: Array, alpha: Array, thickness: Array) -> Array:
    """Return f_r or f_t, times the two cosines, as the loops over nodes compute it in single precision."""
    behind = True if wi[2, 0] < 0 else None
    scattered: Form = kernels.scattered
    inverse = (1 / np.maximum(np.square((wi + wo).astype(np.float64)).sum(axis=0), 1e-12)).astype(np.float32)
    rows = zip((-wi if behind else wi).T, wo.T, t.T[..., None], alpha, thickness, inverse, strict=True)
    return np.array([
        scattered(_LEVEL, Tangents(*t), _towards(wi), _towards(wo), size, _layer(a, depth), _ONE, 0 * _ONE, behind)
        for wi, wo, t, a, depth, size in rows
    ])  # fmt: skip


def _crossing_of_node(wo: Array, t: Array, alpha: Array, thickness: Array) -> Array:
    """Return exp(-T Lambda) towards the viewer as the loop over nodes computes it in single precision."""
    crossing: Form = kernels.crossing
    rows = zip(wo.T, t.T[..., None], alpha, thickness, strict=True)
    return np.array([crossing(_LEVEL, Tangents(*t), _towards(wo), _layer(a, depth), _ONE) for wo, t, a, depth in rows])


def _towards(w: Array) -> Direction:
    """Return a direction for loops over nodes that read no horizon."""
    return Direction(w[0], w[1], w[2], slope=np.float32(0), first=0, second=0, turn=np.float32(0))


def _layer(alpha: np.float32, thickness: np.float32) -> FlakeLayer:
    wide = float(alpha)
    return FlakeLayer(np.float32(wide**2), thickness, np.float32(wide**3 / (4 * math.pi)))


def _torus(bend: float) -> Iterator[Expression]:
    """Yield height and normal of a bent yarn at places x across it and y along it."""
    field = heightfield.height_field(_fabric(("#.", ".#"), 0.5, 2.0, bend))
    pick, end = (int(k[0]) for k in np.nonzero(field.top == heightfield.WARP))
    own = field.floats[pick, end, heightfield.TOP]
    radius, half, drop = (own[k] for k in (heightfield.BEND_RADIUS, heightfield.HALF_LENGTH, heightfield.AXIS_DROP))
    narrow = np.float32(radius), np.float32(half), np.float32(drop), np.float32(0.5)
    # R, L/2 and R cos u_max in 50 digits come from the angle itself.
    with mpmath.workdps(DIGITS):
        angle, length = mpmath.radians(mpmath.mpf(bend)), mpmath.mpf(float(half))
        high = length / mpmath.sin(angle), length, length / mpmath.tan(angle), mpmath.mpf(0.5)
    # At the end of a steep float the height follows R - y, and the rounding of R counts 1 / cos^2 u_max times.
    steep = 0.5 * (math.cos(math.radians(bend)) ** -2 - 1) * _ROUNDING

    def corners(listed: float) -> Iterator[Corner]:
        random = np.random.default_rng(7)
        columns = {}
        for name in ("x", "y"):
            edge = random.random(2000) < 0.2
            column = np.where(edge, 0.5 - 10.0 ** random.uniform(-6, -1, 2000), random.uniform(-0.5, 0.5, 2000))
            # Multiples of 2^-22 stay what they are when half a yarn is added.
            columns[name] = np.round(column * 2**22) / 2**22
        yield Corner(f"u_max = {bend:g}°", columns, listed, _first(200, columns))

    def surface(part: int | slice, x: Array, y: Array) -> Array:
        at = zip(end + 0.5 + x, pick + 0.5 - own[heightfield.OFFSET] + y, strict=True)
        return np.array([heightfield.surface_at(field, *place, end, pick)[part] for place in at])

    def of(form: Form, numbers: tuple[Any, ...]) -> Form:
        return lambda x, y: form(*numbers, 2 * x, y)

    height, normal = partial(surface, 2), partial(surface, slice(3, 6))
    heights = [of(form, narrow) for form in (formulas.torus_height, formulas.textbook_torus_height)]
    yield Expression(
        "torus height", partial(corners, _TORUS + steep), heights[0], height, heights[1], height,
        of(formulas.textbook_torus_height, high),
    )  # fmt: skip
    normals = [of(formulas.torus_normal, (numbers[0], numbers[3])) for numbers in (narrow, high)]
    yield Expression(
        "torus normal", partial(corners, _TORUS), normals[0], normal, None, normal, normals[1], signed=True
    )


def _sum(label: str, terms: Array, listed: float) -> Expression:
    """Return a sum of many terms: pieces in single precision, as nodes are summed, and the pieces in double."""
    total: Form = kernels.crossing
    none, one = np.zeros(_PIECE, np.float32), np.ones(_PIECE, np.float32)
    normal, tangent = Normals(none, none, one, one), Tangents(none, none, none)
    # The viewer is above, and the layer has no thickness: areas are summed.
    viewer, layer = _towards(np.array([0, 0, 1], np.float32)), FlakeLayer(np.float32(1), np.float32(0), np.float32(0))
    pieces = terms.reshape(-1, _PIECE)
    return Expression(
        "sum",
        lambda: iter([Corner(label, {"terms": np.array([float(_TERMS)])}, listed)]),
        lambda _: [sum(total(normal, tangent, viewer, layer, piece) for piece in pieces)],
        lambda _: [math.fsum(terms.tolist())],
        lambda _: np.cumsum(terms)[-1:],
    )


def places() -> list[Finding]:
    """Judge the place within the repeat of points far away: an absolute error, in yarn spacings."""
    findings = []
    random, count = np.random.default_rng(9), 2000
    function: Form = place
    for far in (1e4, _FAR):
        repeats = random.integers(1, 65, count)
        # Centres come in single precision: sixteenths of a yarn are what it still holds at a million.
        centre = (far + random.integers(0, 64 * 16, count) / 16).astype(np.float32)
        sigma, number = (10.0 ** random.uniform(-3, -0.6, count)).astype(np.float32), random.random(count)
        inputs: dict[str, Array] = {"centre": centre, "sigma": sigma, "repeat": repeats}
        wide = [column.astype(np.float64) for column in inputs.values()]
        value = np.array([function(Axis(BOX, *axis), n)[0] for *axis, n in zip(*wide, number, strict=True)])
        with mpmath.workdps(DIGITS):
            side = exact(number - 0.5) * exact(sigma) * mpmath.mpf(BOX_SIDE)
            truth = (exact(centre) + side) % exact(repeats)
        offset = (sigma * np.float32(BOX_SIDE) * (number - 0.5).astype(np.float32)).astype(np.float32)
        naive = np.fmod(centre + offset, repeats.astype(np.float32)).astype(np.float64)
        # Rounding may put a place at the other end of the repeat.
        value, naive = (v + repeats * np.round((truth.astype(np.float64) - v) / repeats) for v in (value, naive))
        corner = f"{far:.0e} yarns away".replace("e+0", "e")
        findings.append(judge("place", corner, "float64", inputs, value, truth, far * 2.0**-53, naive, absolute=True))
    return findings


def footprints() -> list[Finding]:
    """Judge answers about footprints of every size, here and a million yarns away, where they must be the same."""
    findings = []
    row = "".join("#" * length + "." * (9 - length) for length in range(1, 9))[:64]  # floats of every length up to 8
    wide = (row, row.translate(str.maketrans("#.", ".#")))
    few = {"estimator": "owen", "min_count": 64, "max_count": 64}
    options = [TruthOptions.model_validate({"footprint": shape, **few}) for shape in _SHAPES]
    for name, rows in (("3/1 twill", ("##.#", "#.##", ".###", "###.")), ("1 pick", ("##.#",)), ("64 ends", wide)):
        for alpha, thickness in ((0.01, 100.0), (1.0, 0.001)):
            fabric = _fabric(rows, alpha, thickness)
            near, far, inputs = _queries(fabric)
            far_values, near_values = (
                np.concatenate([
                    np.hstack([a.mean, a.standard_error, a.transparency[:, None]])
                    for a in (estimate(fabric, queries, option, 0) for option in options)
                ])
                for queries in (far, near)
            )  # fmt: skip
            inputs = {key: np.tile(column, 2) for key, column in inputs.items()}
            inputs["footprint"] = np.repeat(_SHAPES, len(near.u))
            corner = f"{name}, α = {alpha:g}, T = {thickness:g}, 1e6 yarns away"
            findings.append(judge("answer", corner, "float64", inputs, far_values, near_values, _ROUNDING))
    return findings


def _queries(fabric: Fabric) -> tuple[Queries, Queries, Columns]:
    """Return queries near the origin, the same a million yarns away, and their numbers by name."""
    repeat = np.array(fabric.weave.repeat)
    angles = [(0.0, 0.0), (60.0, 30.0), (89.9, 20.0), (20.0, 88.9), (120.0, 45.0), (45.0, 120.0)]
    size, light, viewer, turn = np.array(
        [(s * repeat.max(), *pair, t) for s in (1e-4, 1e-2, 1.0, 1e2, 1e4) for pair in angles for t in (40.0, 180.0)]
    ).T
    wi, wo = (
        np.stack([np.sin(t) * np.cos(p), np.sin(t) * np.sin(p), np.cos(t)], axis=1)
        for t, p in np.radians([(light, 0 * turn), (viewer, turn)])
    )
    # Sixteenths of a yarn, which single precision holds at a million too.
    centre = np.random.default_rng(10).integers(0, 16 * repeat.min(), (2, len(size))) / 16
    near, far = (
        Queries.round(*(np.float32(column) for column in (*(centre + shift[:, None]), size, wi, wo)))
        for shift in (0 * repeat, np.floor(_FAR / repeat) * repeat)
    )
    return near, far, {"sigma": size, "wi": light, "wo": viewer, "turn": turn}


def _fabric(rows: tuple[str, ...], alpha: float, thickness: float, bend: float = 30.0) -> Fabric:
    yarn = Yarn(bend=bend, roughness=alpha, diffuse=(0.0, 0.0, 0.0))  # thin layers have no other legal colour
    return Fabric(name="corner", draft=Matrix(rows=rows), warp=yarn, weft=yarn, optical_thickness=thickness)


def _around_axis(random: np.random.Generator, count: int, apart: float = 0.0) -> tuple[Array, Array]:
    """Return unit axes, and unit directions `apart` from them, in radians; from 0 to 1 if that is not given."""
    t = _unit(random.normal(size=(3, count)))
    aside = _unit(np.cross(t, random.normal(size=(3, count)), axis=0))
    near = np.where(random.random(count) < 0.05, 0.0, 10.0 ** random.uniform(-6, 0, count))
    angle = np.full(count, apart) if apart else near
    return t, np.asarray(t * np.cos(angle) + aside * np.sin(angle))


def _exponent(darkest: float) -> float:
    """Return by how much the roundings of an exponent count, at most, in an exponential that is not dark yet."""
    return -math.log(darkest) * 3  # -T sigma / cos


def _rounded(**columns: Array) -> Columns:
    """Return columns that single precision holds, in float64."""
    return {name: column.astype(np.float32).astype(np.float64) for name, column in columns.items()}


def _first(count: int, columns: Columns) -> Columns:
    return {name: column[..., :count] for name, column in columns.items()}


def _each(function: Form, *columns: Array) -> Array:
    """Call a compiled function row by row."""
    return np.array([function(*row) for row in zip(*columns, strict=True)], np.float64)


def _unit(vectors: Array) -> Array:
    return np.asarray(vectors / np.linalg.norm(vectors, axis=0))


def _power(x: float) -> str:
    return f"{x:.0e}".replace("e-0", "e−")
