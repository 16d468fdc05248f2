"""Cloth that a shape wears: its patch BSDF in the shape's own frame and texture coordinates, in NumPy.

Local frame, as Mitsuba's: z is the shading normal, x the direction of dp_du in the tangent plane. The cloth's frame is
turned by `turn` about z; v is counted backwards where u, v are left-handed (pipeline.scenes.scene). Mitsuba's wi points
to the viewer and its wo to the light: they are `viewer` and `light` here, wo and wi in the queries.

A light on one side of the surface and on the other of its shading normal gives nothing; so no light leaks through
interpolated normals. Views more grazing than allowed are tilted (`pipeline.scenes.places.tilted`).

A footprint is the Gaussian of `PIXEL` pixels under J = d(u, v in yarns)/d(pixel): its axes are J's left singular
vectors, its deviations `PIXEL` times the singular values [Igehy1999RayDifferentials].

Rows are answered in runs of fixed length, on all cores. A method that draws points at random takes the seed of a run
from the run's own directions: a picture depends on the seed of its rays alone.
"""

import itertools
import math
import zlib
from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache, partial
from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt
from pydantic import Field

from pipeline.analytic.importance.lobes import HEIGHT, SHARE, STRAIGHT, Lobes
from pipeline.compiled.arrays import Float32, Float64, Mask
from pipeline.models.all_cores import on_all_cores
from pipeline.models.fallback import Fallback
from pipeline.models.named import TRUTH, named_method
from pipeline.models.patch_bsdf import USUAL_METHOD, PatchBSDF, Sample
from pipeline.scenes.gbuffer import LEAST_SIGMA, reduced
from pipeline.scenes.options import BOUNCES, Bounces, SceneOptions
from pipeline.scenes.picture import TruthAnswers
from pipeline.scenes.places import LEAST_CURVATURE, tilted
from pipeline.scenes.scene import Yarns
from pipeline.truth.options import TruthOptions
from pipeline.truth.query import STEEPEST_CURVATURE, Queries
from weaves.errors import BadInput
from weaves.fabric import Fabric, load_fabric
from weaves.validation import Frozen, validated

RUN: Final = 2**14  # rows that a thread answers at a time

PIXEL: Final = SceneOptions().pixel_sigma  # standard deviation of a pixel's Gaussian, in pixels

LARGEST_FOOTPRINT: Final = SceneOptions().largest_sigma
"""Both axes of a footprint are cut here, in yarn spacings; where derivatives are not finite, they are this long."""

_COLOURS = ("specular", "diffuse", "diffuse_transmission")
_KEPT = 2**19  # hits of which all is kept for the next call: 230 megabytes
_TRUTH = TruthOptions(estimator="auto", relative_error=0.1, min_count=64, max_count=256)  # many rays share a pixel
_LARGEST_ANGLE = SceneOptions().largest_angle
_FLAT = 1e-6  # least |cosine| of a light


class ClothOptions(Frozen):
    """Cloth of a shape, the method that evaluates it, and the size of its footprints."""

    fabric: str
    """A preset, or the path of a fabric's TOML."""
    method: str = USUAL_METHOD
    """The method that evaluates the cloth: a model that comes with the package or learns nothing, with ``:k`` for a
    setting; the folder of a trained model; or ``truth``."""
    bounces: Bounces = BOUNCES
    """Bounces of light within the cloth: ``all`` adds what its yarns give to each other."""
    yarns: Yarns = 100.0
    """Yarn spacings in one unit of u and of v."""
    yarns_v: Yarns | None = None
    """Yarn spacings in one unit of v, if they differ from those of u."""
    turn: float = Field(default=0.0, ge=-360, le=360)
    """Angle from u to the weft, in degrees, as the front shows it."""
    sigma: float | None = Field(default=None, gt=0, le=1e6)
    """Standard deviation of every footprint, in yarn spacings, whatever the ray; left out: from the ray."""
    pixel_angle: float | None = Field(default=None, gt=0, le=1)
    """Angle of a pixel as the camera sees it, in radians: the footprint of a ray that has no differentials. It is too
    small after a bounce."""


