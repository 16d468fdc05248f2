"""Variance saved by a sampler, and variance saved in equal time: one bounce under even light, against cosine sampling.

One bounce towards the viewer, in luminance, estimated by one direction:

    L = integral over the whole sphere of f_P(wi, wo) d(wi) + transparency

f_P is that of one method for all samplers, so nothing but the directions differs; light straight through is a delta
lobe with the same probability for all. For each look the variance over its directions; "saved" is the mean variance of
cosine sampling, half of its directions on either side of the cloth, over that of the sampler; "saved in equal time" is
that of variance times time, the time of a direction, its density and its value.

cosine            half of the directions on either side of the cloth
cosine by sides   the cosine, as many on either side as the lobes have there, roughly
one point         the exact lobe of one random point of the footprint, and its cosines
lobes             `PatchBSDF.sample`

The probability of the delta lobe and the sides cost the cosines no time. Looks are random ones of the data sets, and of
the first frame of every shipped scene, whose lights play no part.
"""

import math
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt

from pipeline.analytic.importance.lobes import FAR, HEIGHT, SHARE, STRAIGHT
from pipeline.analytic.importance.mixture import LEAST_COSINE
from pipeline.compiled.arrays import Float32, Float64, Mask
from pipeline.models.patch_bsdf import PatchBSDF
from pipeline.scenes.catalogue import load_scene
from pipeline.scenes.frame import render
from pipeline.scenes.loading import load
from pipeline.scenes.shipped import SHIPPED
from pipeline.shards.queries import QueryOptions, draw_queries
from pipeline.truth.query import Queries
from reports.truth.row_records import RowRecords
from weaves.colour import LUMINANCE
from weaves.fabric import Fabric, load_fabric

_FABRICS: Final = ("silk_charmeuse", "polyester_lining", "organza", "denim")
SETTINGS: Final = ("cosine", "cosine by sides", "one point", "lobes")  # samplers
_DIRECTIONS, _REPEATS = 64, 2
_TO_FAR = 0.1  # share of the flakes' light that reaches the far side, roughly
_POINT = np.float32(1e-3)  # deviation of a point


@dataclass(frozen=True)
class VarianceSaving:
    """One sampler on one fabric."""

    sampler: str  # one of `SETTINGS`
    fabric: str  # "(specular)" where its diffuse light is left out; or the scene
    variance_saved: Annotated[float, "variance_saved"]
    saved_in_time: Annotated[float, "saved_in_time"]
    sample_time: Annotated[float, "sample_time"]  # nanoseconds of a direction with its density
    estimate_time: Annotated[float, "estimate_time"]  # nanoseconds of a direction with its density and value
    count: int  # directions


def measure(
    looks: int = 400, fabrics: Sequence[str] = _FABRICS, scenes: Sequence[str] = tuple(SHIPPED)
) -> Iterator[VarianceSaving]:
    """Measure every sampler on every fabric, with all its light and with the specular part alone, and in scenes."""
    for name in fabrics:
        cloth = load_fabric(name)
        drawn = draw_queries(QueryOptions(max_angle=75.0), cloth.weave.repeat, 3, 0, looks)
        yield from _savings([(cloth, drawn)], name)
        yield from _savings([(_specular(cloth), drawn)], f"{name} (specular)")
    for name in scenes:
        yield from _savings(scene_looks(name, looks), f"scene {name}")


RECORDS: Final = RowRecords(VarianceSaving, setting=("sampler",), method="sampler")


def scene_looks(name: str, looks: int) -> list[tuple[Fabric, Queries]]:
    """Return each cloth of a scene's first frame with random looks, as many as its share of the pixels."""
    loaded = load(load_scene(name))
    # Which lights reach a place takes most of the time of a frame, and matters not here.
    frame = render(replace(loaded, lights=loaded.lights[:1]))
    seen = [(loaded.cloths[key][1], gbuffer) for key, gbuffer in frame.gbuffers.items() if len(gbuffer.pixel)]
    every = [(fabric, gbuffer.looks(fabric.weave.repeat)) for fabric, gbuffer in seen]
    stops = np.cumsum([len(own.u) for _, own in every])
    chosen = np.sort(np.random.default_rng(5).choice(stops[-1], min(looks, int(stops[-1])), replace=False))
    parts = np.split(chosen, np.searchsorted(chosen, stops[:-1]))
    return [
        (fabric, own.take(part - (stop - len(own.u))))
        for (fabric, own), part, stop in zip(every, parts, stops.tolist(), strict=True)
        if part.size
    ]


def _savings(subjects: Sequence[tuple[Fabric, Queries]], name: str) -> Iterator[VarianceSaving]:
    """Yield the savings of all samplers over the looks of some cloths together."""
    parts = [_estimates(fabric, looks) for fabric, looks in subjects]
    base, base_time = math.nan, math.nan
    for sampler in SETTINGS:
        of_subjects, draw_seconds, seconds = zip(*(part[sampler] for part in parts), strict=True)
        values = np.concatenate(of_subjects)
        variance = float(values.var(axis=1, ddof=1).mean())
        draw_time, whole = 1e9 * sum(draw_seconds) / values.size, 1e9 * sum(seconds) / values.size
        if sampler == "cosine":
            base, base_time = variance, whole
        saved = base / variance
        yield VarianceSaving(sampler, name, saved, saved * base_time / whole, draw_time, whole, values.size)


