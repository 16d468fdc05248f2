"""Scattered light of a cloth for pairs of patches, and the roughnesses, blend and colours of yarns that have it.

It is linear in the colours but for the bounces between yarns:

    f = k_s,w S_w + k_s,f S_f + k_d,w C_w + k_d,f C_f + bounces(k)       (in transmission k_dt in place of k_d)

The unit components come from soft nodes (pipeline.analytic): roughnesses and blend change their sums, not their tables.
So colours follow from roughnesses by linear least squares (separable least squares, [Golub2003Separable]), with the
bounces of the colours before subtracted, until they agree.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from scipy.optimize import least_squares, lsq_linear

from pipeline.analytic.soft_nodes.components import read_behind, read_queries
from pipeline.analytic.soft_nodes.nodes import tabulate
from pipeline.bsdf.klems import Basis, Scattering
from pipeline.bsdf.of_fabric import pair_queries
from pipeline.compiled.arrays import Float64, Index, Mask
from pipeline.fitting.fitted import Interval
from pipeline.fitting.straight import middles
from pipeline.scenes.bounces import light_between, seen_light, tables_of
from pipeline.scenes.shade import colours_of
from pipeline.truth.geometry.heightfield import ALPHA, BLEND
from weaves.fabric import Fabric

COLOURS: Final = ("specular", "diffuse", "diffuse_transmission")
"""Colours of a yarn; in vectors of six, of warp and weft each."""

SCATTERED_NOISE: Final = 0.13  # error of a measured BSDF below 65 degrees, RMS over the mean: two laboratories

FACE_NOISE: Final = 0.014  # relative error of a measured reflectance: two laboratories

_LEVEL: Final = 2  # of detail of soft nodes
_WALKS: Final = 1 << 13  # of a table of bounces
_PASSES: Final = 6
_PAIRS = 4000
_NEAR_STRAIGHT = np.cos(np.radians(16.0))
_BOUNDS = [np.log(0.03), np.log(0.03), 0.0], [0.0, 0.0, 1.0]  # log roughnesses, blend
_STEP = 0.02  # of differences

_TABLES: Final = tables_of(_WALKS)


class Pairs(NamedTuple):
    """N pairs of patches: 0 reflection or 1 transmission, face that the light meets, patches scattered to and lit."""

    kind: Index
    side: Index
    out: Index
    into: Index

    @property
    def block(self) -> Index:
        """Kind and face as one number from 0 to 3, (N,)."""
        return 2 * self.kind + self.side

    def take(self, index: Index) -> Pairs:
        """Return the pairs at `index`."""
        return Pairs(*(column[index] for column in self))


class YarnOptics(NamedTuple):
    """Numbers of both yarns that shape the unit components."""

    roughness: tuple[float, float]
    blend: float


class Scatterer:
    """A cloth's scattered light for N pairs; its geometry and optical thickness count.

    Light comes from the middle of its patch, where a goniophotometer's lamp stands. Each pair has one viewer, chosen at
    random in its patch, and is mirrored at random, because cloth and mirror image count as one.
    """

    def __init__(self, fabric: Fabric, basis: Basis, pairs: Pairs) -> None:
        self.fabric, self.pairs = fabric, pairs
        self.tables = [tabulate(side, behind=True, level=_LEVEL) for side in (fabric, fabric.back())]
        random = np.random.default_rng(0)
        place = np.concatenate([middles(pairs.into), random.random((2, len(pairs.kind)))])
        queries = pair_queries(
            fabric, basis, (pairs.into, *place[:2]), (pairs.out, *place[2:]), pairs.side, pairs.side ^ pairs.kind
        )
        mirror = np.where(random.random((len(pairs.kind), 2)) < 0.5, -1.0, 1.0).astype(np.float32)
        mirror = np.column_stack([mirror, np.ones(len(mirror), np.float32)])
        self.queries = queries._replace(wi=queries.wi * mirror, wo=queries.wo * mirror)
        self._cosine = np.abs(self.queries.wi[:, 2]).astype(np.float64)

    def components(self, optics: YarnOptics) -> Float64:
        """Return the BSDF of each of the six colours, without bounces, (N, 6), 1/sr."""
        unit = np.zeros((len(self._cosine), 4))
        for side, table in enumerate(self.tables):
            yarn = table.yarn.copy()
            yarn[:, ALPHA], yarn[:, BLEND] = optics.roughness, optics.blend
            table = table._replace(yarn=yarn)
            for behind in (False, True):
                viewed = (self.queries.wo[:, 2] < 0.0) == bool(side)
                rows = np.flatnonzero(viewed & ((self.pairs.kind == 1) == behind))
                if rows.size:
                    seen = self.queries.take(rows)
                    seen = seen.turned() if side else seen
                    unit[rows] = read_behind(table, seen)[:, :4] if behind else read_queries(table, seen).components
        unit /= self._cosine[:, None]
        through = self.pairs.kind[:, None] == 1
        return np.concatenate(
            [unit[:, :2], np.where(through, 0.0, unit[:, 2:]), np.where(through, unit[:, 2:], 0.0)], 1
        )

    def bounced(self, colours: Float64) -> Float64:
        """Return the light of all bounces after the first for six colours, (N,), 1/sr."""
        # The tables know no roughness: one number of it lets all fits of a geometry share them.
        fabric = with_colours(self.fabric, within_energy(self.fabric, colours), YarnOptics((0.4, 0.4), 0.5))
        light = seen_light(light_between(fabric, self.queries, _TABLES), colours_of(fabric, self.queries))
        return np.asarray(light[:, :, 0].sum(axis=1) / self._cosine)

    def values(self, optics: YarnOptics, colours: Float64) -> Float64:
        """Return the BSDF of each pair with all bounces, (N,), 1/sr."""
        return np.asarray(self.components(optics) @ colours + self.bounced(colours))


def solve(components: Float64, values: Float64, weights: Float64) -> Float64:
    """Return the six colours in [0, 1] with the least sum of squares, (6,)."""
    # The triangle of a QR decomposition has the same sums of squares in seven rows.
    triangle = np.linalg.qr(np.column_stack([components, values]) * weights[:, None])[1]
    return np.asarray(lsq_linear(triangle[:, :6], triangle[:, 6], bounds=(0.0, 1.0)).x)


def within_energy(fabric: Fabric, colours: Float64) -> Float64:
    """Return six colours whose diffuse ones are lowered to what no yarn exceeds (weaves.yarn)."""
    colours = np.array(colours)
    for family, yarn in enumerate((fabric.warp, fabric.weft)):
        grey = yarn.model_copy(update={"specular": (float(colours[family]),) * 3})
        most = 0.999 * min(grey.most_diffuse(fabric.optical_thickness))
        diffuse = colours[[2 + family, 4 + family]].sum()
        colours[[2 + family, 4 + family]] *= min(1.0, most / max(diffuse, 1e-12))
    return colours


def with_colours(fabric: Fabric, colours: Float64, optics: YarnOptics) -> Fabric:
    """Return the fabric in six grey colours and with other optics."""
    yarns = {}
    for family, name in enumerate(("warp", "weft")):
        update: dict[str, object] = {key: (float(colours[2 * k + family]),) * 3 for k, key in enumerate(COLOURS)}
        update |= {"roughness": float(optics.roughness[family]), "blend": float(optics.blend)}
        yarns[name] = getattr(fabric, name).model_copy(update=update)
    return fabric.model_copy(update=yarns)


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
    optics = _optics(_refined(scatterer, values, weights, (np.log(0.35), np.log(0.35), 0.5), 12))
    components = scatterer.components(optics)
    colours = solve(components, values, weights)
    once = components @ colours
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
    colours, components = fit.colours, fit.scatterer.components(fit.optics)
    for _ in range(_PASSES):
        colours = solve(components, fit.values - fit.scatterer.bounced(colours), fit.weights)
    colours = within_energy(fit.scatterer.fabric, colours)
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