Footprints = tuple[Float32, Float32, Float32]  # `sigma`, `sigma_minor` and `angle` of `Queries`, (N,) each


def footprints_of(jacobian: Float64) -> Footprints:
    """Return the footprints of N pixels, from d(uv in yarns)/d(pixel), (N, 2, 2)."""
    lost = np.asarray(~np.isfinite(jacobian).all(axis=(1, 2)))
    j = np.where(lost[:, None, None], np.eye(2) * (LARGEST_FOOTPRINT / PIXEL), jacobian)
    j = np.clip(j, -1e12, 1e12)
    # Eigenvalues of J J^T in closed form; the smaller one from the determinant, free of cancellation.
    xx, yy, xy = (np.einsum("ni,ni->n", j[:, a], j[:, b]) for a, b in ((0, 0), (1, 1), (0, 1)))
    apart = np.hypot(0.5 * (xx - yy), xy)
    major = np.sqrt(0.5 * (xx + yy) + apart)
    area = np.abs(j[:, 0, 0] * j[:, 1, 1] - j[:, 0, 1] * j[:, 1, 0])
    minor = area / np.maximum(major, 1e-150)
    return _cut(PIXEL * major), _cut(PIXEL * minor), (0.5 * np.arctan2(xy, 0.5 * (xx - yy))).astype(np.float32)


def _round_footprints(sigma: Float64) -> Footprints:
    """Return N round footprints."""
    size = _cut(sigma)
    return size, size, np.zeros_like(size)


def _cut(deviation: Float64) -> Float32:
    return np.clip(deviation, LEAST_SIGMA, LARGEST_FOOTPRINT).astype(np.float32)


class RayHits(NamedTuple):
    """N places of a shape that rays meet, in its local frame; never changed once they are made."""

    uv: Float64  # texture coordinates, (N, 2)
    viewer: Float64  # unit vectors to where the ray comes from, (N, 3)
    outward: Float64  # geometric normal; 0 if it is not known, (N, 3)
    handed: Float64  # -1 where u, v are left-handed about the shading normal, 1 elsewhere, (N,)
    jacobian: Float64  # d(uv)/d(pixel); 0 where the ray has no differentials, (N, 2, 2)
    spread: Float64  # change of u with the angle of the ray, across it, 1/radian, (N,)
    stride: Float64  # change of u and v with the length along the surface towards the viewer, (N, 2)
    bend: Float64  # curvature of the surface that way, 1/length; 0 if it is flat or not known, (N,)


_Known = tuple[RayHits, Queries, Float32, list[Lobes]]
"""Hits, their footprints and viewers, the shares of rays that do not leave the cloth again, and the runs' lobes."""


