"""Cloth that a shape wears: its patch BSDF in the shape's own frame and texture coordinates, in NumPy.

Local frame, as Mitsuba's: z is the shading normal, x the direction of dp_du in the tangent plane. The cloth's frame is
turned by `turn` about z; v is counted backwards where u, v are left-handed (pipeline.scenes.scene). Mitsuba's wi points
to the viewer and its wo to the light: they are `viewer` and `light` here, wo and wi in the queries.

A light on one side of the surface and on the other of its shading normal gives nothing; so no light leaks through
interpolated normals. Views more grazing than allowed are tilted (`pipeline.scenes.places.tilted`).

Rows are answered in runs of fixed length, on all cores. A method that draws points at random takes the seed of a run
from the run's own directions: a picture depends on the seed of its rays alone.
"""

from __future__ import annotations

import math
import zlib
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cache, lru_cache
from typing import Any, Final, NamedTuple, TypeVar

import numpy as np

from pipeline.analytic.importance.lobes import Lobes
from pipeline.compiled.arrays import Float32, Float64, Mask
from pipeline.cores import cores
from pipeline.mitsuba.footprint import LARGEST, PIXEL, Footprints
from pipeline.mitsuba.options import ClothOptions
from pipeline.models.fallback import Fallback
from pipeline.models.method import one_thread
from pipeline.models.named import TRUTH, named_method
from pipeline.models.patch_bsdf import PatchBSDF, Sample
from pipeline.scenes.gbuffer import reduced
from pipeline.scenes.options import SceneOptions
from pipeline.scenes.picture import TruthAnswers
from pipeline.scenes.places import tilted
from pipeline.truth.options import TruthOptions
from pipeline.truth.query import Queries
from weaves.errors import BadInput
from weaves.fabric import Fabric, load_fabric

RUN: Final = 2**14
"""Rows that a thread answers at a time."""

_KEPT = 2**20  # rows of lobes that are kept for the next call: 250 megabytes
_TRUTH = TruthOptions(estimator="auto", relative_error=0.1, min_count=64, max_count=256)  # many rays share a pixel
_LARGEST_ANGLE = SceneOptions().largest_angle
_FLAT = 1e-6  # least |cosine| of a light

Part = TypeVar("Part")


class Hits(NamedTuple):
    """N places of a shape that rays meet, in its local frame.

    Attributes
    ----------
    uv : float64 (N, 2)
        Texture coordinates.
    viewer : float64 (N, 3)
        Unit vectors to where the ray comes from.
    outward : float64 (N, 3)
        Geometric normal; 0 if it is not known.
    handed : float64 (N,)
        -1 where u, v are left-handed about the shading normal, 1 elsewhere.
    jacobian : float64 (N, 2, 2)
        d(uv)/d(pixel); 0 where the ray has no differentials.
    spread : float64 (N,)
        Change of u with the angle of the ray, across it, 1/radian.
    """

    uv: Float64
    viewer: Float64
    outward: Float64
    handed: Float64
    jacobian: Float64
    spread: Float64


