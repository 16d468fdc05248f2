"""The corners of the point model: flakes, slab and exponentials (`reports.truth.stability`).

Inputs and evaluations are those of `reports.truth.corners`.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final

import mpmath
import numpy as np

from pipeline.compiled import float32 as single
from pipeline.truth.scattering import slab
from reports.truth import formulas
from reports.truth.corners import (
    Corners,
    around_axis,
    double_precision,
    draw,
    each,
    kernel_density,
    kernel_sigma,
    kernel_slab,
    node_crossing,
    node_slab,
    single_precision,
    textbook_slab,
    unit,
    vector,
)
from reports.truth.finding import DOUBLE, ILL, Finding, judge
from reports.truth.formulas import DIGITS, exact

ALPHAS: Final = (0.01, 0.1, 0.5, 1.0)
THICKNESSES: Final = (0.001, 0.1, 2.0, 100.0)
_STEPS: Final = (0.0, 30.0, 60.0, 80.0, 89.0, 89.9)
_ROUNDING: Final = 2.0**-24
_DARK: Final = 1e-30  # below this single precision holds no light
_DARKER: Final = 1e-280  # nor double
_FACTORS: Final = 3  # roundings in an exponent -T sigma / cos

# Worst relative errors in single precision, by alpha; those of 1 are taken from .5, where nothing else is known.
SIGMA_LISTED: Final = {0.01: 1.9e-6, 0.1: 3e-7, 0.5: 3e-7, 1.0: 3e-7}
DENSITY_LISTED: Final = {0.01: 1.2e-5, 0.1: 1.4e-6, 0.5: 1.4e-6, 1.0: 1.4e-6}
REFLECTION_LISTED: Final = {0.01: 1.6e-5, 0.1: 2e-6, 0.5: 8e-7, 1.0: 8e-7}
TRANSMISSION_LISTED: Final = {0.01: 1.6e-5, 0.1: 3.8e-6, 0.5: 3.5e-6, 1.0: 3.5e-6}
THROUGH_LISTED: Final = 2.5e-7
FORWARD_LISTED: Final = {1e-2: 1.4e-4, 1e-4: 1.4e-2, 1e-6: 2.6}
ABSORBED_LISTED, REMAINING_LISTED = 2e-7, 3e-7  # `pipeline.compiled.float32`


def exponentials() -> list[Finding]:
    """Judge 1 - exp(-x) and exp(-x)."""
    random = np.random.default_rng(1)
    thin, deep = 10.0 ** random.uniform(-8, 0, 6000), random.uniform(0, 80, 6000)
    x = np.concatenate([[0.0], thin, deep]).astype(np.float32)
    wide, inputs = x.astype(np.float64), {"x": x}
    return [
        judge("1 − exp(−x)", "x 0 … 80", "float32", inputs, each(single.absorbed, x), -np.expm1(-wide),
              ABSORBED_LISTED, naive=np.float32(1) - np.exp(-x)),
        judge("exp(−x)", "x 0 … 80", "float32", inputs, each(single.remaining, x), np.exp(-wide),
              REMAINING_LISTED),
    ]  # fmt: skip


def through() -> list[Finding]:
    """Judge G_t, the share that leaves on the other side, at light and viewer of nearly equal Lambda."""
    random = np.random.default_rng(2)
    findings = []
    for low, high in ((0.0, 0.0), (1e-8, 1e-6), (1e-6, 1e-4), (1e-4, 1e-2)):
        lambda_i = np.append(10.0 ** random.uniform(-2, 1, 3000), 1.7).astype(np.float32)
        apart = np.exp(random.uniform(np.log(low), np.log(high), 3001)) if high else np.zeros(3001)
        lambda_o = (lambda_i * (1 + apart)).astype(np.float32)
        t = np.float32(2)
        x = np.maximum(t * np.abs(lambda_i - lambda_o), np.float32(1e-30))
        shallow = t * np.minimum(lambda_i, lambda_o)
        value = t * each(single.remaining, shallow) * each(single.absorbed, x) / x
        with mpmath.workdps(DIGITS):
            truth = formulas.textbook_through(exact(lambda_i), exact(lambda_o), exact(np.full(3001, 2.0)))
        naive = formulas.textbook_through(lambda_i, lambda_o, np.full(3001, t))
        corner = f"ΔΛ/Λ {_power(low)} … {_power(high)}" if high else "equal Λ"
        inputs = {"Λi": lambda_i, "Λo": lambda_o}
        findings.append(judge("G_t", corner, "float32", inputs, value, truth, THROUGH_LISTED, naive=naive))
    return findings


def flakes() -> list[Finding]:
    """Judge sigma near the fibre axis, and D."""
    findings = []
    for alpha in ALPHAS:
        random = np.random.default_rng(3)
        t, w = around_axis(random, 4000)
        corners = Corners(w, w, t, np.full(4000, alpha), np.ones(4000)).cast(single_precision)
        wide = corners.cast(double_precision)
        inputs = {"w": np.stack(corners.wi, axis=1), "t": np.stack(corners.t, axis=1)}
        few = wide.cast(lambda part: part[:400])
        fewer = {name: column[:400] for name, column in inputs.items()}
        with mpmath.workdps(DIGITS):
            high = few.cast(exact)
            truth = formulas.textbook_sigma(high.wi, high.t, high.alpha)
        corner = f"α = {alpha:g}, near the axis"
        narrow = (corners.wi, corners.t, corners.alpha)
        listed = SIGMA_LISTED[alpha]
        with np.errstate(invalid="ignore"):
            naive = formulas.textbook_sigma(*narrow)
        value, reference = formulas.sigma(*narrow), kernel_sigma(wide.wi, wide.t, wide.alpha)
        findings.append(judge("σ", corner, "float32", inputs, value, reference, listed, naive=naive))
        double = kernel_sigma(few.wi, few.t, few.alpha)
        findings.append(judge("σ", corner, "float64", fewer, double, truth, listed * DOUBLE))
    for alpha in ALPHAS:
        corners = draw(4000, alpha, _STEPS, _STEPS, (2.0,)).cast(single_precision)
        wide = corners.cast(double_precision)
        v = vector(double_precision(np.stack(corners.v)))
        narrow, listed = (corners.v, corners.t, corners.alpha), DENSITY_LISTED[alpha]
        value, reference = formulas.density(*narrow), kernel_density(v, wide.t, wide.alpha)
        naive = formulas.matrix_density(*narrow)
        corner = f"α = {alpha:g}"
        findings.append(judge("D", corner, "float32", corners.inputs, value, reference, listed, naive=naive))
        few = wide.cast(lambda part: part[:400])
        with mpmath.workdps(DIGITS):
            high = few.cast(exact)
            truth = formulas.textbook_density(high.v, high.t, high.alpha)
            sums = vector(np.stack(high.v).astype(np.float64))
        double = kernel_density(sums, few.t, few.alpha)
        findings.append(judge("D", corner, "float64", few.inputs, double, truth, listed * DOUBLE))
    return findings


def slabs() -> list[Finding]:
    """Judge f_r, f_t and what crosses the yarn, over angles, thicknesses and roughnesses."""
    findings = []
    for behind, name, listed in ((False, "f_r", REFLECTION_LISTED), (True, "f_t", TRANSMISSION_LISTED)):
        steepest = 80.0 if behind else 89.9
        for alpha in ALPHAS:
            for corner, light, depths in (
                (f"{steepest:g}°", (steepest,), (2.0,)),
                ("any angle and T", _STEPS, THICKNESSES),
            ):
                viewer = tuple(step for step in _STEPS if step <= max(light))
                corners = draw(1500, alpha, light, viewer, depths, behind)
                exponent = behind and len(depths) > 1
                findings += _slab(f"α = {alpha:g}, {corner}", name, corners, behind, listed[alpha], exponent)
    return findings


def _slab(corner: str, name: str, corners: Corners, behind: bool, listed: float, deep: bool) -> list[Finding]:
    """Judge a component in single precision against double, and in double against 50 digits.

    In a `deep` layer an exponential rules, which makes of its exponent's rounding as much more as the exponent says.
    """
    single_listed, double_listed = listed, listed * DOUBLE
    if deep:
        single_listed += _exponent(_DARK) * _ROUNDING
        double_listed += _exponent(_DARKER) * _ROUNDING * DOUBLE
    narrow = corners.cast(single_precision)
    wide = narrow.cast(double_precision)
    both = wide.cosines[0] * wide.cosines[1]
    reference, naive = both * kernel_slab(wide, behind), both * textbook_slab(narrow, behind)
    few = corners.cast(lambda part: part[:150])
    with mpmath.workdps(DIGITS):
        truth = textbook_slab(few.cast(exact), behind)
    return [
        judge(name, corner, "float32", narrow.inputs, node_slab(narrow, behind), reference, single_listed,
              naive=naive, floor=_DARK),
        judge(name, corner, "float64", few.inputs, kernel_slab(few, behind), truth, double_listed, floor=_DARKER),
    ]  # fmt: skip


def _exponent(darkest: float) -> float:
    """Return by how much the roundings of an exponent count, at most, in an exponential that is not dark yet."""
    return -math.log(darkest) * _FACTORS


def unscattered() -> list[Finding]:
    """Judge exp(-T Lambda), which crosses a yarn without meeting a flake."""
    findings = []
    for alpha in ALPHAS:
        corners = draw(1500, alpha, (0.0,), _STEPS, THICKNESSES).cast(single_precision)
        wide = corners.cast(double_precision)
        sigma_o = kernel_sigma(wide.wo, wide.t, wide.alpha)
        reference = each(slab.unscattered, sigma_o, wide.cosines[1], wide.thickness)
        listed = SIGMA_LISTED[alpha] + _exponent(_DARK) * _ROUNDING
        corner, found = f"α = {alpha:g}, any angle and T", node_crossing(corners)
        findings.append(judge("exp(−TΛ)", corner, "float32", corners.inputs, found, reference, listed, floor=_DARK))
    return findings


def rounded_input() -> list[Finding]:
    """Show what rounding the directions does, which no form helps: to cosines at grazing angles, to D at wo = -wi."""
    findings = []
    normal, light = around_axis(np.random.default_rng(4), 4000, math.radians(89.9))
    slanting, towards = (vector(np.stack(w).astype(np.float32)) for w in (normal, light))
    inputs = {"n": np.stack(slanting, axis=1), "wi": np.stack(towards, axis=1)}
    value, truth = formulas.dot(slanting, towards), formulas.dot(normal, light)
    listed = 2 * _ROUNDING / math.cos(math.radians(89.9))
    findings.append(judge("cos", f"89.9°, {ILL}", "float32", inputs, value, truth, listed))
    random = np.random.default_rng(5)
    for angle, listed in FORWARD_LISTED.items():
        t, wi = (unit(random.normal(size=(3, 4000))) for _ in range(2))
        aside = unit(np.cross(wi, random.normal(size=(3, 4000)), axis=0))
        wo = -wi * np.cos(angle) + aside * np.sin(angle)
        alpha = np.full(4000, 0.1)
        truth = kernel_density(vector(wi + wo), vector(t), alpha)
        corners = Corners(vector(wi), vector(wo), vector(t), alpha, alpha).cast(single_precision)
        value = formulas.density(corners.v, corners.t, corners.alpha)
        corner = f"{_power(angle)} off −wi, {ILL}"
        naive = formulas.matrix_density(corners.v, corners.t, corners.alpha)
        findings.append(judge("D", corner, "float32", corners.inputs, value, truth, listed, naive=naive))
    return findings


def _power(x: float) -> str:
    return f"{x:.0e}".replace("e-0", "e−")


PARTS: Final[dict[str, Callable[[], list[Finding]]]] = {
    "exponentials": exponentials,
    "nearly equal Lambda": through,
    "flakes": flakes,
    "slabs": slabs,
    "unscattered light": unscattered,
    "directions as they are rounded": rounded_input,
}