class Worn:
    """A cloth on a shape, of a fabric in place of that of the options if one is given.

    BadInput if there is no such fabric or method.
    """

    def __init__(self, options: ClothOptions, fabric: Fabric | None = None) -> None:
        self.options = options
        self._bsdf = _bsdf(fabric or load_fabric(options.fabric), options.method, options.bounces)
        self.fabric = self._bsdf.fabric
        turn = math.radians(options.turn)
        self._turn = np.array([[math.cos(turn), math.sin(turn)], [-math.sin(turn), math.cos(turn)]])
        self._known: _Known | None = None

    def colours(self) -> dict[str, Sequence[float]]:
        """Return the colours of the yarns, linear RGB, by names such as ``warp_diffuse``; none if threads have some."""
        names = itertools.product(("warp", "weft"), _COLOURS) if self.fabric.colours is None else ()
        return {f"{yarn}_{kind}": getattr(getattr(self.fabric, yarn), f"{kind}_rgb") for yarn, kind in names}

    def dyed(self, colours: Mapping[str, Sequence[float]]) -> "Worn":
        """Return the cloth with other colours of its yarns, named as in `colours`; BadInput if they make light."""
        table = self.fabric.model_dump(mode="json")
        for name, rgb in colours.items():
            yarn, _, kind = name.partition("_")
            table[yarn][kind] = list(rgb)
        return Worn(self.options, validated(Fabric, table, self.fabric.name))

    def eval(self, hits: RayHits, light: Float64) -> Float64:
        """Return the BSDF times the cosine to N lights, linear RGB (N, 3), 1/sr."""
        _, looks, covered, _ = self._seen(hits)
        values = np.where(_lit(hits, light)[:, None], _asked(self._bsdf.eval, self._lit_by(looks, light)), 0.0)
        return values * covered[:, None]

    def pdf(self, hits: RayHits, light: Float64) -> Float32:
        """Return the density with which `sample` draws N lights, (N,), 1/sr."""
        _, looks, _, lobes = self._seen(hits)
        tasks = zip(_runs(self._lit_by(looks, light)), lobes, strict=True)
        return np.concatenate(on_all_cores(self._bsdf.pdf, list(tasks)))

    def sample(self, hits: RayHits, random: Float64) -> Sample:
        """Draw a direction to the light for each hit, from random numbers (N, 3) in [0, 1)."""
        _, looks, covered, lobes = self._seen(hits)
        runs = zip(_runs(looks), np.split(random, range(RUN, len(random), RUN)), lobes, strict=True)
        tasks = [(run, drawn, own, _seed(run.u, drawn)) for run, drawn, own in runs]
        parts = on_all_cores(self._bsdf.sample, tasks)
        wi, pdf, straight, weight = (np.concatenate(column) for column in zip(*parts, strict=True))
        light = np.where(straight[:, None], -hits.viewer, _turned(wi.astype(np.float64), self._turn))
        weight[~straight & ~_lit(hits, light)] = 0.0
        weight *= covered[:, None]
        weight[straight] += ((1.0 - covered[straight]) / pdf[straight])[:, None]
        return Sample(light.astype(np.float32), pdf, straight, weight)

    def transparency(self, hits: RayHits) -> Float32:
        """Return the light straight through the cloth or past a silhouette, to the viewer of each hit, (N,)."""
        _, looks, covered, _ = self._seen(hits)
        through = _asked(partial(self._bsdf.method.transparency, self.fabric), looks)
        return np.asarray(1.0 - covered + covered * through)

    def _seen(self, hits: RayHits) -> _Known:
        """Return what is known of hits; a renderer calls several times with the same ones."""
        known = self._known
        if known is None or not (known[0] is hits or all(map(np.array_equal, known[0], hits))):
            looks, covered = self._looks(hits), np.ones(len(hits.uv), np.float32)
            if (curved := np.flatnonzero(looks.curvature)).size:
                wo = _turned(hits.viewer[curved], self._turn.T).astype(np.float32)
                along = looks.take(curved)._replace(wi=wo, wo=wo)
                covered[curved] = _asked(partial(self._bsdf.method.coverage, self.fabric), along)
            lobes = on_all_cores(self._bsdf.lobes, [(run,) for run in _runs(looks)])
            for start, run in zip(range(0, len(covered), RUN), lobes, strict=True):
                share = covered[start : start + RUN, None]
                run.flakes[:, [SHARE, HEIGHT]] *= share[:, None]
                run.rest[:] *= share
                run.rest[:, STRAIGHT] += 1.0 - share[:, 0]
            known = (hits, looks, covered, lobes)
            self._known = known if len(covered) <= _KEPT else None
        return known

    def _lit_by(self, looks: Queries, light: Float64) -> Queries:
        towards = _turned(light, self._turn.T)
        # A light in the plane has no answer; it counts as dark (`_lit`).
        towards[:, 2] = np.where(np.abs(towards[:, 2]) < _FLAT, _FLAT, towards[:, 2])
        return looks._replace(wi=towards.astype(np.float32))

    def _looks(self, hits: RayHits) -> Queries:
        """Return the footprint and viewer of each hit as queries, lit from the viewer."""
        own = (self.options.yarns, self.options.yarns_v or self.options.yarns)
        yarns = np.stack([np.ones_like(hits.handed), hits.handed], axis=-1) * own
        place = _turned(hits.uv * yarns, self._turn.T)
        facing = np.einsum("ni,ni->n", hits.outward, hits.viewer)
        side = np.where(np.where(facing == 0.0, hits.viewer[:, 2], facing) < 0.0, -1.0, 1.0)
        wo = tilted(_turned(hits.viewer, self._turn.T), side, _LARGEST_ANGLE).astype(np.float32)
        sigma, sigma_minor, angle = self._footprints(hits, yarns)
        ends, picks = self.fabric.repeat
        u, v = reduced(place[:, 0], ends), reduced(place[:, 1], picks)
        curvature = np.where(side > 0.0, self._curvature(hits, own), 0.0).astype(np.float32)
        return Queries(u, v, sigma, wo, wo, sigma_minor, angle, curvature)

    def _curvature(self, hits: RayHits, yarns: tuple[float, float]) -> Float64:
        """Return the curvature along the view ray, 1/yarn spacings; what is almost flat is flat."""
        per_length = np.hypot(*(hits.stride * yarns).T)
        kappa = hits.bend / np.where(per_length > 0.0, per_length, np.inf)
        return np.where(kappa > LEAST_CURVATURE, np.minimum(kappa, STEEPEST_CURVATURE), 0.0)

    def _footprints(self, hits: RayHits, yarns: Float64) -> Footprints:
        if self.options.sigma is not None:
            return _round_footprints(np.full(len(hits.uv), self.options.sigma))
        traced = np.asarray(hits.jacobian.any(axis=(1, 2)))
        of_rays = footprints_of(_turned(hits.jacobian * yarns[..., None], self._turn.T))
        if traced.all():
            return of_rays
        if self.options.pixel_angle is None:
            allowed = "a ray without a footprint: use the integrator twillight_path, or state pixel_angle or sigma"
            raise BadInput(f"bsdf {self.fabric.name}", "pixel_angle", None, allowed)
        width = PIXEL * self.options.pixel_angle * hits.spread * self.options.yarns
        round_size = _round_footprints(np.nan_to_num(width, nan=LARGEST_FOOTPRINT))
        sigma, sigma_minor, angle = (np.where(traced, a, b) for a, b in zip(of_rays, round_size, strict=True))
        return sigma, sigma_minor, angle