class Worn:
    """A cloth on a shape.

    Parameters
    ----------
    options : ClothOptions
        Fabric, method, and place in uv.

    Raises
    ------
    BadInput
        If there is no such fabric or method.
    """

    def __init__(self, options: ClothOptions) -> None:
        self.options = options
        self._bsdf = _bsdf(load_fabric(options.fabric), options.method)
        turn = math.radians(options.turn)
        self._turn = np.array([[math.cos(turn), math.sin(turn)], [-math.sin(turn), math.cos(turn)]])
        self._known: tuple[Queries, list[Lobes]] | None = None

    @property
    def fabric(self) -> Fabric:
        """The fabric."""
        return self._bsdf.fabric

    def eval(self, hits: Hits, light: Float64) -> Float64:
        """Return the BSDF times the cosine to N lights, linear RGB (N, 3), 1/sr."""
        result = self._ask(self._queries(hits, light), lambda rows, seed, lobes: self._bsdf.eval(rows, seed))
        return np.where(_lit(hits, light)[:, None], np.concatenate(result), 0.0)

    def pdf(self, hits: Hits, light: Float64) -> Float32:
        """Return the density with which `sample` draws N lights, (N,), 1/sr."""
        looks = self._queries(hits, light)
        lobes = self._lobes(hits)
        return np.concatenate(self._ask(looks, lambda rows, seed, known: self._bsdf.pdf(rows, known), lobes))

    def sample(self, hits: Hits, random: Float64) -> Sample:
        """Draw a direction to the light for each hit, from random numbers (N, 3) in [0, 1)."""
        looks, lobes = self._looks(hits), self._lobes(hits)
        runs = [slice(start, start + RUN) for start in range(0, len(random), RUN)]
        tasks = [(looks.take(run), random[run], known) for run, known in zip(runs, lobes, strict=True)]
        found = _on_all_cores(
            lambda task: self._bsdf.sample(task[0], task[1], task[2], _seed(task[0].u, task[1])), tasks
        )
        wi, pdf, straight, weight = (np.concatenate(column) for column in zip(*found, strict=True))
        light = np.where(straight[:, None], -hits.viewer, self._from_cloth(wi.astype(np.float64)))
        weight[~straight & ~_lit(hits, light)] = 0.0
        return Sample(light.astype(np.float32), pdf, straight, weight)

    def transparency(self, hits: Hits) -> Float32:
        """Return the share of light from straight behind that reaches the viewer of each hit, (N,)."""
        method = self._bsdf.method
        parts = self._ask(self._looks(hits), lambda rows, seed, lobes: method.transparency(self.fabric, rows, seed))
        return np.concatenate(parts)

    def _queries(self, hits: Hits, light: Float64) -> Queries:
        towards = self._to_cloth(light)
        # A light in the plane has no answer; it counts as dark (`_lit`).
        towards[:, 2] = np.where(np.abs(towards[:, 2]) < _FLAT, _FLAT, towards[:, 2])
        return self._looks(hits)._replace(wi=towards.astype(np.float32))

    def _looks(self, hits: Hits) -> Queries:
        """Return the footprint and viewer of each hit as queries, lit from the viewer."""
        yarns = np.stack([np.ones_like(hits.handed), hits.handed], axis=-1) * self.options.cloth.yarns
        place = (hits.uv * yarns) @ self._turn.T
        facing = np.einsum("ni,ni->n", hits.outward, hits.viewer)
        side = np.where(np.where(facing == 0.0, hits.viewer[:, 2], facing) < 0.0, -1.0, 1.0)
        wo = tilted(self._to_cloth(hits.viewer), side, _LARGEST_ANGLE).astype(np.float32)
        footprints = self._footprints(hits, yarns)
        ends, picks = self.fabric.repeat
        return Queries(
            reduced(place[:, 0], ends),
            reduced(place[:, 1], picks),
            footprints.sigma,
            wo,
            wo,
            footprints.sigma_minor,
            footprints.angle,
            np.zeros(len(wo), np.float32),
        )

    def _footprints(self, hits: Hits, yarns: Float64) -> Footprints:
        if self.options.sigma is not None:
            return Footprints.round(np.full(len(hits.uv), self.options.sigma))
        traced = np.asarray(hits.jacobian.any(axis=(1, 2)))
        found = Footprints.of(self._turn @ (hits.jacobian * yarns[..., None]))
        if traced.all():
            return found
        if self.options.pixel_angle is None:
            raise BadInput(
                f"bsdf {self.fabric.name}", "pixel_angle", None, "a ray without a footprint: use the integrator "
                "twillight_path, or state pixel_angle or sigma",
            )  # fmt: skip
        width = PIXEL * self.options.pixel_angle * hits.spread * self.options.yarns
        return Footprints.joined(traced, found, Footprints.round(np.nan_to_num(width, nan=LARGEST)))

    def _lobes(self, hits: Hits) -> list[Lobes]:
        """Return the lobes of each run; those of the last call if its hits were the same."""
        looks, known = self._looks(hits), self._known
        if known is not None and all(map(np.array_equal, known[0], looks)):
            return known[1]
        lobes = self._ask(looks, lambda rows, seed, _: self._bsdf.lobes(rows))
        self._known = (looks, lobes) if len(looks.u) <= _KEPT else None
        return lobes

    def _ask(
        self,
        queries: Queries,
        answer: Callable[[Queries, int, Lobes | None], Part],
        lobes: Sequence[Lobes] | None = None,
    ) -> list[Part]:
        """Return the answers of each run of queries."""
        runs = [queries.take(slice(start, start + RUN)) for start in range(0, len(queries.u), RUN)]
        known: Sequence[Lobes | None] = lobes or [None] * len(runs)
        tasks = list(zip(runs, known, strict=True))
        return _on_all_cores(lambda task: answer(task[0], _seed(task[0].u, task[0].wi), task[1]), tasks)

    def _to_cloth(self, direction: Float64) -> Float64:
        result = direction.copy()
        result[:, :2] = direction[:, :2] @ self._turn.T
        return result

    def _from_cloth(self, direction: Float64) -> Float64:
        result = direction.copy()
        result[:, :2] = direction[:, :2] @ self._turn
        return result


def _lit(hits: Hits, light: Float64) -> Mask:
    """Return which lights are on one side of both normals, and not in the plane, (N,)."""
    facing = np.einsum("ni,ni->n", hits.outward, light) * np.where(hits.outward[:, 2] < 0.0, -1.0, 1.0)
    known = hits.outward.any(axis=1)
    return np.asarray((np.abs(light[:, 2]) > _FLAT) & (~known | (light[:, 2] * facing > 0.0)))


def _seed(place: Float32, drawn: Float32 | Float64) -> int:
    """Return a number that any change of places and of directions, or of what draws them, changes."""
    return zlib.crc32(drawn.tobytes(), zlib.crc32(place.tobytes()))


def _on_all_cores(answer: Callable[[Any], Part], tasks: Sequence[Any]) -> list[Part]:
    """Return the answers to tasks, by threads if there are several."""
    with one_thread():
        if len(tasks) == 1:
            return [answer(tasks[0])]
        # Before any thread starts, the first task loads kernels and tabulates the fabric.
        return [answer(tasks[0]), *_pool().map(answer, tasks[1:])] if tasks else []


@cache
def _pool() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(cores())


@lru_cache(maxsize=64)
def _bsdf(fabric: Fabric, method: str) -> PatchBSDF:
    """Return a fabric's BSDF; Mitsuba may make the plugin of a scene many times."""
    return PatchBSDF(fabric, _method(method))


@lru_cache(maxsize=16)
def _method(name: str) -> Fallback | TruthAnswers:
    return TruthAnswers(_TRUTH) if name == TRUTH else named_method(name, "bsdf twillight", "method")
