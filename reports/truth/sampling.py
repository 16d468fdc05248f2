"""Variance saved by a sampler: one bounce under even light, against cosine sampling.

One bounce towards the viewer, L = integral over the whole sphere of f_P(wi, wo) d(wi) in luminance, estimated by one
direction: f_P / pdf. For each patch the variance over its directions; "saved" is the mean variance of cosine sampling,
half of its directions on either side of the cloth, over that of the sampler. f_P is the truth's (`node_table`), so
nothing but the directions differs. The exact mixture is the best that lobes can do: 256 points of the footprint, none
of them widened.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from pipeline.models.sampler import Sample, Sampler
from pipeline.scenes.shade import colours
from pipeline.shards.queries import QueryOptions, draw_queries
from pipeline.truth.estimator import estimate
from pipeline.truth.options import TruthOptions
from pipeline.truth.query import Queries
from reports.truth.row_records import RowRecords
from weaves.colour import LUMINANCE
from weaves.fabric import Fabric, load_fabric

FABRICS: Final = ("silk_charmeuse", "polyester_lining", "organza", "denim")
"""Lustrous cloth first."""

SETTINGS: Final = (("cosine", 0), ("4 points", 4), ("8 points", 8), ("16 points", 16), ("exact mixture", 256))
"""Samplers and their points; 0: the cosine."""

_ROWS, _DIRECTIONS = 200, 16
_LEAST_COSINE = 1e-6


@dataclass(frozen=True)
class Saving:
    """One sampler on one fabric."""

    sampler: str
    """One of `SETTINGS`."""
    fabric: str
    """On which cloth; "(specular)" where its diffuse light is left out."""
    variance_saved: float
    """Variance of cosine sampling over the sampler's."""
    sample_time: float
    """Nanoseconds of a direction with its density."""
    count: int
    """Directions."""


def measure(rows: int = _ROWS, fabrics: Sequence[str] = FABRICS) -> Iterator[Saving]:
    """Measure every sampler on every fabric, with all its light and with the specular part alone."""
    for name in fabrics:
        cloth = load_fabric(name)
        yield from _savings(cloth, name, rows)
        yield from _savings(_specular(cloth), f"{name} (specular)", rows)


RECORDS: Final = RowRecords(
    Saving,
    {"variance_saved": "variance_saved", "sample_time": "sample_time"},
    setting=("sampler",),
    method="sampler",
)
"""Savings as Records."""


def _savings(fabric: Fabric, name: str, rows: int) -> Iterator[Saving]:
    queries = draw_queries(QueryOptions(max_angle=75.0), fabric.weave.repeat, 3, 0, rows)
    queries = queries.take(np.repeat(np.arange(rows), _DIRECTIONS))
    random = np.random.default_rng(1).random((len(queries.u), 3))
    base = math.nan
    for label, points in SETTINGS:
        sampler = Sampler(points, 0.0 if label == "exact mixture" else 2.0) if points else None
        if sampler:
            sampler.sample(fabric, queries.take(slice(16)), random[:16])
        begun = time.perf_counter()
        drawn = sampler.sample(fabric, queries, random) if sampler else _cosine(random)
        seconds = time.perf_counter() - begun
        values = _light(fabric, queries, drawn).reshape(rows, _DIRECTIONS)
        variance = float(values.var(axis=1, ddof=1).mean())
        base = variance if not points else base
        yield Saving(label, name, base / variance, 1e9 * seconds / len(queries.u), len(queries.u))


def _light(fabric: Fabric, queries: Queries, drawn: Sample) -> npt.NDArray[np.float64]:
    """Return luminance over density of each direction."""
    wi = drawn.wi.copy()
    wi[:, 2] = np.where(np.abs(wi[:, 2]) < _LEAST_COSINE, _LEAST_COSINE, wi[:, 2])
    answers = estimate(fabric, queries._replace(wi=wi), TruthOptions(estimator="node_table"), 1).mean.astype(np.float64)
    front = colours(fabric) @ LUMINANCE
    through = [yarn.diffuse_transmission_rgb for yarn in (fabric.warp, fabric.weft)]
    back = np.concatenate([front[:2], np.array(through) @ LUMINANCE])
    return np.asarray(np.where(wi[:, 2] > 0, answers @ front, answers @ back) / drawn.pdf)


def _cosine(random: npt.NDArray[np.float64]) -> Sample:
    """Draw directions by the cosine, on either side alike."""
    side = np.where(random[:, 0] < 0.5, 1.0, -1.0)
    radius, turn = np.sqrt(random[:, 1]), 2.0 * math.pi * random[:, 2]
    z = side * np.sqrt(np.maximum(1.0 - random[:, 1], _LEAST_COSINE**2))
    wi = np.stack([radius * np.cos(turn), radius * np.sin(turn), z], axis=-1)
    return Sample(wi.astype(np.float32), np.abs(z) / (2.0 * math.pi))


def _specular(fabric: Fabric) -> Fabric:
    """Return the fabric without its diffuse light."""
    black: dict[str, Any] = {"diffuse": (0.0, 0.0, 0.0), "diffuse_transmission": (0.0, 0.0, 0.0)}
    yarns = {name: getattr(fabric, name).model_copy(update=black) for name in ("warp", "weft")}
    return fabric.model_copy(update=yarns)
