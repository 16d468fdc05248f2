"""Roughnesses, blend and colours of the yarns of a cloth of known geometry, from the light that it scatters."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from scipy.optimize import least_squares

from pipeline.bsdf.klems import Scattering
from pipeline.compiled.arrays import Float64, Mask
from pipeline.fitting.fitted import Interval
from pipeline.fitting.scattered import COLOURS, Pairs, Scatterer, YarnOptics, solve, solve_with_bounces
from pipeline.fitting.straight import middles
from weaves.fabric import Fabric

SCATTERED_NOISE: Final = 0.13
"""Error of a measured BSDF below 65 degrees, RMS over the mean: two laboratories."""

FACE_NOISE: Final = 0.014
"""Relative error of a measured reflectance: two laboratories."""

_PAIRS = 4000
_NEAR_STRAIGHT = np.cos(np.radians(16.0))
_BOUNDS = [np.log(0.03), np.log(0.03), 0.0], [0.0, 0.0, 1.0]  # log roughnesses, blend
_STEP = 0.02  # of differences


class OpticsFit(NamedTuple):
    """YarnOptics and colours (6,) that were fitted without bounces, their error, and what is needed to go on."""

    scatterer: Scatterer
    optics: YarnOptics
    colours: Float64
    error: float
    values: Float64
    weights: Float64


def pairs_of(scattering: Scattering, band: str, lights: Mask, count: int | None = None) -> Pairs:
    """Return the pairs of some lights (P,) that are known: all, or so many chosen by their projected solid angles.

    Transmitted light within 16 degrees of straight is left out, because the blurred light of the gaps is there.
    """
    basis, patches = scattering.basis, np.arange(scattering.basis.patches)
    label = basis.directions(patches, *middles(patches))
    known = np.isfinite(scattering.bands[band]) & lights
    known[1] &= label @ label.T < _NEAR_STRAIGHT
    pairs = Pairs(*np.nonzero(known))
    if count is None or count >= len(pairs.kind):
        return pairs
    size = basis.projected_solid_angle[pairs.out] * basis.projected_solid_angle[pairs.into]
    chance = size / np.bincount(pairs.block, size, 4)[pairs.block]
    chosen = np.random.default_rng(0).choice(len(chance), count, replace=False, p=chance / chance.sum())
    return pairs.take(np.sort(chosen))


def fit_optics(scattering: Scattering, band: str, lights: Mask, fabric: Fabric) -> OpticsFit:
    """Fit the light that is scattered once. Errors count over the mean of their kind and face."""
    pairs = pairs_of(scattering, band, lights, _PAIRS)
    values, scatterer = scattering.bands[band][pairs], Scatterer(fabric, scattering.basis, pairs)
    mean = np.bincount(pairs.block, values, 4) / np.maximum(np.bincount(pairs.block, minlength=4), 1)
    weights = 1.0 / np.maximum(mean, 1e-6)[pairs.block] / np.sqrt(len(values))
    start = np.log(0.35), np.log(0.35), 0.5
    numbers = _refined(scatterer, values, weights, start, 12)
    colours = solve(scatterer.components(optics := _optics(numbers)), values, weights)
    once = scatterer.components(optics) @ colours
    error = float(np.linalg.norm((once - values) * weights)) / SCATTERED_NOISE
    ours, theirs = (np.bincount(pairs.block, part, 4)[:2] for part in (once, values))
    off = np.abs(ours / np.maximum(theirs, 1e-9) - 1.0)[theirs > 0.0]
    error = float(np.hypot(error, off.max(initial=0.0) / FACE_NOISE))
    return OpticsFit(scatterer, optics, colours, error, values, weights)


def _refined(
    scatterer: Scatterer, values: Float64, weights: Float64, start: tuple[float, float, float], evaluations: int
) -> Float64:
    """Return log roughnesses and blend, (3,), with the least squares; colours follow from them."""

    def residuals(numbers: Float64) -> Float64:
        components = scatterer.components(_optics(numbers))
        return np.asarray((components @ solve(components, values, weights) - values) * weights)

    return np.asarray(least_squares(residuals, start, bounds=_BOUNDS, diff_step=_STEP, max_nfev=evaluations).x)


def _optics(numbers: Float64) -> YarnOptics:
    return YarnOptics((float(np.exp(numbers[0])), float(np.exp(numbers[1]))), float(numbers[2]))


def optics_numbers(fit: OpticsFit, resamplings: int) -> tuple[Float64, dict[str, Interval]]:
    """Return the six colours with all bounces, and all numbers with intervals: 95 % of resamplings of the lights."""
    colours = solve_with_bounces(fit.scatterer, fit.optics, fit.values, fit.weights)
    roughness, blend = fit.optics
    start = float(np.log(roughness[0])), float(np.log(roughness[1])), blend
    random, samples = np.random.default_rng(1), []
    lights, light = np.unique(fit.scatterer.pairs.into, return_inverse=True)
    for _ in range(resamplings):
        drawn = np.bincount(random.integers(0, len(lights), len(lights)), minlength=len(lights))
        weights = fit.weights * np.sqrt(drawn[light])
        numbers = _refined(fit.scatterer, fit.values, weights, start, 3)
        # Colours move with the resampling as those without bounces do.
        moved = solve(fit.scatterer.components(_optics(numbers)), fit.values, weights) - fit.colours
        samples.append([*np.exp(numbers[:2]), numbers[2], *(colours + moved)])
    best = np.array([*roughness, blend, *colours])
    low, high = np.clip(np.quantile([best, *samples], (0.025, 0.975), axis=0), 0.0, 1.0)
    keys = ["warp.roughness", "weft.roughness", "blend"]
    keys += [f"{yarn}.{colour}" for colour in COLOURS for yarn in ("warp", "weft")]
    rows = zip(keys, best, np.minimum(low, best), np.maximum(high, best), strict=True)
    return colours, {key: Interval(*map(float, row)) for key, *row in rows}