def _turned(vectors: Float64, turn: Float64) -> Float64:
    """Return vectors, (N, 2) or (N, 3), or the columns of matrices (N, 2, 2), turned about z by a matrix, (2, 2)."""
    result = vectors.copy()
    # A product of matrices this small would take ten times as long.
    for axis in range(2):
        result[:, axis] = vectors[:, 0] * turn[0, axis] + vectors[:, 1] * turn[1, axis]
    return result


def _lit(hits: RayHits, light: Float64) -> Mask:
    """Return which lights are on one side of both normals, and not in the plane, (N,)."""
    facing = np.einsum("ni,ni->n", hits.outward, light) * np.where(hits.outward[:, 2] < 0.0, -1.0, 1.0)
    return np.asarray((np.abs(light[:, 2]) > _FLAT) & (~hits.outward.any(axis=1) | (light[:, 2] * facing > 0.0)))


def _seed(place: Float32, drawn: Float32 | Float64) -> int:
    """Return a number that any change of places and of directions, or of what draws them, changes."""
    return zlib.crc32(drawn.tobytes(), zlib.crc32(place.tobytes()))


def _runs(queries: Queries) -> list[Queries]:
    return [queries.take(slice(start, start + RUN)) for start in range(0, len(queries.u), RUN)]


def _asked(answer: Callable[[Queries, int], npt.NDArray[Any]], queries: Queries) -> npt.NDArray[Any]:
    """Return the answers to queries and a seed, run by run."""
    return np.concatenate(on_all_cores(answer, [(run, _seed(run.u, run.wi)) for run in _runs(queries)]))


@lru_cache(maxsize=64)
def _bsdf(fabric: Fabric, method: str, bounces: Bounces) -> PatchBSDF:
    """Return a fabric's BSDF; Mitsuba may make the plugin of a scene many times."""
    return PatchBSDF(fabric, _method(method), bounces=bounces)


@lru_cache(maxsize=16)
def _method(name: str) -> Fallback | TruthAnswers:
    return TruthAnswers(_TRUTH) if name == TRUTH else named_method(name, "bsdf twillight", "method")