def _estimates(fabric: Fabric, seen: Queries) -> dict[str, tuple[Float64, float, float]]:
    """Return the values that each sampler finds, (looks, directions), and seconds of them all, without and with values.

    Samplers are timed in turns by the processor's clock, the shortest counts.
    """
    count = len(seen.u)
    looks = seen.take(np.repeat(np.arange(count), _DIRECTIONS))
    random = np.random.default_rng(1).random((len(looks.u), 5))
    bsdf = PatchBSDF(fabric)
    point, lobes = PatchBSDF(fabric, bsdf.method, points=1), bsdf.lobes(looks)
    straight, flakes = lobes.rest[:, STRAIGHT].astype(np.float64), lobes.flakes[:, SHARE].sum(axis=1)
    # The share of the scattered light that the lobes expect on the far side, roughly.
    scattered = np.maximum(1.0 - lobes.rest[:, STRAIGHT], 1e-6)
    far = np.asarray((lobes.rest[:, FAR] + _TO_FAR * flakes) / scattered, np.float64)
    places = _points_of(looks, np.random.default_rng(2).standard_normal((len(looks.u), 2)))
    half = np.full(len(far), 0.5)
    draws: dict[str, Callable[[], _Directions]] = {
        "cosine": lambda: _cosine(looks, random, half, straight),
        "cosine by sides": lambda: _cosine(looks, random, far, straight),
        "one point": lambda: _one_point(point, places, random, straight),
        "lobes": lambda: _Directions(*bsdf.draw(looks, random[:, :3])),
    }
    values, best = {}, dict.fromkeys(draws, (math.inf, math.inf))
    for _ in range(_REPEATS + 1):
        for name, draw in draws.items():
            begun = time.thread_time()
            drawn = draw()
            middle = time.thread_time()
            weight = _weights(bsdf, looks, drawn)
            end = time.thread_time()
            # The first round tabulates and compiles.
            if name in values:
                best[name] = min(best[name][0], middle - begun), min(best[name][1], end - begun)
            values[name] = weight
    return {name: (values[name].reshape(count, -1), *best[name]) for name in draws}


class _Directions(NamedTuple):
    """Unit wi, their densities, and which are straight through: these have its probability."""

    wi: Float32
    pdf: npt.NDArray[np.floating[Any]]
    straight: Mask


def _weights(bsdf: PatchBSDF, looks: Queries, drawn: _Directions) -> Float64:
    """Return the luminance of f_P over the density, and of transparency over its probability."""
    queries, straight = looks._replace(wi=drawn.wi), drawn.straight
    values = np.empty(len(straight))
    values[~straight] = bsdf.eval(queries.take(~straight)) @ LUMINANCE
    if straight.any():
        values[straight] = bsdf.method.transparency(bsdf.fabric, queries.take(straight), 0)
    return np.asarray(values / drawn.pdf)


def _cosine(looks: Queries, random: Float64, far: Float64, straight: Float64) -> _Directions:
    """Draw directions by the cosine, of which `far` are on the far side, or straight through."""
    through, behind = random[:, 3] < straight, random[:, 0] < far
    z = np.maximum(np.sqrt(1.0 - random[:, 1]), LEAST_COSINE)
    radius, turn = np.sqrt(random[:, 1]), 2.0 * math.pi * random[:, 2]
    side = np.where(behind, -1.0, 1.0) * np.sign(looks.wo[:, 2])
    wi = np.stack([radius * np.cos(turn), radius * np.sin(turn), side * z], axis=-1).astype(np.float32)
    wi[through] = -looks.wo[through]
    pdf = (1.0 - straight) * np.where(behind, far, 1.0 - far) * z / math.pi
    return _Directions(wi, np.where(through, straight, pdf), through)


def _one_point(bsdf: PatchBSDF, places: Queries, random: Float64, straight: Float64) -> _Directions:
    """Draw directions by the lobe of one point each, or straight through with the footprint's probability."""
    through = random[:, 3] < straight
    lobes = bsdf.lobes(places)
    # Of its own light straight through nothing is drawn.
    rest = 1.0 / np.maximum(1.0 - lobes.rest[:, STRAIGHT], 1e-6)
    lobes.flakes[:, [SHARE, HEIGHT]] *= rest[:, None, None]
    lobes.rest[:] *= rest[:, None]
    lobes.rest[:, STRAIGHT] = 0.0
    wi, pdf, _ = bsdf.draw(places, random[:, :3], lobes)
    wi[through] = -places.wo[through]
    return _Directions(wi, np.where(through, straight, (1.0 - straight) * pdf), through)


def _points_of(looks: Queries, normal: Float64) -> Queries:
    """Return a random point of each footprint, from two standard normal numbers each."""
    along, across = looks.sigma * normal[:, 0], looks.sigma_minor * normal[:, 1]
    cosine, sine = np.cos(looks.angle), np.sin(looks.angle)
    u, v = looks.u + along * cosine - across * sine, looks.v + along * sine + across * cosine
    size = np.full_like(looks.sigma, _POINT)
    return looks._replace(u=u.astype(np.float32), v=v.astype(np.float32), sigma=size, sigma_minor=size)


def _specular(fabric: Fabric) -> Fabric:
    """Return the fabric without its diffuse light."""
    black = dict.fromkeys(("diffuse", "diffuse_transmission"), (0.0, 0.0, 0.0))
    yarns = {name: getattr(fabric, name).model_copy(update=black) for name in ("warp", "weft")}
    return fabric.model_copy(update=yarns)
