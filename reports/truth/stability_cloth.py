"""The corners of the cloth: bends, sums, footprints and places far away (`reports.truth.stability`)."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, Final

import mpmath
import numpy as np

from pipeline.truth.estimator import estimate
from pipeline.truth.footprint.place import BOX, BOX_SIDE, place
from pipeline.truth.geometry import heightfield
from pipeline.truth.node_table import kernels
from pipeline.truth.node_table.directions import Direction
from pipeline.truth.node_table.kernels import Layer, Normals, Tangents
from pipeline.truth.options import TruthOptions
from pipeline.truth.query import Queries
from reports.truth import formulas
from reports.truth.finding import DOUBLE, Finding, judge
from reports.truth.formulas import DIGITS, Array, exact
from weaves.draft import Matrix
from weaves.fabric import Fabric
from weaves.yarn import Yarn

BENDS: Final = (0.01, 0.1, 1.0, 10.0, 40.0, 80.0)
"""u_max in degrees."""
TORUS_LISTED: Final = 3e-7
SUM_LISTED: Final = 3.5e-8
_TERMS: Final = 1 << 22
_PIECE: Final = 1024  # nodes a float has, about: summed in single precision, and the pieces in double
_LANES: Final = 4  # sums that every vector unit of today carries side by side, at least
_FAR: Final = 1e6
_ROUNDING: Final = 2.0**-24


def bends() -> list[Finding]:
    """Judge height and normal of a bent yarn."""
    findings = []
    for bend in BENDS:
        random = np.random.default_rng(7)
        field, across, along = _plain(bend, random, 2000)
        pick, end = (int(k[0]) for k in np.nonzero(field.top == heightfield.WARP))
        own = field.floats[pick, end, heightfield.TOP]
        constants = [own[k] for k in (heightfield.BEND_RADIUS, heightfield.HALF_LENGTH, heightfield.AXIS_DROP)]
        x, y = end + 0.5 + across, pick + 0.5 - own[heightfield.OFFSET] + along
        seen = [heightfield.surface_at(field, *at, end, pick) for at in zip(x, y, strict=True)]
        height, normal = np.array([s[2] for s in seen]), np.array([s[3:6] for s in seen])

        # Single precision of the formulas against the kernel in double.
        radius, half, drop, r = (np.full(len(x), c, np.float32) for c in (*constants, 0.5))
        sine, narrow_y = (2 * across).astype(np.float32), along.astype(np.float32)
        naive = formulas.textbook_torus_height(radius, half, drop, r, sine, narrow_y)
        # At the end of a steep float the height follows R - y, and the rounding of R counts 1 / cos^2 u_max times.
        steep = 0.5 * (math.cos(math.radians(bend)) ** -2 - 1) * _ROUNDING
        listed = TORUS_LISTED + steep
        inputs, corner = {"x": across, "y": along}, f"u_max = {bend:g}°"
        value = formulas.torus_height(radius, half, drop, r, sine, narrow_y)
        findings.append(judge("torus height", corner, "float32", inputs, value, height, listed, naive=naive))
        value = np.stack(formulas.torus_normal(radius, r, sine, narrow_y), axis=1)
        findings.append(judge("torus normal", corner, "float32", inputs, value, normal, TORUS_LISTED, signed=True))

        # The kernel against 50 digits, from the angle itself.
        few = slice(200)
        with mpmath.workdps(DIGITS):
            angle, half_length = mpmath.radians(mpmath.mpf(bend)), mpmath.mpf(float(constants[1]))
            turning = half_length / mpmath.sin(angle)
            numbers = (turning, half_length, turning * mpmath.cos(angle), mpmath.mpf(0.5))
            big_r, long, low, r = (np.full(len(x[few]), number, dtype=object) for number in numbers)
            v, far = exact(2 * across[few]), exact(along[few])
            truth = formulas.textbook_torus_height(big_r, long, low, r, v, far)
            upright = np.stack(formulas.torus_normal(big_r, r, v, far), axis=1)
        inputs = {"x": across[few], "y": along[few]}
        value, listed = normal[few], TORUS_LISTED * DOUBLE
        double = listed + steep * DOUBLE
        findings.append(judge("torus height", corner, "float64", inputs, height[few], truth, double))
        findings.append(judge("torus normal", corner, "float64", inputs, value, upright, listed, signed=True))
    return findings


def sums() -> list[Finding]:
    """Judge a sum of 4 M terms: pieces in single precision, as nodes are summed, and the pieces in double."""
    findings = []
    random = np.random.default_rng(8)
    none, one = np.zeros(_PIECE, np.float32), np.ones(_PIECE, np.float32)
    total: Callable[..., Any] = kernels.crossing
    zero, unit = np.float32(0), np.float32(1)
    normal, tangent = Normals(none, none, one, one), Tangents(none, none, none)
    # The viewer is above, and the layer has no thickness: areas are summed.
    viewer, layer = Direction(zero, zero, unit, zero, 0, 0, zero), Layer(unit, zero, zero)
    for corner, terms, listed in (
        # Every piece is wrong alike, by half the rounding of each addition in a row at most.
        ("4 M terms alike", np.full(_TERMS, 0.1, np.float32), _PIECE / _LANES * _ROUNDING / 2),
        ("4 M terms at random", random.random(_TERMS, np.float32), SUM_LISTED),
        ("4 M terms over 6 decades", (10 ** random.uniform(-6, 0, _TERMS)).astype(np.float32), SUM_LISTED),
    ):
        value = 0.0
        for piece in terms.reshape(-1, _PIECE):
            value += total(normal, tangent, viewer, layer, piece)
        naive = np.cumsum(terms)[-1:]
        truth = [math.fsum(terms.tolist())]
        inputs = {"terms": [_TERMS]}
        findings.append(judge("sum", corner, "float32", inputs, [value], truth, listed, naive=naive))
    return findings


def places() -> list[Finding]:
    """Judge the place within the repeat of points far away: an absolute error, in yarn spacings."""
    findings = []
    random = np.random.default_rng(9)
    function: Callable[..., tuple[float, float]] = place
    for far in (1e4, _FAR):
        count = 2000
        repeats = random.integers(1, 65, count)
        # Centres come in single precision: sixteenths of a yarn are what it still holds at a million.
        centre = (far + random.integers(0, 64 * 16, count) / 16).astype(np.float32)
        sigma, number = (10.0 ** random.uniform(-3, -0.6, count)).astype(np.float32), random.random(count)
        wide = [np.array(column, np.float64) for column in (centre, sigma, repeats)]
        found = np.array([function(BOX, *row)[0] for row in zip(*wide, number, strict=True)])
        with mpmath.workdps(DIGITS):
            side = exact(number - 0.5) * exact(sigma) * mpmath.mpf(BOX_SIDE)
            truth = np.array([(c + s) % r for c, s, r in zip(exact(centre), side, exact(repeats), strict=True)])
        offset = (sigma * np.float32(BOX_SIDE) * (number - 0.5).astype(np.float32)).astype(np.float32)
        naive = np.fmod(centre + offset, repeats.astype(np.float32))
        value, naive = (_nearest(np.asarray(v, np.float64), truth, repeats) for v in (found, naive))
        inputs: dict[str, Array] = {"centre": centre, "sigma": sigma, "repeat": repeats}
        corner = f"{far:.0e} yarns away".replace("e+0", "e")
        listed = far * 2.0**-53
        findings.append(judge("place", corner, "float64", inputs, value, truth, listed, naive=naive, absolute=True))
    return findings


def footprints() -> list[Finding]:
    """Judge answers about footprints of every size, here and a million yarns away, where they must be the same."""
    findings = []
    for name, rows in (("3/1 twill", ("##.#", "#.##", ".###", "###.")), ("1 pick", ("##.#",)), ("64 ends", _wide())):
        for alpha, thickness in ((0.01, 100.0), (1.0, 0.001)):
            fabric = _fabric(rows, alpha, thickness)
            near, far, inputs = _queries(fabric)
            values = []
            for queries in (far, near):
                answers = [estimate(fabric, queries, _options(kind), 0) for kind in ("gaussian", "box")]
                values.append(
                    np.concatenate(
                        [np.hstack([a.mean, a.standard_error, a.transparency[:, None]]) for a in answers], axis=0
                    )
                )
            inputs = {key: np.concatenate([column, column]) for key, column in inputs.items()}
            inputs["footprint"] = np.repeat(["gaussian", "box"], len(near.u))
            corner = f"{name}, α = {alpha:g}, T = {thickness:g}, 1e6 yarns away"
            findings.append(judge("answer", corner, "float64", inputs, values[0], values[1], _ROUNDING))
    return findings


def _plain(bend: float, random: np.random.Generator, count: int) -> tuple[heightfield.HeightField, Array, Array]:
    """Return a plain weave of yarns bent so far, and places across and along its floats that float32 holds."""
    fabric = _fabric(("#.", ".#"), 0.5, 2.0, bend)
    field = heightfield.height_field(fabric)
    edge = random.random(count) < 0.2
    across = np.where(edge, 0.5 - 10.0 ** random.uniform(-6, -1, count), random.uniform(-0.5, 0.5, count))
    along = np.where(random.random(count) < 0.2, 0.5 - 10.0 ** random.uniform(-6, -1, count),
                     random.uniform(-0.5, 0.5, count))  # fmt: skip
    # Multiples of 2^-22 stay what they are when half a yarn is added.
    return field, np.round(across * 2**22) / 2**22, np.round(along * 2**22) / 2**22


def _fabric(rows: tuple[str, ...], alpha: float, thickness: float, bend: float = 30.0) -> Fabric:
    yarn = Yarn(bend=bend, roughness=alpha)
    return Fabric(name="corner", draft=Matrix(rows=rows), warp=yarn, weft=yarn, optical_thickness=thickness)


def _wide() -> tuple[str, ...]:
    """Return a draft of 64 ends and 2 picks with floats of every length up to 8."""
    row = "".join("#" * length + "." * (9 - length) for length in range(1, 9))[:64]
    return row, "".join("#" if mark == "." else "." for mark in row)


def _options(footprint: str) -> TruthOptions:
    few = {"estimator": "owen", "min_count": 64, "max_count": 64}
    return TruthOptions.model_validate({"footprint": footprint, **few})


def _queries(fabric: Fabric) -> tuple[Queries, Queries, dict[str, Array]]:
    """Return queries near the origin, the same a million yarns away, and their numbers by name."""
    ends, picks = fabric.weave.repeat
    angles = [(0.0, 0.0), (60.0, 30.0), (89.9, 20.0), (20.0, 89.9), (120.0, 45.0), (45.0, 120.0)]
    sizes = [1e-4, 1e-2, 1.0, 1e2, 1e4]
    size, light, viewer, turn = np.array(
        [(s * max(ends, picks), i, o, t) for s in sizes for i, o in angles for t in (40.0, 180.0)]
    ).T
    wi, wo = (_direction(theta, azimuth) for theta, azimuth in ((light, 0 * turn), (viewer, turn)))
    # Sixteenths of a yarn, which single precision holds at a million too.
    centre = np.random.default_rng(10).integers(0, 16 * min(ends, picks), (2, len(size))) / 16
    shift = np.floor(_FAR / np.array([ends, picks])) * (ends, picks)
    near, far = (
        Queries.round(*(column.astype(np.float32) for column in (centre[0] + dx, centre[1] + dy, size, wi, wo)))
        for dx, dy in ((0.0, 0.0), shift)
    )
    return near, far, {"sigma": size, "wi": light, "wo": viewer, "turn": turn}


def _direction(theta: Array, azimuth: Array) -> Array:
    t, p = np.radians(theta), np.radians(azimuth)
    return np.stack([np.sin(t) * np.cos(p), np.sin(t) * np.sin(p), np.cos(t)], axis=1)


def _nearest(value: Array, truth: Array, repeats: Array) -> Array:
    """Return places in the repeat, moved by one repeat where rounding has put them at its other end."""
    far = np.asarray(truth, np.float64) - value
    return value + repeats * np.round(far / repeats)


PARTS: Final[dict[str, Callable[[], list[Finding]]]] = {
    "bends": bends,
    "long sums": sums,
    "places far away": places,
    "footprints": footprints,
}
